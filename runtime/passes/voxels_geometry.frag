// What later passes ask of the nearest face of a pixel: its number is of no mesh, and not of nothing.
#include "voxels_cells.glsl"

in vec3 point;
flat in vec3 normal;
flat in ivec3 first;
flat in ivec3 last;

#if POSITION
layout(location = AT_POSITION) out vec4 position_out;
#endif
#if NORMAL
layout(location = AT_NORMAL) out vec4 normal_out;
#endif
#if ID
layout(location = AT_ID) out int id_out;
#endif

void main() {
#if MOVING
    ivec3 behind = cell_behind(point, normal, first, last);
    if (row_at(behind) == 0 || row_at(behind + ivec3(normal)) > 0) {
        discard;
    }
#endif
#if POSITION
    position_out = vec4(point, 0.0);
#endif
#if NORMAL
    normal_out = vec4(normal, 1.0);
#endif
#if ID
    id_out = -1;
#endif
}
