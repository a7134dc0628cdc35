// Homogeneous or layered fog: density extinction * exp(-falloff * (y - base)), 1/m.

// Optical depth from one point to another (closed form of the integral along the segment).
float fog_depth(vec3 from, vec3 to, float extinction, float falloff, float base) {
    float steep = falloff * (to.y - from.y);
    float mean = abs(steep) < 1e-3 ? 1.0 - 0.5 * steep : (1.0 - exp(-steep)) / steep;
    return extinction * distance(from, to) * exp(-falloff * (from.y - base)) * mean;
}

// Fraction of light that passes.
float fog_transmittance(vec3 from, vec3 to, float extinction, float falloff, float base) {
    return exp(-min(fog_depth(from, to, extinction, falloff, base), 80.0));
}

// Fraction of the sky's own radiance that passes, by design only the horizon drowns: an endless
// uniform fog would hide the whole sky, so it counts as a layer seen over `rise` (sine of the
// elevation at which 1 - 1/e passes); a layered fog has its own finite depth.
float fog_sky(vec3 from, float sine, float extinction, float falloff, float base, float rise) {
    float up = max(sine, 1e-4);
    if (falloff <= 0.0) return extinction > 0.0 ? 1.0 - exp(-up / rise) : 1.0;
    float layer = extinction * exp(-falloff * (from.y - base)) / (falloff * up);
    return exp(-min(layer, 80.0));
}
