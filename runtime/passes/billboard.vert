// Upright sprites that share the camera's yaw, pulled from a table of records.
//
// An instance is four texels: (foot xyz, scale), (tint, flip +-1), box in texture coordinates,
// (first layer, first texel of its light, 0, 0).
#include "optics.glsl"

uniform mat4 clip_from_world;
uniform vec3 camera_position;
uniform vec3 camera_right;
uniform vec3 camera_forward;
uniform float near;
uniform sampler2D records;
uniform int first;  // instance
uniform vec2 size;  // texels of level 0
uniform vec2 pivot;  // texels from the top left
uniform float metres_per_texel;
#if LENS
uniform float focal_length;
uniform float f_number;
uniform float focus_distance;
uniform float sharp;  // circle on the sensor that changes nothing: half a pixel
#endif

out vec2 uv;
out vec3 point;
out float depth;
flat out float texel_size;  // metres
flat out vec3 tint;
flat out ivec2 base;  // first layer, first texel of the light
#if LIGHT_IN_VERTEX
flat out vec3 light[TERMS];
#endif

vec4 record(int index) {
    return texelFetch(records, ivec2(index % RECORD_ROW, index / RECORD_ROW), 0);
}

void main() {
    int at = 4 * (first + gl_InstanceID);
    vec4 place = record(at);
    vec4 look = record(at + 1);
    vec4 box = record(at + 2);
    vec4 which = record(at + 3);
    vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1));
    uv = mix(box.xy, box.zw, corner);
    texel_size = metres_per_texel * place.w;
    tint = look.rgb;
    base = ivec2(which.xy);
#if LIGHT_IN_VERTEX
    for (int k = 0; k < TERMS; ++k) light[k] = record(base.y + k).rgb;
#endif

    // Stand the sprite on its pivot, mirrored about it where flipped
    vec2 offset = (uv * size - pivot) * vec2(look.a, -1.0) * texel_size;
    point = place.xyz + camera_right * offset.x + vec3(0.0, offset.y, 0.0);
    depth = dot(point - camera_position, camera_forward);
    gl_Position = clip_from_world * vec4(point, 1.0);
#if LENS
    // What is blurred reaches forward by its own blur, so that the ground does not cut it off hard
    float coc = circle_of_confusion(depth, focal_length, f_number, focus_distance);
    float blur = 0.5 * max(coc - sharp, 0.0) * depth / focal_length;
    float shifted = max(depth - blur, 1.01 * near);
    if (depth > shifted) gl_Position.z = (1.0 - 2.0 * near / shifted) * gl_Position.w;
#endif
}
