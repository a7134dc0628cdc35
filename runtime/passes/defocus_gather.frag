// Half size: every texel whose circle reaches this one gives it its share of light.
//
// All texels of the level of the pyramid on which the widest circle has at most RINGS texels are
// visited, at their true distances: no pattern of taps, so no noise.
#include "defocus.glsl"

uniform sampler2D front;
uniform sampler2D blurred;
uniform sampler2D radii;
uniform sampler2D tiles;
uniform ivec2 full_size;
uniform int side;

layout(location = 0) out vec4 front_sum;    // premultiplied
layout(location = 1) out vec4 blurred_sum;  // not normalised
// Radius times alpha: of the front; beyond focus, of what lies before an edge and what behind it
layout(location = 2) out vec4 radius_sum;
layout(location = 3) out vec4 before_sum;   // share of blurred_sum that lies before an edge

float on_level(float radius, float texel) {
    // Less what averaging the texels, the ramp and the enlargement add to the variance
    float lessened = radius * radius - texel * texel * 0.6666667 - 2.0;
    return sqrt(max(lessened, 0.25 * texel * texel));
}

void main() {
    front_sum = blurred_sum = radius_sum = before_sum = vec4(0.0);
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec2 widest = texelFetch(tiles, here / side, 0).rg;
    float reach = max(widest.x, widest.y);
    if (reach <= 0.0) return;
    int level = max(int(ceil(log2(reach / float(RINGS)))), 1) - 1;
    float texel = float(2 << level);
    vec4 own = texelFetch(blurred, here, 0);
    float here_radius = own.a > 0.05 ? texelFetch(radii, here, 0).g / radius_weight(own) : 1e4;
    float here_kernel = on_level(abs(here_radius), texel);
    // Inside the front layer shares are counted, so that it hides all there: sums of a soft disc
    // over texels are a few hundredths off its area
    vec4 own_front = texelFetch(front, here, 0);
    float in_front = own_front.a;
    float front_radius =
        in_front > 0.0 ? -texelFetch(radii, here, 0).r / radius_weight(own_front) : 0.0;
    float front_kernel = on_level(front_radius, texel);
    float counted = 0.0;
    vec4 nearer_sum = vec4(0.0);
    vec4 farther_sum = vec4(0.0);
    vec3 by_layer = vec3(0.0);  // sums of radii: all, nearer, farther

    vec2 middle = 2.0 * gl_FragCoord.xy;
    reach += 0.5 * texel;
    int low = int(floor((middle.y - reach) / texel));
    int high = int(floor((middle.y + reach) / texel));
    // Beyond the picture its border goes on
    ivec2 last = (full_size - 1) / (2 << level);
    for (int y = low; y <= high; ++y) {
        float down = texel * (float(y) + 0.5) - middle.y;
        float across = sqrt(max(reach * reach - down * down, 0.0));
        int right = int(floor((middle.x + across) / texel - 0.5));
        for (int x = int(ceil((middle.x - across) / texel - 0.5)); x <= right; ++x) {
            float away = length(vec2(texel * (float(x) + 0.5) - middle.x, down));
            if (in_front > 0.0) counted += disc_share(away, front_kernel, texel) * texel * texel;
            ivec2 at = clamp(ivec2(x, y), ivec2(0), last);
            vec2 r = texelFetch(radii, at, level).rg;
            if (r.x < 0.0) {
                vec4 near = texelFetch(front, at, level);
                float mean = r.x / max(radius_weight(near), 1e-5);
                float share = disc_share(away, on_level(-mean, texel), texel) * texel * texel;
                front_sum += share * near;
                radius_sum.r += share * near.a * mean;
            }
            if (r.y != 0.0) {
                vec4 far = texelFetch(blurred, at, level);
                float mean = r.y / max(radius_weight(far), 1e-5);
                float kernel = on_level(abs(mean), texel);
                // Seen past the edge of this surface only as far as its own circle reaches
                float farther = behind(mean, here_radius, away);
                kernel = mix(kernel, min(kernel, here_kernel), farther);
                vec4 given = disc_share(away, kernel, texel) * texel * texel * far;
                float nearer = behind(here_radius, mean, away);
                blurred_sum += given;
                nearer_sum += nearer * given;
                farther_sum += farther * given;
                by_layer += given.a * mean * vec3(1.0, nearer, farther);
            }
        }
    }
    // This texel lies on one side of an edge, and its share of the other tells of the edge
    bool beyond = nearer_sum.a > farther_sum.a;
    before_sum = beyond ? nearer_sum : blurred_sum - farther_sum;
    radius_sum.g = beyond ? by_layer.y : by_layer.x - by_layer.z;
    radius_sum.b = by_layer.x - radius_sum.g;
    if (in_front > 0.0) {
        float whole = mix(1.0, counted, min(in_front / layered(front_radius), 1.0));
        front_sum /= whole;
        radius_sum.r /= whole;
    }
}
