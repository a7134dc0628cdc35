// What cells of a world of cubes hold: alpha 1 for solid, rgb emission over a scale.
// STORAGE 0: RGBA8 volume; 1: BC1 blocks as RG32UI volume, decoded here; 2: BC1 array of slices.
// A border of solid cells lies around the world, so that rays stop there: one texel, or one block.

#if STORAGE == 1
#define WORLD usampler3D
#elif STORAGE == 2
#define WORLD sampler2DArray
#else
#define WORLD sampler3D
#endif

// A colour of 5, 6 and 5 bits as codes of 8 bits, by repeating high bits
ivec3 expand565(uint word) {
    ivec3 bits = ivec3(int(word >> 11u), int((word >> 5u) & 63u), int(word & 31u));
    return ivec3(bits.x << 3 | bits.x >> 2, bits.y << 2 | bits.y >> 4, bits.z << 3 | bits.z >> 2);
}

// Index of a texel in a block: its two bits
uint bc1_index(uvec2 block, ivec2 place) {
    return (block.y >> uint(2 * (4 * (place.y & 3) + (place.x & 3)))) & 3u;
}

// Texel (x, y) of a block of two words; twin of maths.bc1.decode
vec4 bc1_texel(uvec2 block, ivec2 place) {
    uint low = block.x & 0xffffu;
    uint high = block.x >> 16u;
    uint index = bc1_index(block, place);
    ivec3 a = expand565(low);
    ivec3 b = expand565(high);
    // Levels in sixths; rounded to the nearest code, a half up
    ivec3 two = low > high ? (4 * a + 2 * b + 3) / 6 : (3 * a + 3 * b + 3) / 6;
    ivec3 three = (2 * a + 4 * b + 3) / 6;
    ivec3 code = index == 0u ? a : index == 1u ? b : index == 2u ? two : three;
    return index == 3u && low <= high ? vec4(0.0) : vec4(vec3(code) / 255.0, 1.0);
}

#if STORAGE == 1

bool solid_at(WORLD world, ivec3 cell) {
    uvec2 block = texelFetch(world, ivec3((cell.xy + 4) >> 2, cell.z + 1), 0).xy;
    return !(bc1_index(block, cell.xy) == 3u && (block.x & 0xffffu) <= block.x >> 16u);
}

vec4 light_at(WORLD world, ivec3 cell) {
    return bc1_texel(texelFetch(world, ivec3((cell.xy + 4) >> 2, cell.z + 1), 0).xy, cell.xy);
}

#elif STORAGE == 2

bool solid_at(WORLD world, ivec3 cell) {
    return texelFetch(world, cell + ivec3(4, 4, 1), 0).a > 0.5;
}

vec4 light_at(WORLD world, ivec3 cell) {
    return texelFetch(world, cell + ivec3(4, 4, 1), 0);
}

#else

bool solid_at(WORLD world, ivec3 cell) {
    return texelFetch(world, cell + 1, 0).a > 0.5;
}

vec4 light_at(WORLD world, ivec3 cell) {
    return texelFetch(world, cell + 1, 0);
}

#endif
