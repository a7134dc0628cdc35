// Faces of cubes: albedo / pi times the light of their texels, and what they emit.
#include "voxels_cells.glsl"

uniform sampler2D lightmap;
uniform float glow;  // 1: with what is emitted

in vec3 point;
flat in vec3 normal;
flat in ivec3 first;
flat in ivec3 last;
in vec2 texel;

layout(location = 0) out vec4 colour;

const float PI = 3.14159265;

void main() {
    ivec3 behind = cell_behind(point, normal, first, last);
    int row = row_at(behind);
#if MOVING
    // Faces of every state are laid out: only those of now are there
    if (row == 0 || row_at(behind + ivec3(normal)) > 0) {
        discard;
    }
#endif
#if EMISSION
    colour = vec4(min(of_row(emission, row), vec3(65504.0)), 0.0);
#else
    vec4 light = texture(lightmap, texel);
    vec3 radiance = of_row(albedo, row) / PI * light.rgb + glow * of_row(emission, row);
    colour = vec4(min(radiance, vec3(65504.0)), 1.0);
#endif
}
