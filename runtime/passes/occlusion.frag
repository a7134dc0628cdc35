// What a caster leaves of the light, multiplied into the picture: looked up for both its ends.
#include "occlusion.glsl"

uniform sampler2D opaque_depth;
uniform sampler3D first_hidden;   // of the light at each end: RECEIVER: slabs along z, by normal
uniform sampler3D second_hidden;
#if COARSE
uniform sampler3D first_coarse;   // what other bands hide, on a grid of their own
uniform sampler3D second_coarse;
#endif
uniform float warp;               // see occlusion_warp
#if RECEIVER
const int LOBES = 9;
uniform vec2 depth;               // voxels of a slab of each grid along z
uniform vec3 facing[2 * LOBES];   // what meets a normal's harmonics, by end
#endif
uniform mat3 object_from_world;
uniform vec3 object_camera;       // the camera in the object's frame
uniform vec3 longest;             // unit vector of the longest axis
uniform vec3 extent;              // half of the volume, metres of the mesh
uniform float reach;              // metres of the mesh from the middle; nothing is hidden beyond
uniform float near;
uniform int side;                 // of an edge within a pixel: 0 before it, 1 behind it
#if SAMPLED
const float EDGE = 0.01;          // least jump of one, as a share of the nearer 1 / distance
#endif
#if OWN || RECEIVER
uniform vec2 ground;              // height of the camera over it, 1 where there is one
#endif
#if OWN
uniform isampler2D mesh_number;
uniform int own;
#endif
#if RECEIVER && NORMALS
uniform sampler2D mesh_normal;
#endif

in vec3 ray;
in vec2 screen;

layout(location = 0) out vec4 colour;

#if RECEIVER
// Slab i of SLABS, `n` voxels deep: no filter reaches the next one.
vec3 of_slab(sampler3D slabs, vec3 place, int i, float n) {
    float z = float(i) * n + clamp(place.z * n, 0.5, n - 0.5);
    return texture(slabs, vec3(place.xy, z / (n * float(SLABS)))).rgb;
}

// The slab of a normal along an axis, behind those of the harmonics; -1 of any other normal.
int slab_of(vec3 n) {
    vec3 along = step(0.99999, abs(n));
    int axis = int(dot(along, vec3(0.0, 1.0, 2.0)));
    return along == vec3(0.0) ? -1 : LOBES + axis + (n[axis] < 0.0 ? 3 : 0);
}
#endif

float depth_at(ivec2 pixel) {
    pixel = clamp(pixel, ivec2(0), textureSize(opaque_depth, 0) - 1);
    return texelFetch(opaque_depth, pixel, 0).r;
}

#if SAMPLED
// Depth between the two surfaces whose edge a pixel may hold, else 1: samples before it take the
// shadow of the nearer one (side 0), those behind it of the farther one (side 1). z, way : depth of
// that surface, 1 where there is nothing to draw, and the step to the pixel that shows it.
float edge_at(ivec2 pixel, inout float z, out ivec2 way) {
    float here = z, low = z, high = z, bend = 0.0;
    ivec2 nearest = ivec2(0), farthest = ivec2(0);
    for (int axis = 0; axis < 2; ++axis) {
        float sum = -2.0 * here;
        for (int i = -1; i < 2; i += 2) {
            ivec2 beside = axis == 0 ? ivec2(i, 0) : ivec2(0, i);
            float there = depth_at(pixel + beside);
            sum += there;
            nearest = there < low ? beside : nearest;
            farthest = there > high ? beside : farthest;
            low = min(low, there);
            high = max(high, there);
        }
        // 1 - depth is linear over the picture on every plane; at its border nothing is known
        bool inner = pixel[axis] > 0 && pixel[axis] < textureSize(opaque_depth, 0)[axis] - 1;
        bend = max(bend, inner ? abs(sum) : 0.0);
    }
    float split = 0.5 * (low + high);
    bool edge = high < 1.0 && bend > EDGE * (1.0 - low);
    // Samples of the sky are left out by the depth test: beside it an edge is taken for the nearer
    bool first = edge ? here < split : here < 1.0;
    z = first == (side == 0) ? here : side == 0 ? low : high;
    way = first == (side == 0) ? ivec2(0) : side == 0 ? nearest : farthest;
    if (edge) return split;
    z = side == 0 ? z : 1.0;
    return 1.0;
}
#endif

#if OWN || RECEIVER
// Whether a point is of the ground: height y above it, d before the camera.
bool is_ground(float y, float d) {
    float error = 1e-5 * d + 2.4e-7 * d * d / near;  // of a depth of 24 bits
    return ground.y > 0.5 && abs(y) <= error;
}
#endif

#if OWN
int number_at(ivec2 pixel) {
    pixel = clamp(pixel, ivec2(0), textureSize(mesh_number, 0) - 1);
    return texelFetch(mesh_number, pixel, 0).r;
}

// Whether the caster itself is seen at height y above the ground, d before the camera; size : of a
// pixel there, in the frame of p.
bool is_own(ivec2 pixel, float y, float d, vec3 p, vec3 size) {
    // Meshes under the ground have a number too
    if (is_ground(y, d)) return false;
    int here = number_at(pixel);
    if (here == own && side == 0) return true;
    // Numbers are those of pixels' middles, depths those of samples: its edges lie in its box
    if (!all(lessThanEqual(abs(p), 0.501 + 0.75 * size))) return false;
    if (here == own || here == 0) return true;
    for (int i = 0; i < 9; ++i) {
        if (number_at(pixel + ivec2(i % 3 - 1, i / 3 - 1)) == own) return true;
    }
    return false;
}
#endif

#if RECEIVER
// Normal of what is seen at height y above the ground, d before the camera; 0 where it has none.
vec3 normal_at(ivec2 pixel, float y, float d) {
    if (is_ground(y, d)) return vec3(0.0, 1.0, 0.0);
#if NORMALS
    // Normals are those of pixels' middles: at an edge a neighbour's is taken
    for (int i = 0; i < 9; ++i) {
        ivec2 way = ivec2((i + 1) % 3 - 1, (i / 3 + 1) % 3 - 1);
        ivec2 at = clamp(pixel + way, ivec2(0), textureSize(mesh_normal, 0) - 1);
        vec4 found = texelFetch(mesh_normal, at, 0);
        if (found.w > 0.5) return normalize(found.xyz);
    }
#endif
    return vec3(0.0);
}
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 towards = ray;
    float z = depth_at(pixel);
    vec3 right = dFdx(ray), up = dFdy(ray);
#if SAMPLED
    ivec2 way;
    gl_FragDepth = edge_at(pixel, z, way);
    pixel += way;
    towards += right * float(way.x) + up * float(way.y);
#endif
    if (z >= 1.0) discard;
    float d = near / (1.0 - z);
    vec3 p = object_from_world * (towards * d) + object_camera;
#if OWN
    vec3 size = d * (abs(object_from_world * right) + abs(object_from_world * up));
    if (is_own(pixel, ground.x + towards.y * d, d, p, size)) discard;
#endif
    vec3 offset = p * extent;
    if (dot(offset, offset) > reach * reach) discard;
    vec3 place = occlusion_warp(occlusion_place(p), warp);
    vec3 hidden[2] = vec3[2](vec3(0.0), vec3(0.0));
#if RECEIVER
    vec3 n = normal_at(pixel, ground.x + towards.y * d, d);
    float lobe[9] = receiver_lobe(n);
    int slab = slab_of(n);
    int count = slab < 0 ? LOBES : 1;
    for (int j = 0; j < count; ++j) {
        float share = slab < 0 ? lobe[j] : 1.0;
        int i = max(slab, j);
        hidden[0] += share * of_slab(first_hidden, place, i, depth.x);
        hidden[1] += share * of_slab(second_hidden, place, i, depth.x);
#if COARSE
        hidden[0] += share * of_slab(first_coarse, place, i, depth.y);
        hidden[1] += share * of_slab(second_coarse, place, i, depth.y);
#endif
    }
#else
    hidden[0] = texture(first_hidden, place).rgb;
    hidden[1] = texture(second_hidden, place).rgb;
#if COARSE
    hidden[0] += texture(first_coarse, place).rgb;
    hidden[1] += texture(second_coarse, place).rgb;
#endif
#endif
    float factor = 1.0;
#if FALLOFF
    factor = occlusion_falloff(p, extent);
#endif
    float along = clamp(dot(p, longest) + 0.5, 0.0, 1.0);
#if RECEIVER
    vec3 faced[2] = vec3[2](vec3(0.0), vec3(0.0));
    for (int j = 0; j < LOBES; ++j) {
        faced[0] += lobe[j] * facing[j];
        faced[1] += lobe[j] * facing[LOBES + j];
    }
    vec3 first = receiver_share(hidden[0] * factor, faced[0]);
    vec3 second = receiver_share(hidden[1] * factor, faced[1]);
#else
    vec3 first = clamp(1.0 - hidden[0] * factor, 0.0, 1.0);
    vec3 second = clamp(1.0 - hidden[1] * factor, 0.0, 1.0);
#endif
    colour = vec4(mix(first, second, along), 1.0);
}
