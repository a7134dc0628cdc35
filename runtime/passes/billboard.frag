// A sprite: unpack the terms, light them, or take a picture as it is; blur by level of detail, lay
// fog over it.
#include "circular_harmonics.glsl"
#include "fog.glsl"
#include "optics.glsl"

#if !DISC
uniform highp sampler2DArray planes;
#endif
#if TERMS
uniform vec4 decode_scale[PLANES];
uniform vec4 decode_offset[PLANES];
#endif
#if SOFT || !TERMS
uniform float near;
#endif
#if SOFT
uniform sampler2D opaque_depth;
#endif
#if LENS && !DISC
uniform float focal_length;
uniform float f_number;
uniform float focus_distance;
#endif
#if FOG
uniform vec3 camera_position;
uniform vec3 fog_radiance;
uniform float extinction;
uniform float falloff;
uniform float fog_base;
#endif
#if TERMS && !LIGHT_IN_VERTEX
uniform sampler2D records;
#endif

#if DEFOCUS
uniform sampler2D front;  // what is blurred in front of focus, premultiplied
uniform sampler2D front_depth;
#endif

in vec2 uv;
in vec4 place;
flat in vec4 look;
flat in vec4 set;
flat in ivec3 base;
#if LIGHT_IN_VERTEX
flat in vec3 light[TERMS];
#endif

layout(location = 0) out vec4 colour;

#if LENS && !DISC && !TERMS
// One level through a kernel between the tent of the hardware, at 0, and the cubic B-spline, at 1:
// a blur is two texels wide, of which tents make squares. Four reads of two by two texels.
vec4 rounded(float level, float share) {
    vec2 size = vec2(textureSize(planes, int(level)).xy);
    vec2 at = uv * size - 0.5;
    vec2 f = fract(at), g = 1.0 - f;
    vec2 before = share * g * g * g / 6.0;
    vec2 after = share * f * f * f / 6.0;
    vec2 here = mix(g, (4.0 - 6.0 * f * f + 3.0 * f * f * f) / 6.0, share);
    vec2 low = before + here, high = 1.0 - low;
    vec2 a = (at - f - 0.5 + here / low) / size;
    vec2 b = (at - f + 1.5 + after / max(high, 1e-6)) / size;
    float layer = float(base.x);
    return low.y * (low.x * textureLod(planes, vec3(a, layer), level)
                    + high.x * textureLod(planes, vec3(b.x, a.y, layer), level))
        + high.y * (low.x * textureLod(planes, vec3(a.x, b.y, layer), level)
                    + high.x * textureLod(planes, vec3(b, layer), level));
}

// As textureLod, round where levels are coarser than pixels ask for by `blur`.
vec4 lookup(float level, float blur) {
    if (blur <= 0.0) return textureLod(planes, vec3(uv, float(base.x)), level);
    float share = min(blur, 1.0), fine = floor(level);
    vec4 found = rounded(fine, share);
    return level == fine ? found : mix(found, rounded(fine + 1.0, share), level - fine);
}
#endif

void main() {
#if !DISC
    // The hardware's own level and the lens's: the coarser one filters enough for both
    vec2 size = vec2(textureSize(planes, 0).xy);
    vec2 across = dFdx(uv) * size;
    vec2 down = dFdy(uv) * size;
    float level = 0.5 * log2(max(max(dot(across, across), dot(down, down)), 1e-12));
#if LENS
    float fine = clamp(level, 0.0, float(base.z));
    float coc = circle_of_confusion(place.w, focal_length, f_number, focus_distance);
    level = max(level, lod(texels(coc, place.w, focal_length, set.x), set.y, set.z));
#endif
    level = clamp(level, 0.0, float(base.z));
#endif

#if TERMS
    vec4 decoded[PLANES];
    decoded[0] = textureLod(planes, vec3(uv, float(base.x)), level) * decode_scale[0] + decode_offset[0];
    if (decoded[0].a <= 0.0) discard;
    for (int p = 1; p < PLANES; ++p) {
        vec4 code = textureLod(planes, vec3(uv, float(base.x + p)), level);
        decoded[p] = code * decode_scale[p] + decode_offset[p];
    }

#if !LIGHT_IN_VERTEX
    vec3 light[TERMS];
    for (int k = 0; k < TERMS; ++k) {
        int at = base.y + k;
        light[k] = texelFetch(records, ivec2(at % RECORD_ROW, at / RECORD_ROW), 0).rgb;
    }
#endif
    colour = relight(decoded, light, look.rgb);
    colour.a *= look.a;
#else
    // Premultiplied as it is; it fades out before the nearest plane cuts it
    float fade = smoothstep(near, 2.0 * near, place.w);
#if DISC
    colour = look * ((1.0 - smoothstep(set.x - set.y, set.x + set.y, length(uv))) * fade);
#else
#if LENS
    colour = lookup(level, level - fine) * look * fade;
#else
    colour = textureLod(planes, vec3(uv, float(base.x)), level) * look * fade;
#endif
#endif
#endif
#if SOFT
    // Depth is 1 - near / distance; over the last metres before what is opaque all fades
    float behind = texelFetch(opaque_depth, ivec2(gl_FragCoord.xy), 0).r;
    if (gl_FragCoord.z > behind) discard;
    float gap = near / max(1.0 - behind, 1e-7) - near / max(1.0 - gl_FragCoord.z, 1e-7);
    if (set.w > 0.0) colour *= smoothstep(0.0, set.w, gap);
#endif
#if FOG
    float pass = fog_transmittance(camera_position, place.xyz, extinction, falloff, fog_base);
    colour.rgb = colour.rgb * pass + fog_radiance * colour.a * (1.0 - pass);
#endif
#if DEFOCUS
    // Under the blurred front: the blend keeps of it, already in the picture, what is added here
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    if (gl_FragCoord.z > texelFetch(front_depth, pixel, 0).r) {
        vec4 over = texelFetch(front, pixel, 0);
        colour.rgb = colour.rgb * (1.0 - over.a) + colour.a * over.rgb;
    }
#endif
}
