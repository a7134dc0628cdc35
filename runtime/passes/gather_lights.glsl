// Light of the scene's own lights on texels of cubes: a point on each, and a shadow ray to one of them,
// chosen by what each would bring (Talbot, Cline, Egbert 2005). Part of gather_rays.glsl; in cells.
#include "light_points.glsl"

uniform uvec4 light_offset;  // turns, by seed and set
#if SUNS > 0
uniform vec4 sun_place[SUNS];  // direction towards it, angular radius
uniform vec3 sun_light[SUNS];
#endif
#if SPHERES > 0
uniform vec4 sphere_place[SPHERES];  // centre, radius
uniform vec3 sphere_light[SPHERES];
#endif
#if DISCS > 0
uniform vec4 disc_place[DISCS];  // centre, radius
uniform vec4 disc_axis[DISCS];   // axis, 1 where two-sided
uniform vec3 disc_light[DISCS];
#endif
#if POLYGONS > 0
uniform vec3 polygon_corner[POLYGONS * POLYGON_CORNERS];
uniform vec4 polygon_front[POLYGONS];  // where it faces, size
uniform vec4 polygon_light[POLYGONS];  // radiance, 1 where two-sided

// Corners after the last repeat the first
bool is_parallelogram(int first) {
    vec3 one = polygon_corner[first + 1] - polygon_corner[first];
    vec3 other = polygon_corner[first + 2] - polygon_corner[first + 3];
    vec3 apart = one - other;
    bool four = dot(apart, apart) < 1e-8 * dot(one, one);
#if POLYGON_CORNERS > 4
    return four && polygon_corner[first + 4] == polygon_corner[first];
#else
    return four;
#endif
}

// A parallelogram evenly; else a triangle of the fan by its area, then a point on it
LightPoint polygon_point(vec3 from, int i, vec3 u) {
    int first = i * POLYGON_CORNERS;
    vec3 corner = polygon_corner[first];
    vec3 front = polygon_front[i].xyz;
    bool both = polygon_light[i].a > 0.5;
    if (is_parallelogram(first)) {
        vec3 x = polygon_corner[first + 1] - corner;
        vec3 y = polygon_corner[first + 3] - corner;
        vec3 at = corner + u.x * x + u.y * y;
        return flat_point(from, at, front, length(cross(x, y)), polygon_light[i].rgb, both);
    }
    float area = 0.0;
    for (int k = 1; k + 1 < POLYGON_CORNERS; ++k) {
        vec3 a = polygon_corner[first + k] - corner;
        area += 0.5 * length(cross(a, polygon_corner[first + k + 1] - corner));
    }
    float left = u.z * area;
    vec3 x = vec3(0.0);
    vec3 y = vec3(0.0);
    for (int k = 1; k + 1 < POLYGON_CORNERS; ++k) {
        vec3 a = polygon_corner[first + k] - corner;
        vec3 b = polygon_corner[first + k + 1] - corner;
        float own = 0.5 * length(cross(a, b));
        // Rounding may leave more than all: then the last one that has any stays
        bool here = left >= 0.0 && own > 0.0;
        x = here ? a : x;
        y = here ? b : y;
        left -= own;
    }
    float root = sqrt(u.x);
    vec3 at = corner + root * ((1.0 - u.y) * x + u.y * y);
    return flat_point(from, at, front, area, polygon_light[i].rgb, both);
}
#endif

struct LightChoice {
    vec3 d;
    float reach;
    vec3 brought;
    float bright;
    float sum;
    float chance;
};

void offer_light(inout LightChoice choice, LightPoint found, vec3 normal) {
    vec3 light = found.light * max(dot(found.d, normal), 0.0);
    float weight = luminance(light);
    choice.sum += weight;
    float share = choice.sum > 0.0 ? weight / choice.sum : 0.0;
    bool taken = choice.chance < share;
    choice.chance = taken ? choice.chance / share : (choice.chance - share) / max(1.0 - share, 1e-7);
    choice.d = taken ? found.d : choice.d;
    choice.reach = taken ? found.reach : choice.reach;
    choice.brought = taken ? light : choice.brought;
    choice.bright = taken ? weight : choice.bright;
}

// Irradiance by one shadow ray
vec3 from_lights(ivec3 front, vec3 start, vec3 normal, uvec4 shift, float jitter) {
    uint number = 2u * pass_index + swap;
#if SPREAD
    vec4 u = unit(shift + uvec4(pair(number), quad(number).zw) + light_offset);
#else
    vec4 u = unit(shift * (2u * number + 1u) + number * 2654435769u + light_offset);
#endif
    LightChoice choice = LightChoice(normal, 0.0, vec3(0.0), 1.0, 0.0, u.w);
#if SUNS > 0
    for (int i = 0; i < SUNS; ++i) {
        offer_light(choice, sun_point(sun_place[i], sun_light[i], u.xy), normal);
    }
#endif
#if SPHERES > 0
    for (int i = 0; i < SPHERES; ++i) {
        offer_light(choice, sphere_point(start, sphere_place[i], sphere_light[i], u.xy), normal);
    }
#endif
#if DISCS > 0
    for (int i = 0; i < DISCS; ++i) {
        bool both = disc_axis[i].w > 0.5;
        vec3 axis = disc_axis[i].xyz;
        offer_light(choice, disc_point(start, disc_place[i], axis, disc_light[i], both, u.xy), normal);
    }
#endif
#if POLYGONS > 0
    for (int i = 0; i < POLYGONS; ++i) {
        offer_light(choice, polygon_point(start, i, u.xyz), normal);
    }
#endif
    if (choice.sum <= 0.0) {
        return vec3(0.0);
    }
    Hit hit = follow(front, start, choice.d, jitter);
    bool seen = hit.face < 0 || hit.t >= choice.reach * 0.9999;
#if FREE
    for (int i = 0; i < FREE; ++i) {
        float fall;
        float entry = cube_entry(start, choice.d, cube_place[i], fall);
        seen = seen && !(entry >= 0.0 && entry < choice.reach);
    }
#endif
    return seen ? choice.brought * (choice.sum / choice.bright) : vec3(0.0);
}
