// An endless level plane: Lambert under suns, balls and sky, mottled by band-limited noise.
#include "irradiance.glsl"
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
uniform vec3 sun_direction[SUNS];
uniform vec3 sun_light[SUNS];
#endif
#if SPHERES > 0
uniform vec4 sphere_place[SPHERES];  // centre, radius
uniform vec3 sphere_light[SPHERES];
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
        light += sun_irradiance(sun_direction[i], sun_light[i]) * (i < 3 ? reaches[i] : 1.0);
    }
#endif
#if SPHERES > 0
    for (int i = 0; i < SPHERES; ++i) {
        vec3 offset = sphere_place[i].xyz - point;
        light += sphere_irradiance(offset, sphere_place[i].w, sphere_light[i]) * reaches.a;
    }
#endif
    colour = vec4(reflectance * light / 3.14159265358979, 1.0);
    gl_FragDepth = 1.0 - near / depth;
}
