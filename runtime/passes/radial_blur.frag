// The mean of the picture from a pixel towards a point; streaks of half a pixel change nothing.
#include "colour.glsl"

uniform sampler2D before;
uniform vec2 centre;     // pixels, y up
uniform float strength;  // length of a streak over the way to the centre
uniform int samples;     // at most

layout(location = 0) out vec4 colour;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 streak = strength * (centre - gl_FragCoord.xy);
    float pixels = length(streak);
    if (pixels < 0.5) {
        colour = texelFetch(before, pixel, 0);
        return;
    }
    // Each pixel starts elsewhere in its first step: few samples make grain, not bands
    float start = 0.5 + dither(uint(pixel.x), uint(pixel.y), 0u).r;
    int count = clamp(int(ceil(pixels)), 1, samples);
    vec2 size = vec2(textureSize(before, 0));
    vec4 sum = vec4(0.0);
    for (int i = 0; i < count; ++i) {
        float along = (float(i) + start) / float(count);
        sum += textureLod(before, (gl_FragCoord.xy + along * streak) / size, 0.0);
    }
    colour = sum / float(count);
}
