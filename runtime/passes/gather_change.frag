// Forget what was gathered where light may have changed by more than `least`; what was shown fades.
// A box of cells that sends at most L more or less changes irradiance by at most pi L R^2 / d^2, R
// the radius of the ball around it and d the distance to its middle.
#include "texel_places.glsl"
#include "gathered.glsl"

uniform usampler2D texels;
uniform sampler2D direct_sum;
uniform sampler2D indirect_sum;
uniform sampler2D latest;
uniform sampler2D before;
uniform float fade;
uniform float least;
uniform int count;
uniform vec4 middle[BOXES];  // of boxes, and the radius
uniform float radiance[BOXES];

layout(location = 0) out vec4 direct_out;
layout(location = 1) out vec4 indirect_out;
layout(location = 2) out vec4 latest_out;
layout(location = 3) out vec4 before_out;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    uvec4 texel = texelFetch(texels, at, 0);
    direct_out = texelFetch(direct_sum, at, 0);
    indirect_out = texelFetch(indirect_sum, at, 0);
    latest_out = texelFetch(latest, at, 0);
    before_out = texelFetch(before, at, 0);
    if (texel.w == 65535u) {
        return;
    }
    vec3 place = vec3(texel.xyz) + 0.5 + 0.5 * vec3(normal_of(int(texel.w >> 12u)));
    float change = 0.0;
    for (int i = 0; i < count; ++i) {
        vec3 to = middle[i].xyz - place;
        float reach = middle[i].w * middle[i].w;
        change += 3.14159265358979 * radiance[i] * reach / max(dot(to, to), reach);
    }
    if (change > least) {
        float known = is_known(direct_out, before_out);
        before_out = vec4(settled_light(direct_out, indirect_out, before_out, fade), 1.0) * known;
        direct_out = indirect_out = vec4(0.0);
        latest_out.a = 0.0;
    }
}
