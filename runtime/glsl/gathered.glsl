// Whether a texel has light; passes are -1 where it is covered
float is_known(vec4 direct, vec4 before) {
    return direct.a < 0.0 ? 0.0 : min(direct.a + before.a, 1.0);
}

// What sums over passes say: irradiance, with what was shown before a change fading out.

// direct: sum and passes. indirect: sum and rays. before: irradiance, 1 where there is any
vec3 settled_light(vec4 direct, vec4 indirect, vec4 before, float fade) {
    vec3 light = direct.rgb / max(direct.a, 1.0) + indirect.rgb / max(indirect.a, 1e-6);
    return mix(light, before.rgb, before.a * exp2(-direct.a * fade));
}
