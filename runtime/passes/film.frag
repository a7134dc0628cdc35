// From radiance to the picture: exposure, vignette, tone curve, sRGB, grain, dither of the last step.
#include "colour.glsl"
#if GRAIN
#include "grain.glsl"
uniform float grain_codes;  // standard deviation on mid grey
#endif

uniform sampler2D colour_target;
uniform float exposure;  // factor
uniform float vignette;
uniform vec2 half_size;  // of the picture in units of its half diagonal
uniform int frame_number;

in vec2 screen;

layout(location = 0) out vec4 picture;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uvec2 cell = uvec2(pixel);
    vec3 radiance = texelFetch(colour_target, pixel, 0).rgb * exposure;
    vec2 off = (2.0 * screen - 1.0) * half_size;
    float cosine2 = 1.0 / (1.0 + dot(off, off));
    radiance *= mix(1.0, cosine2 * cosine2, vignette);
#if FILMIC
    vec3 shown = tonemap_filmic(radiance);
#else
    vec3 shown = tonemap_linear(radiance);
#endif
    vec3 encoded = srgb_encode(shown);
    vec3 code = encoded * 255.0 + dither(cell.x, cell.y, uint(frame_number));
#if GRAIN
    // Nothing on black and white, where noise would be clipped and brighten or darken
    float noise = grain_codes * grain(cell.x, cell.y, uint(frame_number));
    code += noise * 4.0 * encoded * (1.0 - encoded);
#endif
    picture = vec4(floor(clamp(code, 0.0, 255.0) + 0.5) / 255.0, 1.0);
}
