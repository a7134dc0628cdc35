// Relit radiance of a sprite: decoded planes against a light projected on circular harmonics, or on
// the channels of a dome.
//
// planes : decoded values, premultiplied. light : L_k, k < TERMS. Results are not clamped: negative
// lobes of one term cancel others, so the caller clamps after the sum.
// TERMS : odd K, or channels; 0 of a picture, which has nothing to unpack. PLANES : RGBA planes a
// view. PACKING : 0 full, 1 chroma, 2 talk, 3 dome, 4 picture, 5 disc.

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);  // Rec. 709

#if PACKING == 0

// Every term has a plane of its own.
vec3 unpack_full(vec4 planes[PLANES], vec3 light[TERMS]) {
    vec3 sum = vec3(0.0);
    for (int k = 0; k < PLANES; ++k) sum += planes[k].rgb * light[k];
    return sum;
}

#elif PACKING == 3

// Each channel is one number that counts by a colour; coverage has the fourth slot of plane 0.
vec3 unpack_dome(vec4 planes[PLANES], vec3 light[TERMS]) {
    vec3 sum = vec3(0.0);
    for (int k = 0; k < TERMS; ++k) {
        int slot = k < 3 ? k : k + 1;
        sum += planes[slot / 4][slot % 4] * light[k];
    }
    return sum;
}

#elif TERMS

// Luma terms from the fifth on lie four to a plane.
vec3 further_lumas(vec4 planes[PLANES], vec3 light[TERMS]) {
    vec3 sum = vec3(0.0);
    for (int k = 5; k < TERMS; ++k) sum += planes[3 + (k - 5) / 4][(k - 5) % 4] * light[k];
    return sum;
}

// A luma takes the colour of the same texel's first term.
vec3 unpack_chroma(vec4 planes[PLANES], vec3 light[TERMS]) {
    vec3 coloured = planes[0].rgb * light[0] + planes[1].rgb * light[1] + planes[2].rgb * light[2];
    vec3 lumas = planes[1].a * light[3] + planes[2].a * light[4] + further_lumas(planes, light);
    float base = dot(planes[0].rgb, LUMINANCE);
    return base > 1e-12 ? coloured + planes[0].rgb / base * lumas : coloured;
}

// The ps_1_1 program of Evans' talk on decoded values; c3.a and c4.a are the light's luma.
vec4 unpack_talk(vec4 planes[PLANES], vec3 light[TERMS], vec4 vertex) {
    vec4 r0 = planes[0] * vec4(light[0], 1.0);
    r0.rgb += planes[1].rgb * light[1];
    r0.rgb += planes[2].rgb * light[2];
    r0.rgb += vec3(planes[1].a * dot(light[3], LUMINANCE));
    r0.rgb += vec3(planes[2].a * dot(light[4], LUMINANCE));
    r0.rgb += vec3(dot(further_lumas(planes, light), LUMINANCE));
    return r0 * vertex;
}

#endif

#if TERMS

// Premultiplied colour and coverage of a texel, tinted, by whichever packing the sprite has.
vec4 relight(vec4 planes[PLANES], vec3 light[TERMS], vec3 tint) {
#if PACKING == 0
    vec4 lit = vec4(unpack_full(planes, light) * tint, planes[0].a);
#elif PACKING == 3
    vec4 lit = vec4(unpack_dome(planes, light) * tint, planes[0].a);
#elif PACKING == 1
    vec4 lit = vec4(unpack_chroma(planes, light) * tint, planes[0].a);
#else
    vec4 lit = unpack_talk(planes, light, vec4(tint, 1.0));
#endif
    return max(lit, vec4(0.0));
}

#endif
