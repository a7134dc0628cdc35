// One ray a texel of a world of cubes, added to what earlier passes found.
// MODE 0 exact, 1 sphere, 2 march, 3 talk. AIMED: the rays of this pass go to what glows. For studies: SPREAD 0, independent numbers; VISITS 1, the
// number of cells that a ray looked at in place of light.
#include "traverse.glsl"
#include "texel_sequences.glsl"
#include "hashing.glsl"
#include "texel_places.glsl"
#include "colour.glsl"

uniform WORLD world;
uniform usampler2D texels;       // x, y, z of the cell, face * 4096 + v * 64 + u; 65535 for none
uniform sampler2D direct_sum;    // what glows, and passes
uniform sampler2D indirect_sum;  // what surfaces hand on, and rays along the cosine
uniform sampler2D latest;        // what surfaces handed on lately; difference of both sets
uniform ivec3 size;
uniform int n;              // texels a cell side
uniform float scale;        // radiance of a full code
uniform uint pass_index;    // number of the pass within its set and kind
uniform uint swap;          // which pass of a pair
uniform float set_sign;     // +1 and -1 for the two sets
uniform uvec4 offset;       // turns, by seed, set and kind
uniform uvec4 aim_offset;
uniform float settled;      // passes from which nothing is forgotten
uniform float keep;         // of what surfaces handed on, until then
uniform float blend;        // of this pass in `latest`
uniform float counts;       // 1 where what surfaces hand on is added up
uniform float passes_per_ray;  // along the cosine: 2 where others are aimed, else 1
layout(location = 0) out vec4 direct_out;
layout(location = 1) out vec4 indirect_out;
layout(location = 2) out vec4 latest_out;

const float PI = 3.14159265358979;
const uint NOTHING = 65535u;
#if SPREAD
#define STEPS(x) (x)
#else
#define STEPS(x) uvec4(0u)
#endif

struct Found {
    vec3 direct;
    vec3 indirect;
};

// The sets are apart by another shift at each texel: else they would not be independent
uvec4 shift_of(uvec3 place) {
#if SPREAD
    return texel_dither(set_sign > 0.0 ? place : place.yzx);
#else
    uint key = pcg(place.x, place.y, place.z, 2u * pass_index + uint(set_sign > 0.0));
    return uvec4(pcg(key), pcg(key, 1u), pcg(key, 2u), pcg(key, 3u));
#endif
}

#if MODE == 3
#include "gather_talk.glsl"
#else
#include "gather_rays.glsl"
#endif

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    uvec4 texel = texelFetch(texels, at, 0);
    // What is unused was cleared once, and stays
    if (texel.w == NOTHING) discard;
    direct_out = indirect_out = latest_out = vec4(0.0);
    ivec3 cell = ivec3(texel.xyz);
    int face = int(texel.w >> 12u);
    ivec3 front = cell + normal_of(face);
    // A texel that is covered, or whose cell is gone, has no light: less than no passes
    if (!solid_at(world, cell) || (is_inside(front, size) && solid_at(world, front))) {
        direct_out.a = -1.0;
        return;
    }
    uvec2 uv = uvec2(texel.w & 63u, (texel.w >> 6u) & 63u);
    vec3 corner = to_face(face >> 1, vec3(cell));
    vec3 local = vec3(corner.x + float(1 - (face & 1)), corner.yz + (vec2(uv) + 0.5) / float(n));
    uvec3 place = uvec3(from_face(face >> 1, vec3(local.x * float(n), corner.yz * float(n) + vec2(uv))));

    Found found = look(cell, front, face, from_face(face >> 1, local), place);

    vec4 direct = max(texelFetch(direct_sum, at, 0), 0.0);
    vec4 indirect = texelFetch(indirect_sum, at, 0);
    vec4 last = texelFetch(latest, at, 0);
    float difference = luminance(found.direct);
#if !AIMED
    float kept = direct.a < settled ? keep : 1.0;
    indirect = mix(indirect, kept * indirect + vec4(found.indirect, 1.0), counts);
    last.rgb = mix(last.rgb, found.indirect, blend);
    difference += counts * luminance(found.indirect) * passes_per_ray;
#endif
    direct_out = direct + vec4(found.direct, 1.0);
    indirect_out = indirect;
    latest_out = vec4(last.rgb, last.a + set_sign * difference);
}
