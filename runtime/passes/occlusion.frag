// What a caster leaves of the light, multiplied into the picture: four numbers a texture, two ends.
#include "occlusion.glsl"

uniform sampler2D opaque_depth;
uniform sampler3D volume;         // VOLUMES slabs along z, four components each
uniform float grid;               // voxels a side of one
uniform vec2 decode;              // factor and offset of stored values
uniform vec4 weights[2 * CHANNELS * VOLUMES];  // light over L.U, by end and channel
uniform mat3 object_from_world;
uniform vec3 object_camera;       // the camera in the object's frame
uniform vec3 longest;             // unit vector of the longest axis
uniform vec3 extent;              // half of the volume, metres of the mesh
uniform float reach;              // metres of the mesh from the middle; nothing is hidden beyond
uniform float near;
#if OWN
uniform isampler2D mesh_number;
uniform int own;
uniform vec2 ground;              // height of the camera over it, 1 where there is one
#endif

in vec3 ray;
in vec2 screen;

layout(location = 0) out vec4 colour;

float depth_at(ivec2 pixel) {
    pixel = clamp(pixel, ivec2(0), textureSize(opaque_depth, 0) - 1);
    return texelFetch(opaque_depth, pixel, 0).r;
}

#if OWN
int number_at(ivec2 pixel) {
    pixel = clamp(pixel, ivec2(0), textureSize(mesh_number, 0) - 1);
    return texelFetch(mesh_number, pixel, 0).r;
}

// Whether the caster itself is seen at height y above the ground, d before the camera; size : of a
// pixel there, in the frame of p.
bool is_own(ivec2 pixel, float y, float d, vec3 p, vec3 size) {
    // Meshes under the ground have a number too
    float error = 1e-5 * d + 2.4e-7 * d * d / near;  // of a depth of 24 bits
    if (ground.y > 0.5 && abs(y) <= error) return false;
    int here = number_at(pixel);
    if (here == own) return true;
    // Numbers are those of pixels' middles, depths those of samples: its edges lie in its box
    if (!all(lessThanEqual(abs(p), 0.501 + 0.75 * size))) return false;
    if (here == 0) return true;
    for (int i = 0; i < 9; ++i) {
        if (number_at(pixel + ivec2(i % 3 - 1, i / 3 - 1)) == own) return true;
    }
    return false;
}
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 towards = ray;
    float z = depth_at(pixel);
    vec3 right = dFdx(ray), up = dFdy(ray);
#if SAMPLED
    // Samples of the sky are left out by the depth test: an edge is taken for the pixel beside it
    if (z >= 1.0) {
        ivec2 nearest = ivec2(0);
        for (int i = 0; i < 4; ++i) {
            ivec2 way = ivec2(i - 1, i - 2) * ivec2(1 - i % 2, i % 2);
            float there = depth_at(pixel + way);
            if (there < z) {
                z = there;
                nearest = way;
            }
        }
        pixel += nearest;
        towards += right * float(nearest.x) + up * float(nearest.y);
    }
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
    vec3 place = occlusion_place(p);
    // Within a slab no filter reaches the next
    float z_texel = clamp(place.z * grid, 0.5, grid - 0.5);
    vec3 hidden[2] = vec3[2](vec3(0.0), vec3(0.0));
    for (int i = 0; i < VOLUMES; ++i) {
        vec3 at = vec3(place.xy, (float(i) * grid + z_texel) / (grid * float(VOLUMES)));
        vec4 value = texture(volume, at) * decode.x + decode.y;
        for (int end = 0; end < 2; ++end) {
            for (int c = 0; c < CHANNELS; ++c) {
                hidden[end][c] += dot(value, weights[(end * CHANNELS + c) * VOLUMES + i]);
            }
        }
    }
#if CHANNELS == 1
    hidden[0] = vec3(hidden[0].x);
    hidden[1] = vec3(hidden[1].x);
#endif
    float factor = 1.0;
#if FALLOFF
    factor = occlusion_falloff(p, extent);
#endif
    float along = clamp(dot(p, longest) + 0.5, 0.0, 1.0);
    vec3 first = clamp(1.0 - hidden[0] * factor, 0.0, 1.0);
    vec3 second = clamp(1.0 - hidden[1] * factor, 0.0, 1.0);
    colour = vec4(mix(first, second, along), 1.0);
}
