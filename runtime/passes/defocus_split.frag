// Half size: what is nearer than focus, what is blurred behind it, and all that is not nearer.
#include "defocus.glsl"

uniform sampler2D opaque_colour;
uniform sampler2D opaque_depth;
uniform ivec2 full_size;
uniform float farthest;
uniform float widest;
uniform float focus_over_near;
uniform vec3 ground_plane;  // times (x, y, 1): 1 - depth of the ground at a pixel

layout(location = 0) out vec4 front;    // premultiplied by coverage
layout(location = 1) out vec4 blurred;
layout(location = 2) out vec4 base;
layout(location = 3) out vec4 radii;    // times weight, times weight, times coverage; whether small circles are here

void main() {
    ivec2 corner = 2 * ivec2(gl_FragCoord.xy) - 1;
    float radius[16];
    vec3 colour[16];
    bool valid[16];
    bool nearer[16];
    for (int i = 0; i < 16; ++i) {
        ivec2 at = corner + ivec2(i & 3, i >> 2);
        valid[i] = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, full_size));
        at = clamp(at, ivec2(0), full_size - 1);
        float depth = texelFetch(opaque_depth, at, 0).r;
        radius[i] = clamp(signed_radius(depth, farthest, focus_over_near), -widest, widest);
        float level = dot(ground_plane, vec3(vec2(at) + 0.5, 1.0));
        bool ground = abs(1.0 - depth - level) < 1e-3 * level + 2e-7;
        nearer[i] = radius[i] < -SHARP && !ground;
        colour[i] = texelFetch(opaque_colour, at, 0).rgb;
    }

    // Coverage and mean radius of each layer over the four pixels
    vec3 cover = vec3(0.0);
    vec3 mean = vec3(0.0);
    vec3 weights = vec3(0.0);
    vec3 weighted = vec3(0.0);
    float small = 0.0;
    for (int i = 0; i < 4; ++i) {
        int p = 5 + (i & 1) + 4 * (i >> 1);
        float c = abs(radius[p]);
        float here = valid[p] ? 0.25 : 0.0;
        vec3 in_layer = here * (nearer[p] ? vec3(layered(c), 0.0, 0.0) : vec3(0.0, layered(c), 1.0));
        cover += in_layer;
        mean += in_layer * radius[p];
        vec3 weight = in_layer * radius_weight(vec4(colour[p], 1.0));
        weights += weight;
        weighted += weight * radius[p];
        if (valid[p] && c > SHARP && c < 3.0) small = 1.0;
    }
    vec3 of = mean / max(cover, vec3(1e-6));

    // Colours of each layer from its own pixels, hardly from those on an edge: they are mixed
    vec4 sum[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    for (int p = 0; p < 16; ++p) {
        if (!valid[p]) continue;
        ivec2 at = ivec2(p & 3, p >> 2);
        bool inner = at.x > 0 && at.x < 3 && at.y > 0 && at.y < 3;
        bool edge = false;
        if (at.x > 0) edge = edge || abs(radius[p] - radius[p - 1]) > 1.0;
        if (at.x < 3) edge = edge || abs(radius[p] - radius[p + 1]) > 1.0;
        if (at.y > 0) edge = edge || abs(radius[p] - radius[p - 4]) > 1.0;
        if (at.y < 3) edge = edge || abs(radius[p] - radius[p + 4]) > 1.0;
        float weight = (inner ? 1.0 : 0.02) * (edge ? 0.001 : 1.0);
        vec3 away = abs(of - radius[p]);
        vec3 alike = weight * vec3(lessThan(away, 1.0 + 0.1 * abs(of)));
        alike += vec3(inner ? 1e-6 : 0.0);
        float share = layered(abs(radius[p]));
        if (nearer[p]) {
            sum[0] += alike.x * share * vec4(colour[p], 1.0);
        } else {
            sum[1] += alike.y * share * vec4(colour[p], 1.0);
            sum[2] += alike.z * vec4(colour[p], 1.0);
        }
    }
    front = vec4(sum[0].rgb / max(sum[0].a, 1e-9), 1.0) * cover.x;
    blurred = vec4(sum[1].rgb / max(sum[1].a, 1e-9), 1.0) * cover.y;
    base = vec4(sum[2].rgb / max(sum[2].a, 1e-9), 1.0) * cover.z;
    vec2 lit = (weighted / max(weights, vec3(1e-9))).xy;
    lit *= vec2(radius_weight(front), radius_weight(blurred));
    radii = vec4(clamp(lit, -6e4, 6e4), mean.z, small);
}
