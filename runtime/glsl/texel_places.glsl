// Where a texel of a world of cubes lies, in cells. Faces count +x, -x, +y, -y, +z, -z; the two axes
// along a face follow its own: x has (y, z), y has (z, x), z has (x, y).

// From (along the axis, u, v) to (x, y, z)
vec3 from_face(int axis, vec3 local) {
    return axis == 0 ? local : axis == 1 ? local.zxy : local.yzx;
}

// From (x, y, z) to (along the axis, u, v)
vec3 to_face(int axis, vec3 world) {
    return axis == 0 ? world : axis == 1 ? world.yzx : world.zxy;
}

// Components of a face's normal
ivec3 normal_of(int face) {
    int axis = face >> 1;
    return ivec3(axis == 0, axis == 1, axis == 2) * (1 - 2 * (face & 1));
}

// Texel (u, v) of n x n on the face of a cell that a point lies on
ivec2 texel_on(int face, ivec3 cell, vec3 point, int n) {
    vec2 place = to_face(face >> 1, point - vec3(cell)).yz;
    return clamp(ivec2(floor(place * float(n))), ivec2(0), ivec2(n - 1));
}

// Coordinates of a lat-long map: the middle column looks along -z, row 0 up
vec2 lat_long(vec3 d) {
    vec3 unit_d = normalize(d);
    float turn = abs(unit_d.x) + abs(unit_d.z) > 0.0 ? atan(unit_d.x, -unit_d.z) : 0.0;
    return vec2(0.5 + turn * 0.15915494309189535, acos(clamp(unit_d.y, -1.0, 1.0)) * 0.3183098861837907);
}
