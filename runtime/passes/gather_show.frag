// The lightmap: irradiance of each texel, gutters filled, and 1 where there is light.
// DOWNSAMPLE: texels along a side of a cell that are shown as their mean.
#include "gathered.glsl"

uniform isampler2D source;
uniform sampler2D direct_sum;
uniform sampler2D indirect_sum;
uniform sampler2D before;
uniform usampler2D texels;
uniform float fade;
uniform float calm;      // passes until which a texel takes from its neighbours, less and less

out vec4 light;

vec4 light_at_texel(ivec2 at) {
    vec4 direct = texelFetch(direct_sum, at, 0);
    vec4 old = texelFetch(before, at, 0);
    float known = is_known(direct, old);
    return vec4(settled_light(direct, texelFetch(indirect_sum, at, 0), old, fade), 1.0) * known;
}

vec4 light_of(ivec2 at) {
#if DOWNSAMPLE > 1
    // Texels of a face of a cell lie side by side in the atlas, and are covered all at once
    uint place = texelFetch(texels, at, 0).w;
    ivec2 first = at - ivec2(int(place & 63u), int((place >> 6u) & 63u)) % DOWNSAMPLE;
    vec4 light = vec4(0.0);
    for (int i = 0; i < DOWNSAMPLE * DOWNSAMPLE; ++i) {
        light += light_at_texel(first + ivec2(i % DOWNSAMPLE, i / DOWNSAMPLE));
    }
    return light.a > 0.0 ? light / light.a : vec4(0.0);
#else
    return light_at_texel(at);
#endif
}

// Mean of the texels about one on the same plane, weights falling with distance
vec4 calmed(ivec2 at, int count) {
    uvec4 own = texelFetch(texels, at, 0);
    int axis = int(own.w >> 13u);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < count; ++i) {
        ivec2 step = ivec2(i % 5 - 2, i / 5 - 2);
        ivec2 place = clamp(at + step, ivec2(0), textureSize(source, 0) - 1);
        ivec2 beside = texelFetch(source, place, 0).xy;
        if (beside.x < 0) continue;
        uvec4 other = texelFetch(texels, beside, 0);
        // The next rectangle of the atlas may be anywhere
        ivec3 apart = abs(ivec3(other.xyz) - ivec3(own.xyz));
        bool near = other.w >> 12u == own.w >> 12u && apart[axis] == 0 && all(lessThan(apart, ivec3(4)));
        float weight = near ? float((3 - abs(step.x)) * (3 - abs(step.y))) : 0.0;
        sum += weight * light_of(beside);
    }
    return sum / max(sum.a, 1e-6);
}

void main() {
    ivec2 at = texelFetch(source, ivec2(gl_FragCoord.xy), 0).xy;
    light = vec4(0.0);
    if (at.x < 0) {
        return;
    }
    light = light_of(at);
    float young = clamp(1.0 - texelFetch(direct_sum, at, 0).a / max(calm, 1e-3), 0.0, 1.0);
    // Counts, not branches: where texels run side by side, a branch that any takes costs all of them
    bool lit = light.a > 0.0;
    vec4 calm_light = calmed(at, lit && young > 0.0 ? 25 : 0);
    if (lit && young > 0.0) {
        light = mix(light, calm_light, young);
    }
    // Covered for now: show what its neighbours have
    for (int i = 0; i < (lit ? 0 : 9); ++i) {
        ivec2 beside = clamp(at + ivec2(i % 3 - 1, i / 3 - 1), ivec2(0), textureSize(source, 0) - 1);
        if (texelFetch(source, beside, 0).xy == beside) {
            light += light_of(beside);
        }
    }
    if (!lit) {
        light = vec4(light.rgb / max(light.a, 1.0), 0.0);
    }
}
