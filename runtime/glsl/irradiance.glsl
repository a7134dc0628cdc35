// Irradiance on an upward-facing plane, W/m^2 in scene units.

// A distant light of perpendicular irradiance from a unit direction.
vec3 sun_irradiance(vec3 to_light, vec3 irradiance) {
    return irradiance * max(to_light.y, 0.0);
}

// A sphere of uniform radiance; exact while it stands wholly above the plane:
// pi radiance (radius / distance)^2 cos.
vec3 sphere_irradiance(vec3 offset, float radius, vec3 radiance) {
    float squared = max(dot(offset, offset), radius * radius);
    float cosine = max(offset.y, 0.0) * inversesqrt(squared);
    return 3.14159265358979 * radiance * (radius * radius / squared) * cosine;
}
