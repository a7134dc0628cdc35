// Irradiance from lights of uniform radiance, in closed form, cut off by the receiver's horizon, in
// W/m^2. Twins of maths.area_lights; formulas and papers stand there. Normals and axes are unit.

#ifndef POLYGON_CORNERS
#define POLYGON_CORNERS 8
#endif
// R / D below which discs across the horizon are summed: the closed form loses 1e-7 (D / R)^2.
const float FAR_DISC = 0.1;
// size / D below which edges leave out what sums to 0: all their angles are below pi / 8 there.
const float FAR_POLYGON = 0.125;
const float LIGHT_TINY = 1e-30;
const float LIGHT_PI = 3.14159265358979;

// atan(t) / t - 1 by z = t^2, |t| <= tan(pi / 8), to 8e-8.
float arctangent_rest(float z) {
    return z * (-0.33333288 + z * (0.19991394 + z * (-0.1402655 + z * 0.08529791)));
}

// atan(y, x) to 3e-7: drivers may be off by 1e-5, and light across the horizon is a difference.
float arctangent(float y, float x) {
    float a = abs(y), b = abs(x);
    float low = min(a, b), high = max(a, b);
    if (high == 0.0) return 0.0;
    // tan(pi / 8): beyond it, pi / 4 less the angle is small
    bool wide = low > 0.414213562 * high;
    float t = wide ? (low - high) / (low + high) : low / high;
    float angle = t + t * arctangent_rest(t * t) + (wide ? 0.25 * LIGHT_PI : 0.0);
    if (a > b) angle = 0.5 * LIGHT_PI - angle;
    if (x < 0.0) angle = LIGHT_PI - angle;
    return y < 0.0 ? -angle : angle;
}

// Mean of the clamped cosine over a cap of half-angle (sine, rise = its cosine).
float cap_cosine(float cosine, float sine, float rise) {
    if (abs(cosine) >= sine) return max(cosine, 0.0);
    float k = cosine / sine;
    float q = sqrt((1.0 - k) * (1.0 + k));
    // atan(q sine / rise) - rise sine q over sine^2, of small caps without what cancels
    float up = q * sine, low = min(up, rise), high = max(up, rise);
    bool wide = low > 0.414213562 * high;
    float t = (wide ? low - high : low) / (wide ? low + high : high);
    float part = arctangent_rest(t * t);
    float angle = t + t * part + (wide ? 0.25 * LIGHT_PI : 0.0);
    if (up > rise) angle = 0.5 * LIGHT_PI - angle;
    float rest = (angle - rise * up) / (sine * sine);
    if (!wide && up < rise) rest = q / rise * (sine + part / sine);
    return clamp((cosine * arctangent(q, -rise * k) + rest) / LIGHT_PI, 0.0, 1.0);
}

// A distant light: perpendicular irradiance, angular radius in radians.
vec3 sun_irradiance(vec3 normal, vec3 to_light, vec3 irradiance, float angular_radius) {
    return irradiance * cap_cosine(dot(normal, to_light), sin(angular_radius), cos(angular_radius));
}

// A ball; inside it light is all around.
vec3 sphere_irradiance(vec3 point, vec3 normal, vec3 centre, float radius, vec3 radiance) {
    vec3 offset = centre - point;
    float D = length(offset);
    if (radius <= 0.0 || radiance == vec3(0.0)) return vec3(0.0);
    if (D < radius) return LIGHT_PI * radiance;
    float sine = radius / D;
    float rise = sqrt((D - radius) * (D + radius)) / D;
    return LIGHT_PI * radiance * (sine * sine * cap_cosine(dot(normal, offset) / D, sine, rise));
}

// Area integral of a far disc's part above the horizon, chord by chord: `count` chords, 7 or none.
float disc_strips(vec2 p, float h, float R, float s, float k, float t1, int count) {
    float total = 0.0;
    for (int i = 0; i < count; i++) {
        // Gauss's seven points
        int from_middle = abs(i - 3);
        vec2 at = from_middle == 0 ? vec2(0.0, 0.417959184)
                : from_middle == 1 ? vec2(0.405845151, 0.381830051)
                : from_middle == 2 ? vec2(0.741531186, 0.279705391)
                : vec2(0.949107912, 0.129484966);
        float cosine = cos(0.5 * t1 * (1.0 + (i < 3 ? -at.x : at.x)));
        float square = max((1.0 - cosine) * (1.0 + cosine), 0.0);
        float x = p.x + R * cosine, y = 0.774596669 * R * sqrt(square);
        // Gauss's three points of a chord
        vec3 across = p.y + vec3(-y, 0.0, y), squared = x * x + h * h + across * across;
        float inner = dot(vec3(0.555555556, 0.888888889, 0.555555556), 1.0 / (squared * squared));
        total += at.y * square * (cosine - k) * inner;
    }
    return 0.5 * t1 * h * s * R * R * R * max(total, 0.0);
}

// Contour integral of a near disc's part above the horizon: an arc and a chord.
float disc_arc_and_chord(vec2 p, float h, float R, float m, float s, float k, float t1,
                         vec3 rim) {
    float a = max(length(p), 1e-15), near = rim.x, far = rim.y, gap = rim.z;
    float sine = sqrt((1.0 - k) * (1.0 + k)), S = max(near * far, LIGHT_TINY);
    float less = 4.0 * R * a / ((near + far) * far), ratio = near / far;
    // Sines and cosines of half the angles: of the chord's ends, and of the disc's nearest point
    vec2 middle = length(p) > 1e-15 ? p / a : vec2(1.0, 0.0);
    vec2 end = sqrt(0.5 * vec2(1.0 - k, 1.0 + k));
    float most = sqrt(0.5 * (1.0 + abs(middle.x))), least = 0.5 * abs(middle.y) / most;
    vec2 turned = middle.x > 0.0 ? vec2(least, most) : vec2(most, least);
    if (middle.y < 0.0) turned.x = -turned.x;
    vec2 b = vec2(end.x, -end.x) * turned.y - end.y * turned.x;
    vec2 c = end.y * turned.y + vec2(end.x, -end.x) * turned.x;
    vec2 up = less * b * c, right = c * c + ratio * b * b;
    float turn = arctangent(up.x, right.x) - arctangent(up.y, right.y);
    float z = clamp(2.0 * R * p.y * sine / (1.0 + 2.0 * R * p.x * k), -0.9999999, 0.9999999);
    float z2 = z * z;
    float inverse = z2 < 0.04 ? z * (1.0 + z2 * (1.0 / 3.0 + z2 * (0.2 + z2 * (1.0 / 7.0 + z2 / 9.0))))
                              : 0.5 * log((1.0 + z) / (1.0 - z));
    float even = turn / (R * a * S) - 4.0 * t1 * R * a / (S * (S + 1.0));
    float integral = middle.x * even + middle.y * inverse / (R * a);
    float g = h / s, f = R * sine;
    float chord = arctangent(2.0 * f * g, g * g + p.y * p.y - f * f);
    return 0.5 * (m * (t1 * gap + (1.0 - gap) * turn) - R * s * h * integral + chord);
}

// A disc that shines along axis, or both ways.
vec3 disc_irradiance(vec3 point, vec3 normal, vec3 centre, vec3 axis, float radius, vec3 radiance,
                     bool two_sided) {
    vec3 c = centre - point;
    float height = -dot(c, axis);
    if (radius <= 0.0 || radiance == vec3(0.0)) return vec3(0.0);
    if (height == 0.0 || (height < 0.0 && !two_sided)) return vec3(0.0);
    float unit = sqrt(dot(c, c) + radius * radius);
    vec3 w = height > 0.0 ? -axis : axis;
    c /= unit;
    float R = radius / unit, h = abs(height) / unit;
    float m = dot(normal, w), rise = dot(normal, c);
    vec3 along = normal - m * w, beside = c - h * w;
    float s = length(along), a = length(beside);
    if (rise <= -R * s || (s < 1e-6 && rise <= 0.0)) return vec3(0.0);
    float near = sqrt((a - R) * (a - R) + h * h), far = sqrt((a + R) * (a + R) + h * h);
    float S = max(near * far, LIGHT_TINY), X = (a - R) * (a + R) + h * h;
    // 1 - X / S, by its conjugate where it cancels
    float gap = X > 0.0 ? 4.0 * R * R * h / (S * max(S + X, LIGHT_TINY)) * h : 1.0 - X / S;
    if (rise >= R * s || s < 1e-6) {
        float radial = 2.0 * LIGHT_PI * h * R * R / (S * (S + 1.0));
        return radiance * clamp(0.5 * LIGHT_PI * m * gap + radial * dot(normal, beside), 0.0, LIGHT_PI);
    }
    vec3 u = along / s;
    vec2 p = vec2(dot(beside, u), dot(beside, cross(w, u)));
    float k = -rise / (R * s);
    float t1 = arctangent(sqrt((1.0 - k) * (1.0 + k)), k);
    // Neither is cheap where pixels run side by side: of chords there are none where none are asked for
    float strips = disc_strips(p, h, R, s, k, t1, R < FAR_DISC ? 7 : 0);
    float part = R < FAR_DISC ? strips
                              : disc_arc_and_chord(p, h, R, m, s, k, t1, vec3(near, far, gap));
    return radiance * clamp(part, 0.0, LIGHT_PI);
}

// -2 times the part of the edge from q to q + e in what a polygon gives, q seen from its first
// corner r0; turn = n x r0. Edges of a closed loop may leave out n . (r0 x e) / level, which they sum
// to 0: with level = r0 . r0 a far polygon's do not cancel. level = 0 leaves out nothing.
// chord : the edge lies in the plane of the horizon.
float polygon_edge(vec3 r0, vec3 q, vec3 e, vec3 n, vec3 turn, float level, bool chord) {
    vec3 r = r0 + q, across = cross(r, e);
    float sine = length(across), cosine = dot(r, r + e);
    float low = min(sine, abs(cosine)), high = max(sine, abs(cosine));
    bool wide = low > 0.414213562 * high;
    float t = (wide ? low - high : low) / max(wide ? low + high : high, LIGHT_TINY);
    float rest = arctangent_rest(t * t);
    float angle = t + t * rest + (wide ? 0.25 * LIGHT_PI : 0.0);
    if (sine > abs(cosine)) angle = 0.5 * LIGHT_PI - angle;
    if (cosine < 0.0) angle = LIGHT_PI - angle;
    // Angle over sine, of small angles without a sine below
    bool narrow = !wide && sine < cosine;
    float below = 1.0 / max(narrow ? cosine : sine, LIGHT_TINY);
    float share = (narrow ? 1.0 + rest : angle) * below;
    float facing = dot(across, n);
    if (level == 0.0) return chord ? (facing < 0.0 ? -angle : angle) : share * facing;
    float more = (rest - (dot(r0, 2.0 * q + e) + dot(q, q + e)) / level) * below;
    return more * dot(e, turn) + share * dot(cross(q, e), n);
}

// A flat, convex polygon, counter-clockwise as seen from its front, which shines. Corners beyond its
// own repeat the first. front : unit.  size : largest distance of a corner from the first.
vec3 polygon_irradiance(vec3 point, vec3 normal, vec3 corners[POLYGON_CORNERS], vec3 front,
                        float size, vec3 radiance, bool two_sided) {
    vec3 r0 = corners[0] - point;
    float height = -dot(r0, front);
    if (size <= 0.0 || radiance == vec3(0.0)) return vec3(0.0);
    if (height == 0.0 || (height < 0.0 && !two_sided)) return vec3(0.0);
    float scale = 1.0 / (length(r0) + size);
    r0 *= scale;
    float rise = dot(r0, normal), level = size * scale < FAR_POLYGON ? dot(r0, r0) : 0.0;
    vec3 turn = cross(normal, r0), a = vec3(0.0), leaving = vec3(0.0), entering = vec3(0.0);
    float za = rise, total = 0.0;
    for (int i = 1; i <= POLYGON_CORNERS; i++) {
        vec3 b = i < POLYGON_CORNERS ? (corners[i] - corners[0]) * scale : vec3(0.0);
        float zb = rise + dot(b, normal);
        // Cut at the horizon
        vec3 cut = a + za / (za - zb) * (b - a), start = za > 0.0 ? a : cut;
        if (za > 0.0 || zb > 0.0) {
            vec3 end = zb > 0.0 ? b : cut;
            total += polygon_edge(r0, start, end - start, normal, turn, level, false);
        }
        if (za > 0.0 && zb <= 0.0) leaving = cut;
        if (zb > 0.0 && za <= 0.0) entering = cut;
        a = b;
        za = zb;
    }
    total += polygon_edge(r0, leaving, entering - leaving, normal, turn, level, true);
    return radiance * clamp(0.5 * (height < 0.0 ? total : -total), 0.0, LIGHT_PI);
}

// The parallelogram centre +- half_u +- half_v, which shines along half_u x half_v.
vec3 rectangle_irradiance(vec3 point, vec3 normal, vec3 centre, vec3 half_u, vec3 half_v,
                          vec3 radiance, bool two_sided) {
    vec3 corners[POLYGON_CORNERS];
    for (int i = 0; i < POLYGON_CORNERS; i++) corners[i] = centre - half_u - half_v;
    corners[1] = centre + half_u - half_v;
    corners[2] = centre + half_u + half_v;
    corners[3] = centre - half_u + half_v;
    float size = 2.0 * max(length(half_u + half_v), max(length(half_u), length(half_v)));
    vec3 area = cross(half_u / max(size, LIGHT_TINY), half_v / max(size, LIGHT_TINY));
    if (dot(area, area) == 0.0) return vec3(0.0);
    return polygon_irradiance(point, normal, corners, normalize(area), size, radiance, two_sided);
}

// An environment from the nine harmonics of its irradiance, l <= 2, index l (l + 1) + m.
vec3 harmonic_irradiance(vec3 n, vec3 E[9]) {
    vec3 linear = 0.488602512 * (n.y * E[1] + n.z * E[2] + n.x * E[3]);
    vec3 square = 1.092548431 * (n.x * n.y * E[4] + n.y * n.z * E[5] + n.x * n.z * E[7])
                + 0.315391565 * (3.0 * n.z * n.z - 1.0) * E[6]
                + 0.546274215 * (n.x * n.x - n.y * n.y) * E[8];
    return max(0.282094792 * E[0] + linear + square, vec3(0.0));
}
