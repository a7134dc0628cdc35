// A level of half the size: [1 5 10 10 5 1] / 32 along each axis counts every texel by a quarter.
#include "bloom.glsl"

uniform sampler2D fine;
uniform float threshold;  // radiance; 0 takes all light

layout(location = 0) out vec4 colour;

const float weight[3] = float[3](0.03125, 0.15625, 0.3125);

void main() {
    ivec2 first = 2 * ivec2(gl_FragCoord.xy) - 2;
    ivec2 last = textureSize(fine, 0) - 1;
    vec3 sum = vec3(0.0);
    for (int y = 0; y < 6; ++y) {
        vec3 row = vec3(0.0);
        for (int x = 0; x < 6; ++x) {
            ivec2 texel = clamp(first + ivec2(x, y), ivec2(0), last);
            vec3 rgb = min(texelFetch(fine, texel, 0).rgb, 65504.0);
            if (threshold > 0.0) rgb *= bright_share(rgb, threshold);
            row += weight[min(x, 5 - x)] * rgb;
        }
        sum += weight[min(y, 5 - y)] * row;
    }
    colour = vec4(sum, 1.0);
}
