// Patches of two colours on the ground, without tiling and without more detail than a pixel holds.
#include "hashing.glsl"
#include "noise.glsl"

// Share of an octave that is left when averaged over `width` (in the octave's own units).
float octave_share(float width) {
    return 1.0 - smoothstep(0.35, 1.0, width);
}

// Mix 0..1 at a place, averaged over a footprint; place and width in units of the mottling's size.
float mottle(vec2 place, float width) {
    float sum = 0.0;
    float total = 0.0;
    float amplitude = 1.0;
    float frequency = 0.31;
    for (int i = 0; i < 6; ++i) {
        // Octaves turn by the golden angle, so that their lattices never line up
        float angle = 2.39996323 * float(i);
        vec2 turned = mat2(cos(angle), sin(angle), -sin(angle), cos(angle)) * place * frequency;
        float share = octave_share(width * frequency);
        sum += amplitude * (share * value_noise(turned, uint(i)) + (1.0 - share) * 0.5);
        total += amplitude;
        amplitude *= 0.62;
        frequency *= 2.17;
    }
    return smoothstep(0.22, 0.78, sum / total);
}
