// Gradient sky behind everything, with the first sun's glow.
#include "sky.glsl"

uniform vec3 zenith;
uniform vec3 horizon;
#if GLOW
uniform vec3 glow;
uniform vec3 to_sun;
uniform float sun_radius;  // radians
uniform float disc;        // radiance of the disc in units of the glow's
#endif

in vec3 ray;

layout(location = 0) out vec4 colour;

void main() {
    vec3 direction = normalize(ray);
    vec3 radiance = sky_gradient(direction.y, zenith, horizon);
#if GLOW
    radiance += glow * (sky_glow(direction, to_sun) + disc * sky_disc(direction, to_sun, sun_radius));
#endif
    colour = vec4(radiance, 1.0);
}
