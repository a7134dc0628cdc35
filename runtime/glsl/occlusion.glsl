// Where a point looks its shadow up in a caster's volume; twins in maths/occlusion_shadow.py.

// Texture coordinate: the volume is p = -1..1; outside it the edge towards the middle.
vec3 occlusion_place(vec3 p) {
    vec3 a = abs(p);
    return 0.5 + 0.5 * p / max(1.0, max(a.x, max(a.y, a.z)));
}

// Texture coordinate in a volume that is 1 + k times as fine in the middle as an even one.
vec3 occlusion_warp(vec3 place, float k) {
    vec3 q = 2.0 * place - 1.0;
    return 0.5 + 0.5 * q * (1.0 + k) / (1.0 + k * abs(q));
}

// Solid angle over 2 pi of a disc seen along its axis, 1 - r / sqrt(r^2 + R^2).
float disc_share(float r, float R) {
    float far = sqrt(r * r + R * R);
    return R * R / (far * (far + r));
}

// Factor of what the volume's edge hides; extent is half of the volume, metres of the mesh.
float occlusion_falloff(vec3 p, vec3 extent) {
    vec3 a = abs(p);
    float outside = max(1.0, max(a.x, max(a.y, a.z)));
    float radius = 0.5 * length(extent);
    float r = length(p * extent);
    return disc_share(r, radius) / disc_share(r / outside, radius);
}

// Harmonics of bands 0 to 2 of a unit normal; of 0 only the first is left.
float[9] receiver_lobe(vec3 n) {
    const float ONE = 0.488602512, TWO = 1.092548431;
    vec3 across = TWO * n.xyz * n.yzx;
    float zonal = 0.315391565 * (2.0 * n.z * n.z - n.x * n.x - n.y * n.y);
    return float[9](0.282094792, ONE * n.y, ONE * n.z, ONE * n.x, across.x, across.y, zonal,
                    across.z, 0.5 * TWO * (n.x * n.x - n.y * n.y));
}

// Share of its light that a receiver keeps: all where it faces less than 1/32 of what there is.
vec3 receiver_share(vec3 hidden, vec3 facing) {
    vec3 lit = vec3(greaterThan(facing, vec3(0.03125)));
    return clamp(1.0 - lit * hidden / mix(vec3(1.0), facing, lit), 0.0, 1.0);
}
