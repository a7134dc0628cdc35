// Value noise and its octaves: twins of maths/noise.py. Include hashing.glsl first.
// Perlin 2002, Improving Noise (quintic blend).

float value_noise(vec2 p, uint seed) {
    vec2 cell = floor(p);
    vec2 f = p - cell;
    vec2 blend = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    uint x = uint(int(cell.x));
    uint y = uint(int(cell.y));
    float c00 = uniform01(seed, x, y);
    float c10 = uniform01(seed, x + 1u, y);
    float c01 = uniform01(seed, x, y + 1u);
    float c11 = uniform01(seed, x + 1u, y + 1u);
    // Blend along x, then y
    float low = c00 + (c10 - c00) * blend.x;
    float high = c01 + (c11 - c01) * blend.x;
    return low + (high - low) * blend.y;
}

float value_noise(vec3 p, uint seed) {
    vec3 cell = floor(p);
    vec3 f = p - cell;
    vec3 blend = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    uint x = uint(int(cell.x));
    uint y = uint(int(cell.y));
    uint z = uint(int(cell.z));
    float c000 = uniform01(seed, x, y, z);
    float c100 = uniform01(seed, x + 1u, y, z);
    float c010 = uniform01(seed, x, y + 1u, z);
    float c110 = uniform01(seed, x + 1u, y + 1u, z);
    float c001 = uniform01(seed, x, y, z + 1u);
    float c101 = uniform01(seed, x + 1u, y, z + 1u);
    float c011 = uniform01(seed, x, y + 1u, z + 1u);
    float c111 = uniform01(seed, x + 1u, y + 1u, z + 1u);
    // Blend along x, then y, then z
    float c00 = c000 + (c100 - c000) * blend.x;
    float c10 = c010 + (c110 - c010) * blend.x;
    float c01 = c001 + (c101 - c001) * blend.x;
    float c11 = c011 + (c111 - c011) * blend.x;
    float low = c00 + (c10 - c00) * blend.y;
    float high = c01 + (c11 - c01) * blend.y;
    return low + (high - low) * blend.z;
}

// Sum of octaves in [0, 1): each turned by a 3-4-5 triangle, twice as fine, half as strong
float fbm(vec2 p, int octaves, uint seed) {
    float total = 0.0;
    float amplitude = 1.0;
    for (int i = 0; i < octaves; ++i) {
        amplitude *= 0.5;
        total += amplitude * value_noise(p, seed + uint(i));
        p = 2.0 * vec2(0.8 * p.x - 0.6 * p.y, 0.6 * p.x + 0.8 * p.y);
    }
    return total / (1.0 - amplitude);
}

float fbm(vec3 p, int octaves, uint seed) {
    float total = 0.0;
    float amplitude = 1.0;
    for (int i = 0; i < octaves; ++i) {
        amplitude *= 0.5;
        total += amplitude * value_noise(p, seed + uint(i));
        p = 2.0 * vec3(
            0.8 * p.x - 0.6 * p.y,
            0.48 * p.x + 0.64 * p.y - 0.6 * p.z,
            0.36 * p.x + 0.48 * p.y + 0.8 * p.z
        );
    }
    return total / (1.0 - amplitude);
}
