// A clear sky in two colours, with the glow and the disc of one sun.

// Gradient from horizon to zenith by the sine of the elevation.
vec3 sky_gradient(float sine, vec3 zenith, vec3 horizon) {
    return mix(zenith, horizon, exp(-5.5 * max(sine, 0.0)));
}

// Two lobes round the sun, the wide one flattened along the horizon; unit radiance at the sun.
float sky_glow(vec3 direction, vec3 to_sun) {
    float near = 1.0 - dot(direction, to_sun);
    float rise = direction.y - to_sun.y;
    return 0.45 * exp(-near / 0.006) + 0.55 * exp(-near / 0.16 - 40.0 * rise * rise);
}

// Coverage of the sun's disc, its limb softened over a fifth of the radius (radians).
float sky_disc(vec3 direction, vec3 to_sun, float radius) {
    float angle = 2.0 * asin(clamp(0.5 * distance(direction, to_sun), 0.0, 1.0));
    return 1.0 - smoothstep(0.8 * radius, 1.2 * radius, angle);
}
