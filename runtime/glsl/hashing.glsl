// Counter-based random numbers: twins of maths/hashing.py, exact in every bit.
// Jarzynski, Olano 2020, Hash Functions for GPU Rendering, JCGT 9(3).
// Needs highp int (the header says so). Several keys nest: pcg(a, b) = pcg(b + pcg(a)).

uint pcg(uint key) {
    uint state = key * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

uint pcg(uint a, uint b) {
    return pcg(b + pcg(a));
}

uint pcg(uint a, uint b, uint c) {
    return pcg(c + pcg(a, b));
}

uint pcg(uint a, uint b, uint c, uint d) {
    return pcg(d + pcg(a, b, c));
}

// Uniform in [0, 1), a multiple of 2^-24
float uniform01(uint key) {
    return float(pcg(key) >> 8u) * (1.0 / 16777216.0);
}

float uniform01(uint a, uint b) {
    return float(pcg(a, b) >> 8u) * (1.0 / 16777216.0);
}

float uniform01(uint a, uint b, uint c) {
    return float(pcg(a, b, c) >> 8u) * (1.0 / 16777216.0);
}

float uniform01(uint a, uint b, uint c, uint d) {
    return float(pcg(a, b, c, d) >> 8u) * (1.0 / 16777216.0);
}
