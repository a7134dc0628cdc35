// A relit sprite: unpack the terms, light them, blur by level of detail, lay fog over it.
#include "circular_harmonics.glsl"
#include "fog.glsl"
#include "optics.glsl"

uniform highp sampler2DArray planes;
uniform vec4 decode_scale[PLANES];
uniform vec4 decode_offset[PLANES];
uniform vec2 size;
#if LENS
uniform float focal_length;
uniform float f_number;
uniform float focus_distance;
uniform float lens_scale;
uniform float max_lod;
#endif
#if FOG
uniform vec3 camera_position;
uniform vec3 fog_radiance;
uniform float extinction;
uniform float falloff;
uniform float fog_base;
#endif
#if !LIGHT_IN_VERTEX
uniform sampler2D records;
#endif

#if DEFOCUS
uniform sampler2D front;  // what is blurred in front of focus, premultiplied
uniform sampler2D front_depth;
#endif

in vec2 uv;
in vec3 point;
in float depth;
flat in float texel_size;
flat in vec3 tint;
flat in ivec2 base;
#if LIGHT_IN_VERTEX
flat in vec3 light[TERMS];
#endif

layout(location = 0) out vec4 colour;

void main() {
    // The hardware's own level and the lens's: the coarser one filters enough for both
    vec2 across = dFdx(uv) * size;
    vec2 down = dFdy(uv) * size;
    float level = 0.5 * log2(max(max(dot(across, across), dot(down, down)), 1e-12));
#if LENS
    float coc = circle_of_confusion(depth, focal_length, f_number, focus_distance);
    level = max(level, lod(texels(coc, depth, focal_length, texel_size), lens_scale, max_lod));
#endif
    level = max(level, 0.0);

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
    colour = relight(decoded, light, tint);
#if FOG
    float pass = fog_transmittance(camera_position, point, extinction, falloff, fog_base);
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
