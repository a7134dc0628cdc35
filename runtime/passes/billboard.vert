// Sprites that share the camera's yaw, or face it, pulled from a table of records.
//
// A sprite is four texels: (foot xyz, scale), (tint, flip +-1 times 1 + factor on alpha), box in
// texture coordinates of the set, (first layer, first texel of its light, of its set, roll).
// A set is three: (size, pivot), (metres per texel, scale and most of the lens's levels, softness),
// (share of the texture along x and y, coarsest level, 1 upright or 0 facing the camera).
// A disc has (radius, half width of its edge, gain) for its box: see maths/discs.py.
#include "optics.glsl"

uniform mat4 clip_from_world;
uniform vec3 camera_position;
uniform vec3 camera_right;
uniform vec3 camera_forward;
uniform float near;
uniform sampler2D records;
uniform int first;  // instance
#if LENS
uniform float focal_length;
uniform float f_number;
uniform float focus_distance;
uniform float sharp;  // circle on the sensor that changes nothing: half a pixel
#endif

out vec2 uv;
out vec4 place;  // point xyz, metres; depth
flat out vec4 look;  // tint, factor on alpha
flat out vec4 set;  // metres of a texel, scale and most of the lens's levels, softness
flat out ivec3 base;  // first layer, first texel of the light, coarsest level
#if LIGHT_IN_VERTEX
flat out vec3 light[TERMS];
#endif

vec4 record(int index) {
    return texelFetch(records, ivec2(index % RECORD_ROW, index / RECORD_ROW), 0);
}

void main() {
    int at = 4 * (first + gl_InstanceID);
    vec4 foot = record(at);
    vec4 tint = record(at + 1);
    vec4 box = record(at + 2);
    vec4 which = record(at + 3);
    int of_set = int(which.z);
    vec4 sizes = record(of_set);
    vec4 share = record(of_set + 2);
    set = record(of_set + 1) * vec4(foot.w, 1.0, 1.0, 1.0);
    look = vec4(tint.rgb, abs(tint.a) - 1.0);
    base = ivec3(which.xy, share.z);
#if LIGHT_IN_VERTEX
    for (int k = 0; k < TERMS; ++k) light[k] = record(base.y + k).rgb;
#endif

    // Stand the sprite on its pivot, mirrored about it where flipped, then rolled
    vec2 side = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1));
#if DISC
    vec2 corner = (2.0 * side - 1.0) * (box.x + box.y);
    vec2 offset = corner;
    share.xy = vec2(1.0);
    set.xy = box.xy;
    look *= box.z;
#else
    vec2 corner = mix(box.xy, box.zw, side);
    vec2 offset = (corner * sizes.xy - sizes.zw) * vec2(sign(tint.a), -1.0) * set.x;
    vec2 turn = vec2(cos(which.w), sin(which.w));
    offset = vec2(turn.x * offset.x - turn.y * offset.y, turn.y * offset.x + turn.x * offset.y);
#endif
    vec3 up = share.w > 0.5 ? vec3(0.0, 1.0, 0.0) : cross(camera_right, camera_forward);
    vec3 point = foot.xyz + camera_right * offset.x + up * offset.y;
    float depth = dot(point - camera_position, camera_forward);
    uv = corner * share.xy;
    place = vec4(point, depth);
    gl_Position = clip_from_world * vec4(point, 1.0);
#if LENS
    // What is blurred reaches forward by its own blur, so that the ground does not cut it off hard
    float coc = circle_of_confusion(depth, focal_length, f_number, focus_distance);
    float blur = 0.5 * max(coc - sharp, 0.0) * depth / focal_length;
    float shifted = max(depth - blur, 1.01 * near);
    if (depth > shifted) gl_Position.z = (1.0 - 2.0 * near / shifted) * gl_Position.w;
#endif
}
