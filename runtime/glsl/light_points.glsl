// Points on lights for shadow rays, from turns u in [0, 1).
// Pharr, Jakob, Humphreys 2023, Physically Based Rendering, 4th ed., 6.2.4 and A.5.

// Towards a point: unit direction, distance (1e30 for a sun), radiance over density per steradian
struct LightPoint {
    vec3 d;
    float reach;
    vec3 light;
};

const float LIGHT_TURN = 6.28318530717959;

// A direction in a cone about a unit axis; tall: 1 - cos of its half angle
vec3 in_cone(vec3 axis, float tall, vec2 u) {
    float low = tall * u.x;
    float ring = sqrt(max(low * (2.0 - low), 0.0));
    float side = axis.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (side + axis.z);
    float b = axis.x * axis.y * a;
    vec3 x = vec3(1.0 + side * axis.x * axis.x * a, side * b, -side * axis.x);
    vec3 y = vec3(b, side + axis.y * axis.y * a, -axis.y);
    float turn = LIGHT_TURN * u.y;
    return normalize(ring * cos(turn) * x + ring * sin(turn) * y + (1.0 - low) * axis);
}

// A sun: direction towards it and angular radius, perpendicular irradiance
LightPoint sun_point(vec4 place, vec3 irradiance, vec2 u) {
    float half_sine = sin(0.5 * place.w);
    float tall = 2.0 * half_sine * half_sine;
    // A mean radiance of E / (pi sin^2) over the cone's solid angle
    return LightPoint(in_cone(place.xyz, tall, u), 1e30, irradiance / (1.0 - 0.5 * tall));
}

// A ball: middle and radius; from inside, light from all around
LightPoint sphere_point(vec3 from, vec4 place, vec3 radiance, vec2 u) {
    vec3 offset = place.xyz - from;
    float squared = dot(offset, offset);
    float sine2 = place.w * place.w / max(squared, 1e-20);
    bool inside = sine2 >= 1.0;
    float tall = inside ? 2.0 : sine2 / (1.0 + sqrt(max(1.0 - sine2, 0.0)));
    vec3 d = in_cone(squared > 0.0 ? offset * inversesqrt(squared) : vec3(0.0, 1.0, 0.0), tall, u);
    float along = dot(d, offset);
    vec3 beside = offset - along * d;
    float entry = along - sqrt(max(place.w * place.w - dot(beside, beside), 0.0));
    return LightPoint(d, inside ? 0.0 : max(entry, 0.0), LIGHT_TURN * tall * radiance);
}

// A point of a flat light, by its area; both_sides: its back glows too
LightPoint flat_point(vec3 from, vec3 at, vec3 front, float area, vec3 radiance, bool both_sides) {
    vec3 offset = at - from;
    float squared = max(dot(offset, offset), 1e-12);
    vec3 d = offset * inversesqrt(squared);
    float fall = -dot(d, front);
    fall = both_sides ? abs(fall) : max(fall, 0.0);
    return LightPoint(d, sqrt(squared), radiance * area * fall / squared);
}

LightPoint disc_point(vec3 from, vec4 place, vec3 axis, vec3 radiance, bool both_sides, vec2 u) {
    vec3 x = normalize(abs(axis.y) < 0.9 ? cross(axis, vec3(0, 1, 0)) : cross(axis, vec3(1, 0, 0)));
    vec3 y = cross(axis, x);
    float turn = LIGHT_TURN * u.y;
    vec3 at = place.xyz + place.w * sqrt(u.x) * (cos(turn) * x + sin(turn) * y);
    float area = 0.5 * LIGHT_TURN * place.w * place.w;
    return flat_point(from, at, axis, area, radiance, both_sides);
}
