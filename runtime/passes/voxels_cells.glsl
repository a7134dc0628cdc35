// Cells of a world of cubes: rows of palettes, 0 for empty.
uniform usampler3D cells;
uniform sampler2D albedo;    // 256 rows of the palette a row of texels
uniform sampler2D emission;  // the same
uniform vec3 grid_origin;    // lowest corner, metres
uniform float cell_size;     // metres

// Row of the palette of a cell; 0 outside of the grid.
int row_at(ivec3 cell) {
    ivec3 size = textureSize(cells, 0);
    if (any(lessThan(cell, ivec3(0))) || any(greaterThanEqual(cell, size))) {
        return 0;
    }
    return int(texelFetch(cells, cell, 0).r);
}

vec3 of_row(sampler2D palette, int row) {
    return texelFetch(palette, ivec2(row & 255, row >> 8), 0).rgb;
}

// Cell behind a face, one of those from `first` to `last`: samples beyond an edge may lie off it.
ivec3 cell_behind(vec3 point, vec3 normal, ivec3 first, ivec3 last) {
    vec3 at = (point - grid_origin) / cell_size - 0.5 * normal;
    return clamp(ivec3(floor(at)), first, last);
}
