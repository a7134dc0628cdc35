// From radiance to the picture: exposure, vignette, tone curve, sRGB, dither of the last step.
#include "colour.glsl"

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
    vec3 code = srgb_encode(shown) * 255.0 + dither(cell.x, cell.y, uint(frame_number));
    picture = vec4(floor(clamp(code, 0.0, 255.0) + 0.5) / 255.0, 1.0);
}
