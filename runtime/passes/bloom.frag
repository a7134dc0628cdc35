// A level doubled, blended with the one below: that gives away what it takes of this one.
#include "bloom.glsl"

uniform sampler2D coarse;
uniform sampler2D before;  // the picture, where only light over a threshold is given away
uniform float threshold;
uniform float strength;    // share of the light

layout(location = 0) out vec4 colour;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(coarse, 0) - 1;
    // Of texels i - 1, i, i + 1 [3 4 1] / 8, mirrored on odd pixels
    vec2 side = 0.25 * vec2(pixel & 1) - 0.125;
    vec3 sum = vec3(0.0);
    for (int y = -1; y <= 1; ++y) {
        vec3 row = vec3(0.0);
        for (int x = -1; x <= 1; ++x) {
            ivec2 texel = clamp(pixel / 2 + ivec2(x, y), ivec2(0), last);
            row += (0.5 - 0.25 * float(x * x) + float(x) * side.x) * texelFetch(coarse, texel, 0).rgb;
        }
        sum += (0.5 - 0.25 * float(y * y) + float(y) * side.y) * row;
    }
    float given = strength;
    if (threshold > 0.0) given *= bright_share(texelFetch(before, pixel, 0).rgb, threshold);
    colour = vec4(strength * sum, given);
}
