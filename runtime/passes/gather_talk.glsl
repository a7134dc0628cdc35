// The talk's way of a gather: 16 points on the way to a cell that is chosen by its light, and what
// the nearest solid one glows, at the distance and chance of that cell. Part of gather.frag.

uniform sampler2D destinations;
uniform vec2 falloff;       // A and B of A / r^2 + B

// From the far end on, so that the nearest solid point stays
Found look(ivec3 cell, ivec3 front, int face, vec3 start, uvec3 place) {
    uvec4 turns = shift_of(place) + STEPS(quad(pass_index)) + offset;
    ivec2 page = ivec2(unit(turns).xy * vec2(textureSize(destinations, 0)));
    vec4 destination = texelFetch(destinations, page, 0);
    if (destination.w <= 0.0) {
        return Found(vec3(0.0), vec3(0.0));
    }
    vec3 normal = vec3(normal_of(face));
    vec3 origin = start + 0.25 * normal;
    vec3 d = destination.xyz - origin;
    vec4 pattern = 1.0 - (vec4(0.0, 1.0, 2.0, 3.0) + unit(turns).z) / 16.0;
    float reached = 1.0;
    for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < 4; ++j) {
            ivec3 at = clamp(ivec3(floor(origin + d * pattern[j])), ivec3(-1), size);
            reached = is_inside(at, size) && solid_at(world, at) ? pattern[j] : reached;
        }
        pattern -= 0.25;
    }
    ivec3 at = clamp(ivec3(floor(origin + d * reached)), ivec3(0), size - 1);
    float inverse = inversesqrt(dot(d, d));
    float share = max(dot(normal, d) * inverse + 0.1, 0.0);
    share *= falloff.x * inverse * inverse + falloff.y;
    return Found(light_at(world, at).rgb * scale * share / destination.w, vec3(0.0));
}
