// Where a body of revolution with a sprite's outline throws its shadow on level ground.

// Texel offset from the pivot (right, up) that a ground point asks, for the slice `across` of the body:
// along : metres from the foot away from the sun. beside : metres across. tangent : of the sun's elevation.
vec2 shadow_lookup(float along, float beside, float across, float tangent) {
    float radius = length(vec2(beside, across));
    return vec2(beside < 0.0 ? -radius : radius, (along - across) * tangent);
}

// Weight, 1/2 to 1, of the side of the outline that shadow_lookup names; the other side has the rest.
float shadow_side(float beside, float across) {
    float radius = length(vec2(beside, across));
    return radius > 0.0 ? 0.5 + 0.5 * abs(beside) / radius : 1.0;
}

// Width of the penumbra, metres, thrown from `height` by a sun of angular radius `radius`.
float penumbra(float height, float tangent, float radius) {
    float sine = tangent * inversesqrt(1.0 + tangent * tangent);
    return 2.0 * radius * max(height, 0.0) / sine;
}

// Share of the sky that things near a foot hide: a tight part by the stem, a wide one by the crown.
float contact(float distance, float foot, float crown, float cover) {
    float stem = foot > 0.0 ? 0.6 * exp(-distance * distance / (2.6 * foot * foot)) : 0.0;
    float wide = crown > 0.0 ? 0.45 * cover * exp(-distance * distance / (0.5 * crown * crown)) : 0.0;
    return 1.0 - (1.0 - stem) * (1.0 - wide);
}
