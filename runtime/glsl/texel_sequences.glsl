// Numbers for rays of texels, in turns of 2^32: twins of maths/texel_sequences.py, exact in every bit.
// Roberts 2018, The Unreasonable Effectiveness of Quasirandom Sequences.

uvec4 texel_dither(uvec3 place) {
    return place.x * uvec4(2654435769u, 1779033704u, 3144134278u, 1013904243u)
        + place.y * uvec4(1779033704u, 1640531527u, 1013904243u, 1150833018u)
        + place.z * uvec4(3518319155u, 2882110345u, 2773480762u, 1359893120u);
}

uvec2 pair(uint index) {
    return index * uvec2(3242174889u, 2447445414u);
}

uvec4 quad(uint index) {
    return index * uvec4(3679390609u, 3152041523u, 2700274806u, 2313257605u);
}

// Uniform in [0, 1), a multiple of 2^-24
vec4 unit(uvec4 words) {
    return vec4(words >> 8u) * (1.0 / 16777216.0);
}
