// Opaque Lambert surfaces: albedo / pi times the irradiance of every light, and what they emit.
#include "lights.glsl"

uniform vec3 base_color;
uniform vec3 emissive;
#if TEXTURED
uniform sampler2D albedo_texture;
in vec2 uv;
#endif
#if COLOURED
in vec3 colour_of_vertex;
#endif
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
#endif
#if ENVIRONMENT
uniform vec3 ambient[9];  // harmonics of the irradiance
#endif

in vec3 point;
in vec3 normal;

layout(location = 0) out vec4 colour;

// Irradiance of every light, W/m^2.
vec3 light_at(vec3 at, vec3 n) {
    vec3 light = vec3(0.0);
#if ENVIRONMENT
    light += harmonic_irradiance(n, ambient);
#endif
#if SUNS > 0
    for (int i = 0; i < SUNS; ++i) {
        light += sun_irradiance(n, sun_place[i].xyz, sun_light[i], sun_place[i].w);
    }
#endif
#if SPHERES > 0
    for (int i = 0; i < SPHERES; ++i) {
        light += sphere_irradiance(at, n, sphere_place[i].xyz, sphere_place[i].w, sphere_light[i]);
    }
#endif
#if DISCS > 0
    for (int i = 0; i < DISCS; ++i) {
        light += disc_irradiance(at, n, disc_place[i].xyz, disc_axis[i].xyz, disc_place[i].w,
                                 disc_light[i], disc_axis[i].w > 0.5);
    }
#endif
#if POLYGONS > 0
    for (int i = 0; i < POLYGONS; ++i) {
        vec3 corners[POLYGON_CORNERS];
        for (int k = 0; k < POLYGON_CORNERS; ++k) {
            corners[k] = polygon_corner[i * POLYGON_CORNERS + k];
        }
        light += polygon_irradiance(at, n, corners, polygon_front[i].xyz, polygon_front[i].w,
                                    polygon_light[i].rgb, polygon_light[i].a > 0.5);
    }
#endif
    return light;
}

void main() {
    // Both sides are lit, each by what is on its own side; nothing shines through
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    vec3 albedo = base_color;
#if TEXTURED
    albedo *= texture(albedo_texture, uv).rgb;
#endif
#if COLOURED
    // Samples beyond an edge may extrapolate
    albedo *= clamp(colour_of_vertex, 0.0, 1.0);
#endif
    vec3 radiance = albedo / LIGHT_PI * light_at(point, n) + emissive;
    colour = vec4(min(radiance, vec3(65504.0)), 1.0);
}
