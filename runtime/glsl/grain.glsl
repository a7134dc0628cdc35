// Noise of film, mean 0 and standard deviation 1: twin of maths/grain.py.
#include "hashing.glsl"

float grain(uint x, uint y, uint frame) {
    uint word = pcg(x, y, frame);
    uint total = (word & 255u) + ((word >> 8u) & 255u) + ((word >> 16u) & 255u) + (word >> 24u);
    // Less the middle, over sqrt(4 (256^2 - 1) / 12)
    return (float(total) - 510.0) * (1.0 / 147.80054127099802);
}
