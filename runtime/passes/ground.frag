// An endless level plane: Lambert under every light, mottled by band-limited noise.
#include "lights.glsl"
#include "mottle.glsl"
#if LENS
#include "optics.glsl"
#endif

uniform vec3 camera_position;
uniform float near;
uniform float height;
uniform vec3 albedo;
uniform vec3 accent;
uniform float scale;  // metres of the mottling
uniform vec3 ambient;  // irradiance of the environments
uniform sampler2D shade;  // what reaches the ground: suns 0, 1, 2 and ambient
#if LENS
uniform float focal_length;
uniform float f_number;
uniform float focus_distance;
#endif
#if SUNS > 0
uniform vec3 sun_level[SUNS];  // irradiance on a level plane
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

in vec3 ray;

layout(location = 0) out vec4 colour;

void main() {
    float depth = (height - camera_position.y) / ray.y;
    vec3 point = camera_position + depth * ray;

    // Width of a pixel on the plane, and of the lens's blur if that is wider
    vec3 across = dFdx(ray);
    vec3 down = dFdy(ray);
    float width = depth * max(length(across.xz - ray.xz * across.y / ray.y),
                              length(down.xz - ray.xz * down.y / ray.y));
    if (!(depth > near)) discard;
#if LENS
    float coc = circle_of_confusion(depth, focal_length, f_number, focus_distance);
    width = max(width, coc * depth / focal_length);
#endif
    vec3 reflectance = mix(albedo, accent, mottle(point.xz / scale, width / scale));

    vec4 reaches = texelFetch(shade, ivec2(gl_FragCoord.xy), 0);
    vec3 light = ambient * reaches.a;
#if SUNS > 0
    for (int i = 0; i < SUNS; ++i) {
        light += sun_level[i] * (i < 3 ? reaches[i] : 1.0);
    }
#endif
    const vec3 up = vec3(0.0, 1.0, 0.0);
#if SPHERES > 0
    for (int i = 0; i < SPHERES; ++i) {
        light += reaches.a * sphere_irradiance(point, up, sphere_place[i].xyz, sphere_place[i].w,
                                               sphere_light[i]);
    }
#endif
#if DISCS > 0
    for (int i = 0; i < DISCS; ++i) {
        light += reaches.a * disc_irradiance(point, up, disc_place[i].xyz, disc_axis[i].xyz,
                                             disc_place[i].w, disc_light[i], disc_axis[i].w > 0.5);
    }
#endif
#if POLYGONS > 0
    for (int i = 0; i < POLYGONS; ++i) {
        vec3 corners[POLYGON_CORNERS];
        for (int k = 0; k < POLYGON_CORNERS; ++k) {
            corners[k] = polygon_corner[i * POLYGON_CORNERS + k];
        }
        light += reaches.a * polygon_irradiance(point, up, corners, polygon_front[i].xyz,
                                                polygon_front[i].w, polygon_light[i].rgb,
                                                polygon_light[i].a > 0.5);
    }
#endif
    colour = vec4(reflectance * light / 3.14159265358979, 1.0);
    gl_FragDepth = 1.0 - near / depth;
}
