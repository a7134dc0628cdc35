// Real rays of a gather; part of gather.frag. Two kinds take turns from pass to pass: along the cosine,
// and, AIMED, at one of a few glowing faces chosen by power. Weights are those of the balance heuristic
// (Veach, Guibas 1995). Light that surfaces hand on is found by the cosine alone.

uniform usampler2D lamps;
uniform uint lamp_count;
uniform float lamp_power;   // sum of luminances
#if BOUNCES
uniform usampler3D page_of;
uniform usampler2D pages;
uniform sampler2D sent;     // albedo / pi times irradiance, of each texel
#endif
#if MODE == 1
uniform usampler3D gaps;
#elif MODE == 2
uniform int samples;
#endif
#if SKY
uniform sampler2D sky;
#endif
#if FREE
#include "free_cubes.glsl"
uniform vec4 cube_place[FREE];  // middle and half side of lamps that move freely, cells
uniform vec3 cube_light[FREE];  // what they send out
#endif

#define CANDIDATES 8

Hit follow(ivec3 cell, vec3 origin, vec3 d, float jitter) {
#if MODE == 0
    return exact(world, size, cell, origin, d);
#elif MODE == 1
    return sphere(gaps, size, cell, origin, d);
#else
    return march(world, size, cell, origin, d, exit_length(size, origin, d), samples, jitter);
#endif
}

#if LIGHTS
#include "gather_lights.glsl"
#endif

#if BOUNCES

uvec2 first_texel(uint page, int face) {
    return texelFetch(pages, ivec2(int(page & 255u) * 6 + face, int(page >> 8u)), 0).xy;
}

// What the surface that was hit hands on
vec3 handed_on(Hit hit, vec3 point) {
    uint page = texelFetch(page_of, hit.cell, 0).x;
    uvec2 first = first_texel(page, hit.face);
    int face = hit.face;
#if MODE == 2
    // A ray that stepped through a corner may have come in by a face that is covered
    for (int i = 0; i < 6 && first.x == NOTHING; ++i) {
        face = i;
        first = first_texel(page, i);
    }
#endif
    if (first.x == NOTHING) {
        return vec3(0.0);
    }
    return texelFetch(sent, ivec2(first) + texel_on(face, hit.cell, point, n), 0).rgb;
}

#endif

// A point on a glowing face, and the face, from three turns for the face and the place on it
void choose(uvec4 turns, out ivec3 cell, out int face, out vec3 point) {
    vec4 u = unit(turns);
    int row = min(int(u.x * float(lamp_count)), int(lamp_count) - 1);
    uvec4 entry = texelFetch(lamps, ivec2(row & 1023, row >> 10), 0);
    uint chosen = u.y < uintBitsToFloat(entry.y) ? entry.x : entry.z;
    cell = ivec3(uvec3(chosen, chosen >> 9u, chosen >> 18u) & 511u);
    face = int(chosen >> 27u);
    point = vec3(cell) + from_face(face >> 1, vec3(float(1 - (face & 1)), u.zw));
}

// Light from a direction, divided by the sum of the densities per steradian, each times its rays a
// pass, by which it is found; aimed: the part of those that are aimed
vec3 weighed(vec3 radiance, float cosine, float aims, float aimed) {
    float density = (1.0 - aims) * cosine / PI + aims * aimed;
    return radiance * max(cosine, 0.0) / max(density, 1e-20);
}

float aimed_at_face(vec3 radiance, float squared, float fall) {
    float chance = luminance(radiance) / max(lamp_power, 1e-20);
    return float(CANDIDATES) * chance * squared / max(fall, 1e-9);
}

#if FREE

float aimed_at_cube(vec3 start, int i, float squared, float fall) {
    vec3 sides = abs(cube_sides(start, cube_place[i]));
    float area = 4.0 * cube_place[i].w * cube_place[i].w * (sides.x + sides.y + sides.z);
    return area > 0.0 ? squared / (max(fall, 1e-9) * area) : 0.0;
}

#endif

// What is chosen among candidates by what each would bring if nothing stood before it: the mean over
// all of them then stands for the one (Talbot, Cline, Egbert 2005)
struct Choice {
    vec3 d;
    ivec3 cell;   // that glows, or negative
    int cube;     // that glows, or negative
    vec3 brought;
    float bright;
    float sum;
    float chance;
};

void offer(inout Choice choice, vec3 d, ivec3 cell, int cube, vec3 light) {
    float weight = luminance(light);
    choice.sum += weight;
    float share = choice.sum > 0.0 ? weight / choice.sum : 0.0;
    bool taken = choice.chance < share;
    float chance = taken ? choice.chance / share : (choice.chance - share) / max(1.0 - share, 1e-7);
    choice.chance = chance;
    choice.d = taken ? d : choice.d;
    choice.cell = taken ? cell : choice.cell;
    choice.cube = taken ? cube : choice.cube;
    choice.brought = taken ? light : choice.brought;
    choice.bright = taken ? weight : choice.bright;
}

uvec4 turns_of(uvec4 shift, uint number) {
#if SPREAD
    return shift + quad(number) + aim_offset;
#else
    return shift * (2u * number + 1u) + aim_offset + number * 2654435769u;
#endif
}

Choice aim(vec3 start, vec3 normal, uvec4 shift, float aims) {
    float chance = unit(shift.wzyx + STEPS(quad(pass_index)).yxwz + aim_offset).x;
    Choice choice = Choice(normal, ivec3(-1), -1, vec3(0.0), 1.0, 0.0, chance);
    for (int j = 0; j < (lamp_count > 0u ? CANDIDATES : 0); ++j) {
        ivec3 cell;
        int face;
        vec3 point;
        choose(turns_of(shift, pass_index * uint(CANDIDATES) + uint(j)), cell, face, point);
        vec3 d = point - start;
        float squared = dot(d, d);
        float cosine = dot(d, normal) * inversesqrt(squared);
        float fall = -dot(d, vec3(normal_of(face))) * inversesqrt(squared);
        vec3 light = light_at(world, cell).rgb * scale;
        light = weighed(light, cosine, aims, aimed_at_face(light, squared, fall));
        offer(choice, d, cell, -1, fall > 0.0 ? light : vec3(0.0));
    }
#if FREE
    for (int i = 0; i < FREE; ++i) {
        vec3 u = unit(turns_of(shift.yzwx, pass_index * uint(FREE) + uint(i))).xyz;
        vec3 sides = cube_sides(start, cube_place[i]);
        vec3 d = cube_point(sides, cube_place[i], u) - start;
        float fall;
        float entry = cube_entry(start, d, cube_place[i], fall);
        float squared = dot(d, d);
        float cosine = dot(d, normal) * inversesqrt(squared);
        vec3 light = weighed(cube_light[i], cosine, aims, aimed_at_cube(start, i, squared, fall));
        offer(choice, d, ivec3(-1), i, sides != vec3(0.0) && entry > 0.0 ? light : vec3(0.0));
    }
#endif
    return choice;
}

Found look(ivec3 cell, ivec3 front, int face, vec3 start, uvec3 place) {
    vec3 normal = vec3(normal_of(face));
    float aims = lamp_count > 0u || FREE > 0 ? 0.5 : 0.0;
    uvec4 shift = shift_of(place);
    vec3 direct = vec3(0.0);
    vec3 handed = vec3(0.0);
#if AIMED
    Choice choice = aim(start, normal, shift, aims);
    vec3 d = choice.d;
    bool useful = choice.sum > 0.0;
    int own_cube = choice.cube;
    uvec4 turns = shift + STEPS(quad(pass_index)) + aim_offset;
    float jitter = unit(turns.wzyx + turns.yxwz).y;
    // A ray that cannot bring anything starts outside and ends there
    Hit hit = follow(useful ? front : ivec3(-1), start, d, jitter);
#else
    int own_cube = -1;
    uvec4 turns = shift + STEPS(uvec4(pair(pass_index), quad(pass_index).zw)) + offset;
    vec4 u = unit(turns);
    float radius = sqrt(u.x);
    float phi = 2.0 * PI * u.y;
    vec3 local = vec3(sqrt(1.0 - u.x), radius * cos(phi), radius * sin(phi));
    local.x *= float(1 - 2 * (face & 1));
    vec3 d = from_face(face >> 1, local);
    float jitter = u.z;
    Hit hit = follow(front, start, d, jitter);
#endif
#if VISITS
    return Found(vec3(float(hit.visited)), vec3(0.0));
#endif
    // The first cube before what was hit
    int cube = -1;
    float fall = 0.0;
    float reach = hit.face < 0 ? 1e30 : hit.t;
#if FREE
    for (int i = 0; i < FREE; ++i) {
        float falls;
        float entry = cube_entry(start, d, cube_place[i], falls);
        bool before = entry >= 0.0 && entry < reach && i != own_cube;
        cube = before ? i : cube;
        fall = before ? falls : fall;
        reach = before ? entry : reach;
    }
#endif
#if AIMED
    bool seen = reach > 0.9999 || (cube < 0 && hit.cell == choice.cell);
    direct = useful && seen ? choice.brought * (choice.sum / choice.bright) : vec3(0.0);
#else
    if (cube >= 0) {
#if FREE
        float part = aimed_at_cube(start, cube, reach * reach, fall);
        direct = weighed(cube_light[cube], dot(d, normal), aims, part);
#endif
    } else if (hit.face >= 0) {
        vec3 radiance = light_at(world, hit.cell).rgb * scale;
        float part = aimed_at_face(radiance, hit.t * hit.t, abs(d[hit.face >> 1]));
        direct = weighed(radiance, dot(d, normal), aims, part);
#if BOUNCES
        handed = handed_on(hit, start + d * hit.t);
#endif
    }
#if SKY
    else {
        direct = textureLod(sky, lat_long(d), 0.0).rgb * PI / (1.0 - aims);
    }
#endif
#endif
#if LIGHTS
    direct += from_lights(front, start, normal, shift, jitter);
#endif
    return Found(direct, PI * handed);
}
