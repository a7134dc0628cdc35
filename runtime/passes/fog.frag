// Fog between the camera and what is opaque, laid over it with premultiplied alpha.
#include "fog.glsl"

uniform sampler2D opaque_depth;
uniform vec3 camera_position;
uniform float near;
uniform vec3 fog_radiance;
uniform float extinction;
uniform float falloff;
uniform float fog_base;
uniform float rise;

in vec3 ray;
in vec2 screen;

layout(location = 0) out vec4 colour;

void main() {
    float z = texelFetch(opaque_depth, ivec2(gl_FragCoord.xy), 0).r;
    float pass;
    if (z >= 1.0) {
        pass = fog_sky(camera_position, normalize(ray).y, extinction, falloff, fog_base, rise);
    } else {
        vec3 point = camera_position + ray * (near / (1.0 - z));
        pass = fog_transmittance(camera_position, point, extinction, falloff, fog_base);
    }
    colour = vec4(fog_radiance * (1.0 - pass), 1.0 - pass);
}
