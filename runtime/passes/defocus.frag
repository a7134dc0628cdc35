// The picture through the lens: small circles pixel by pixel, wide ones from the half-size layers;
// a front layer over a base that is filled in behind it. Counts of loops, not branches, say what a
// pixel does without: where pixels run side by side, a branch that any takes costs all of them.
#include "defocus.glsl"

uniform sampler2D opaque_colour;
uniform sampler2D opaque_depth;
uniform sampler2D base;
uniform sampler2D radii;
uniform sampler2D tiles;
uniform sampler2D front_sum;
uniform sampler2D blurred_sum;
uniform sampler2D radius_sum;
uniform sampler2D before_sum;
uniform ivec2 full_size;
uniform int side;
uniform float farthest;
uniform float widest;
uniform float focus_over_near;
uniform vec3 ground_plane;

layout(location = 0) out vec4 colour;
layout(location = 1) out vec4 front;        // premultiplied
layout(location = 2) out float front_depth;  // of the window, 1 where there is none

bool is_nearer(float radius, float depth, vec2 at) {
    float level = dot(ground_plane, vec3(at, 1.0));
    return radius < -SHARP && abs(1.0 - depth - level) >= 1e-3 * level + 2e-7;
}

// What lies behind, from the nearest pixels where it is seen: pull-push over so many levels
vec4 filled(vec2 where, int levels) {
    vec4 found = vec4(0.0);
    float radius = 0.0;
    for (int level = 0; level < levels; ++level) {
        vec4 there = textureLod(base, where, float(level));
        float left = 1.0 - found.a;
        found += left * there;
        radius += left * textureLod(radii, where, float(level)).b;
    }
    return vec4(found.rgb, radius) / max(found.a, 1e-6);
}

// The base beside a blurred front: pixels along the front's edge are mixtures, up to two of them;
// so many places beside it are looked at, 12 or none
vec4 unmixed(ivec2 here, int count) {
    ivec2 last = full_size - 1;
    for (int i = 0; i < count; ++i) {
        // Right, up, left, down; the diagonals; the first four two pixels off
        ivec2 turn = ivec2((i & 1) * (2 - (i & 3)), (1 - (i & 1)) * (1 - (i & 3)));
        ivec2 step = i >= 4 && i < 8 ? ivec2(2 * (i & 1) - 1, (i & 2) - 1) : turn;
        ivec2 at = clamp(here + (i < 8 ? step : 2 * step), ivec2(0), last);
        float z = texelFetch(opaque_depth, at, 0).r;
        float r = signed_radius(z, farthest, focus_over_near);
        if (r > -1.0 || !is_nearer(r, z, vec2(at) + 0.5)) continue;
        at = clamp(here - (i < 8 ? 2 * step : step), ivec2(0), last);
        return vec4(texelFetch(opaque_colour, at, 0).rgb, 1.0);
    }
    return vec4(0.0);
}

// Whether circles so small that only single pixels show them are as near as they reach
bool small_beside(ivec2 here) {
    // The flag's mean over eight by eight pixels
    ivec2 last = textureSize(radii, 2) - 1;
    ivec2 low = max(here - 3, ivec2(0)) >> 3;
    ivec2 high = min((here + 3) >> 3, last);
    float found = texelFetch(radii, low, 2).a + texelFetch(radii, high, 2).a;
    found += texelFetch(radii, ivec2(low.x, high.y), 2).a;
    return found + texelFetch(radii, ivec2(high.x, low.y), 2).a > 0.0;
}

// Smooth the edge of something sharp anew: a pixel there is a mixture with what is sharp behind;
// so many sides are looked at, 4 or none
vec3 mended(ivec2 here, float radius, vec3 wide_mean, vec3 blurred, int count) {
    vec3 mixed = texelFetch(opaque_colour, here, 0).rgb;
    for (int i = 0; i < count; ++i) {
        ivec2 step = i < 2 ? ivec2(2 * i - 1, 0) : ivec2(0, 2 * i - 5);
        ivec2 at = here + step;
        if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, full_size))) continue;
        float z = texelFetch(opaque_depth, at, 0).r;
        float r = clamp(signed_radius(z, farthest, focus_over_near), -widest, widest);
        float front = min(radius, r);
        float back = max(radius, r);
        if (abs(front) > 1.0 || back - front < 1.0) continue;
        // Clean colours one pixel to each side
        bool inside = radius < r;
        ivec2 last = full_size - 1;
        vec3 sharp = texelFetch(opaque_colour, clamp(here + step * (inside ? -1 : 2), ivec2(0), last), 0).rgb;
        vec3 seen = texelFetch(opaque_colour, clamp(here + step * (inside ? 2 : -1), ivec2(0), last), 0).rgb;
        vec3 apart = sharp - seen;
        float cover = dot(mixed - seen, apart) / max(dot(apart, apart), 1e-8);
        cover = clamp(cover, inside ? 0.5 : 0.0, inside ? 1.0 : 0.75);
        if (inside) return mixed + (1.0 - cover) * layered(r) * (wide_mean - seen);
        return mix(blurred, sharp, cover);
    }
    return blurred;
}

// Beyond focus, the soft edge of a surface over what lies behind it: a layer over the sprites
// between the two. Sets the depths, and returns nothing where there is no edge.
vec4 edge(float radius, vec4 wide, vec4 before, vec2 sums) {
    float after = wide.a - before.a;
    float covers = before.a / max(wide.a, 1e-4);
    if (radius <= SHARP || before.a <= 1e-3 || after <= 1e-3) return vec4(0.0);
    float front = sums.x / before.a;
    float back = sums.y / after;
    if (abs(radius - front) < abs(radius - back)) {
        covers = mix(1.0, covers, layered(radius));
        if (covers > 0.999) return vec4(0.0);
        gl_FragDepth = depth_of_radius(back, farthest, focus_over_near);
    } else {
        covers *= layered(front);
    }
    front_depth = depth_of_radius(front, farthest, focus_over_near);
    return vec4(before.rgb / before.a, 1.0) * covers;
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 reach = texelFetch(tiles, here / (2 * side), 0).rgb;
    colour = texelFetch(opaque_colour, here, 0);
    float depth = texelFetch(opaque_depth, here, 0).r;
    front = vec4(0.0);
    front_depth = 1.0;
    gl_FragDepth = depth;
    if (reach == vec3(0.0)) return;

    float radius = clamp(signed_radius(depth, farthest, focus_over_near), -widest, widest);
    bool nearer = is_nearer(radius, depth, gl_FragCoord.xy);
    float own_kernel = kernel_radius(abs(radius));
    float share = layered(abs(radius));
    vec2 where = gl_FragCoord.xy / vec2(2 * textureSize(base, 0));
    vec4 wide = textureLod(blurred_sum, where, 0.0);
    vec3 wide_mean = wide.a > 1e-4 ? wide.rgb / wide.a : colour.rgb;
    front = textureLod(front_sum, where, 0.0);
    vec3 radius_sums = textureLod(radius_sum, where, 0.0).rgb;
    float front_radius = radius_sums.r;

    // Small circles: every pixel whose own reaches this one
    vec4 beside = vec4(0.0);
    vec4 over = vec4(0.0);
    vec4 small = vec4(0.0);
    float small_radius = 0.0;
    float own_share = 0.0;
    int rows = small_beside(here) ? 3 : -1;
    for (int y = -rows; y <= rows; ++y) {
        // Within 3.4 pixels
        int right = abs(y) < 2 ? 3 : 4 - abs(y);
        for (int x = -right; x <= right; ++x) {
            ivec2 at = here + ivec2(x, y);
            float away = length(vec2(x, y));
            if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, full_size))) continue;
            float z = texelFetch(opaque_depth, at, 0).r;
            float r = clamp(signed_radius(z, farthest, focus_over_near), -widest, widest);
            float kernel = kernel_radius(abs(r));
            float wider = layered(abs(r));
            vec3 there = texelFetch(opaque_colour, at, 0).rgb;
            float covered = (1.0 - wider) * disc_share(away, kernel, 1.0);
            float in_front = float(is_nearer(r, z, vec2(at) + 0.5));
            small += in_front * covered * vec4(there, 1.0);
            small_radius += in_front * covered * r;
            // Of two surfaces at most one lies behind the other
            float apart = behind(abs(radius - r), 0.0, away);
            float in_base = 1.0 - in_front;
            over += in_base * covered * (radius > r ? apart : 0.0) * vec4(there, 1.0);
            kernel = mix(kernel, min(kernel, own_kernel), radius < r ? apart : 0.0);
            beside += in_base * disc_share(away, kernel, 1.0) * vec4(mix(there, wide_mean, wider), 1.0);
            own_share += disc_share(away, own_kernel, 1.0);
        }
    }

    // Inside a front it hides all: shares of a soft disc over pixels do not add up to 1
    if (nearer && share < 1.0) {
        small /= own_share;
        small_radius /= own_share;
    }
    front += small;
    front_radius += small_radius;

    vec3 behind_front = colour.rgb;
    vec4 clean = unmixed(here, !nearer && reach.r > 0.0 ? 12 : 0);
    vec4 fill = filled(where, nearer ? LEVELS : 0);
    if (nearer) {
        behind_front = mix(fill.rgb, wide_mean, smoothstep(0.0, 0.2, wide.a));
        if (front.a < 0.999) gl_FragDepth = depth_of_radius(fill.a, farthest, focus_over_near);
    } else if (clean.a > 0.0) {
        behind_front = mix(clean.rgb, wide_mean, share);
    } else if (abs(radius) > SHARP) {
        vec3 far = mix(wide_mean, over.rgb / max(over.a, 1e-6), min(over.a, 1.0));
        vec3 close = beside.rgb / max(beside.a, 1e-6);
        behind_front = mix(close, far, share);
    }
    bool mends = !nearer && clean.a == 0.0 && reach.g > 0.0;
    behind_front = mended(here, radius, wide_mean, behind_front, mends ? 4 : 0);
    if (front.a > 1e-4) {
        front_radius /= front.a;
        front_depth = depth_of_radius(front_radius, farthest, focus_over_near);
        front /= max(front.a, 1.0);
        colour.rgb = front.rgb + (1.0 - front.a) * behind_front;
    } else {
        colour.rgb = behind_front;
        front = edge(radius, wide, textureLod(before_sum, where, 0.0), radius_sums.gb);
    }
}
