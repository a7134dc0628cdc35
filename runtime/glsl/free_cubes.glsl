// Cubes that lie free among the cells, place (middle, half side): rays and points on what faces them.

// Length at which a ray enters a cube, in lengths of d, 0 from inside; below 0 where it does not. fall:
// cosine between the ray and the side that it meets.
float cube_entry(vec3 from, vec3 d, vec4 place, out float fall) {
    vec3 apart = place.xyz - from;
    bvec3 still = lessThan(abs(d), vec3(1e-30));
    vec3 inverse = mix(1.0 / mix(d, vec3(1.0), still), vec3(1e30), still);
    vec3 middle = apart * inverse;
    vec3 half_way = abs(place.w * inverse);
    vec3 enters = middle - half_way;
    vec3 leaves = middle + half_way;
    float first = max(enters.x, max(enters.y, enters.z));
    float last = min(leaves.x, min(leaves.y, leaves.z));
    float along = first == enters.x ? d.x : first == enters.y ? d.y : d.z;
    fall = abs(along) / length(d);
    return first <= last && last > 0.0 ? max(first, 0.0) : -1.0;
}

// Which sides of a cube a point sees: +1, -1 or 0 along each axis
vec3 cube_sides(vec3 from, vec4 place) {
    vec3 apart = from - place.xyz;
    return sign(apart) * step(vec3(place.w), abs(apart));
}

// Point on a cube's visible sides, each as likely as the others, from three turns
vec3 cube_point(vec3 sides, vec4 place, vec3 u) {
    vec3 visible = abs(sides);
    float chosen = u.x * (visible.x + visible.y + visible.z);
    bool x = chosen < visible.x;
    bool y = !x && chosen < visible.x + visible.y;
    vec2 across = 2.0 * u.yz - 1.0;
    vec3 at = x ? vec3(sides.x, across) : y ? vec3(across.y, sides.y, across.x) : vec3(across, sides.z);
    return place.xyz + place.w * at;
}
