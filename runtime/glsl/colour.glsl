// Radiance to picture: twins of maths/colour.py. Scene-linear Rec. 709.
// sRGB: IEC 61966-2-1:1999. Curve: Naka, Rushton 1966; Reinhard, Devlin 2005. Dither: R2, Roberts 2018.

float luminance(vec3 rgb) {
    return dot(rgb, vec3(0.2126, 0.7152, 0.0722));
}

vec3 srgb_encode(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    vec3 curve = 1.055 * pow(max(c, vec3(0.0031308)), vec3(1.0 / 2.4)) - 0.055;
    return mix(curve, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

vec3 srgb_decode(vec3 encoded) {
    vec3 c = clamp(encoded, 0.0, 1.0);
    vec3 curve = pow((max(c, vec3(0.04045)) + 0.055) / 1.055, vec3(2.4));
    return mix(curve, c / 12.92, lessThanEqual(c, vec3(0.04045)));
}

vec3 tonemap_linear(vec3 rgb) {
    return clamp(rgb, 0.0, 1.0);
}

// Share of luminance mixed into each channel, p / (p + half) with p = c^1.3, and the share given back
vec3 tonemap_filmic(vec3 rgb) {
    vec3 c = clamp(rgb, 0.0, 65504.0);
    vec3 mixed = c + (luminance(c) - c) * 0.15;
    vec3 power = pow(mixed, vec3(1.3));
    // 0.18^1.3 * 0.82 / 0.18: 18 % grey maps to itself
    vec3 curve = power / (power + 0.49022517);
    return clamp((curve - 0.15 * luminance(curve)) / 0.85, 0.0, 1.0);
}

// Offset in (-0.5, 0.5) codes of the last step, one a channel: add dither / 255 after srgb_encode
vec3 dither(uint x, uint y, uint frame) {
    uint phase = x * 3242174889u + y * 2447445413u + frame * 2654435769u;
    uvec3 channels = uvec3(phase, phase + 1431655765u, phase + 2863311530u);
    return vec3(channels >> 9u) * (1.0 / 8388608.0) - (0.5 - 1.0 / 16777216.0);
}
