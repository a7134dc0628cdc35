// What a world of cubes sends to points: a row a point, a column a ray.
#include "traverse.glsl"
#include "texel_places.glsl"
#include "colour.glsl"

uniform WORLD world;
uniform usampler3D rows;
uniform sampler2D albedo;
uniform sampler2D lightmap;
uniform usampler3D page_of;
uniform usampler2D pages;
uniform sampler2D rays;        // directions, w 0; places in lamp w - 1; places -1; directions -2
uniform ivec3 size;
uniform int n;                 // texels a cell side
uniform float scale;           // radiance of a full code
uniform vec3 origin[POINTS];   // cells
#if LAMPS > 0
uniform vec4 lamp[LAMPS];      // middle and half side, cells
#endif
#if SKY
uniform sampler2D sky;
#endif
#if GLOWS
uniform float even;            // even rays a steradian
uniform float aimed;           // places on what glows, over all its power
#endif

layout(location = 0) out vec4 found;

const uint NOTHING = 65535u;

int row_of(ivec3 cell) {
    return int(texelFetch(rows, cell, 0).x);
}

// From anywhere: a point outside sees the world through the side where the ray enters
Hit first_hit(vec3 from, vec3 direction) {
    ivec3 cell = ivec3(floor(from));
    if (is_inside(cell, size)) return exact(world, size, cell, from, direction);
    vec3 inverse = inverse_of(direction);
    vec3 one = -from * inverse;
    vec3 other = (vec3(size) - from) * inverse;
    vec3 enters = min(one, other);
    vec3 leaves = max(one, other);
    int axis = enters.x >= enters.y && enters.x >= enters.z ? 0 : enters.y >= enters.z ? 1 : 2;
    float t = enters[axis];
    if (t < 0.0 || t >= min(leaves.x, min(leaves.y, leaves.z))) return Hit(cell, -1, 0.0, 0);
    int ahead = direction[axis] >= 0.0 ? 1 : 0;
    cell = clamp(ivec3(floor(from + direction * t)), ivec3(0), size - 1);
    cell[axis] = (1 - ahead) * (size[axis] - 1);
    if (solid_at(world, cell)) return Hit(cell, 2 * axis + ahead, t, 1);
    return exact(world, size, cell, from, direction);
}

// Past the cells of lamps, which have no row of their own
Hit past_lamps(vec3 from, vec3 direction) {
    Hit hit = first_hit(from, direction);
#if LAMPS > 0
    for (int i = 0; i < 32; ++i) {
        if (hit.face < 0 || row_of(hit.cell) > 0) break;
        hit = exact(world, size, hit.cell, from, direction);
    }
#endif
    return hit;
}

vec3 sent_by(Hit hit, vec3 point, vec3 direction) {
    int row = row_of(hit.cell);
    vec3 radiance = light_at(world, hit.cell).rgb * scale;
#if GLOWS
    // Places find it too: both kinds count by their density
    float fall = max(abs(direction[hit.face >> 1]), 1e-9);
    radiance *= even / (even + aimed * luminance(radiance) * hit.t * hit.t / fall);
#endif
    uint page = texelFetch(page_of, hit.cell, 0).x;
    uvec2 first = texelFetch(pages, ivec2(int(page & 255u) * 6 + hit.face, int(page >> 8u)), 0).xy;
    if (first.x == NOTHING) return radiance;
    ivec2 texel = ivec2(first) + texel_on(hit.face, hit.cell, point, n);
    vec3 colour = texelFetch(albedo, ivec2(row & 255, row >> 8), 0).rgb;
    return radiance + colour * texelFetch(lightmap, texel, 0).rgb * 0.3183098861837907;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 ray = texelFetch(rays, ivec2(at.x, 0), 0);
    vec3 from = origin[at.y];
    vec3 direction = ray.xyz;
    found = vec4(0.0);
#if LAMPS > 0
    if (ray.w > 0.0) {
        vec4 place = lamp[int(ray.w) - 1];
        direction = place.xyz + place.w * ray.xyz - from;
        Hit hit = past_lamps(from, direction);
        found.a = hit.face < 0 || hit.t > 0.9999 ? 1.0 : 0.0;
        return;
    }
#endif
#if GLOWS || LIGHTS
    if (ray.w < 0.0) {
        if (ray.w > -1.5) direction -= from;
        Hit hit = past_lamps(from, direction);
        found.a = hit.face < 0 || (ray.w > -1.5 && hit.t > 0.9999) ? 1.0 : 0.0;
        return;
    }
#endif
    Hit hit = past_lamps(from, direction);
    if (hit.face >= 0) {
        found.rgb = sent_by(hit, from + direction * hit.t, direction);
    }
#if SKY
    else {
        found.rgb = textureLod(sky, lat_long(direction), 0.0).rgb;
    }
#endif
}
