// Where a point looks its shadow up in a caster's volume; twins in maths/occlusion_shadow.py.

// Texture coordinate: the volume is p = -1..1; outside it the edge towards the middle.
vec3 occlusion_place(vec3 p) {
    vec3 a = abs(p);
    return 0.5 + 0.5 * p / max(1.0, max(a.x, max(a.y, a.z)));
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
