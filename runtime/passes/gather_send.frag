// What each texel hands on, from what is known of its light: albedo / pi times irradiance.
#include "gathered.glsl"

uniform usampler2D texels;
uniform sampler2D direct_sum;
uniform sampler2D indirect_sum;
uniform sampler2D latest;
uniform sampler2D before;
uniform usampler3D rows;
uniform sampler2D palette;
uniform float settled;     // passes until which the latest light counts, not the mean
uniform float fade;
uniform float bounced;     // 0 to hand on only what glows
uniform float remembered;  // 0 to hand on nothing of what was shown before

out vec4 sent;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    uvec4 texel = texelFetch(texels, at, 0);
    vec4 direct = texelFetch(direct_sum, at, 0);
    vec4 old = texelFetch(before, at, 0);
    sent = vec4(0.0);
    if (texel.w == 65535u) {
        return;
    }
    vec4 indirect = texelFetch(indirect_sum, at, 0);
    if (direct.a < settled) {
        indirect = vec4(texelFetch(latest, at, 0).rgb, 1.0);
    }
    int row = int(texelFetch(rows, ivec3(texel.xyz), 0).x);
    vec3 albedo = texelFetch(palette, ivec2(row & 255, row >> 8), 0).rgb;
    vec3 light = settled_light(direct, indirect * bounced, old * remembered, fade);
    sent = vec4(albedo * light * 0.3183098861837907, 1.0);
}
