// A mesh where it stands, and the irradiance of each vertex: its numbers dotted with the light's.
uniform mat4 clip_from_mesh;
uniform vec2 decode;                // factor and offset of stored numbers
uniform vec3 box_centre;
uniform vec3 box_scale;             // makes the mesh's box +-1 about its centre
uniform vec3 light[4 * 4 * QUADS];  // constants of each number at the centre, slopes by x, y, z

in vec3 position;
in vec4 transfer_0;
#if QUADS > 1
in vec4 transfer_1;
#endif
#if QUADS > 2
in vec4 transfer_2;
#endif
#if QUADS > 3
in vec4 transfer_3;
#endif
#if QUADS > 4
in vec4 transfer_4;
#endif
#if QUADS > 5
in vec4 transfer_5;
#endif
#if QUADS > 6
in vec4 transfer_6;
#endif
#if QUADS > 7
in vec4 transfer_7;
#endif
#if TEXTURED
in vec2 place;
out vec2 uv;
#endif
#if COLOURED
in vec3 tint;
out vec3 colour_of_vertex;
#endif

out vec3 irradiance;  // W/m^2; bands left out may make it negative

vec3 sum(vec4 value, int i) {
    return value.x * light[i] + value.y * light[i + 1] + value.z * light[i + 2]
        + value.w * light[i + 3];
}

vec3 lit(vec4 stored, int i, vec3 at) {
    vec4 value = stored * decode.x + decode.y;
    return sum(value, i) + at.x * sum(value, i + 4 * QUADS) + at.y * sum(value, i + 8 * QUADS)
        + at.z * sum(value, i + 12 * QUADS);
}

// Passes that draw a mesh again test for the same depth
invariant gl_Position;

void main() {
    vec3 at = (position - box_centre) * box_scale;
    irradiance = lit(transfer_0, 0, at);
#if QUADS > 1
    irradiance += lit(transfer_1, 4, at);
#endif
#if QUADS > 2
    irradiance += lit(transfer_2, 8, at);
#endif
#if QUADS > 3
    irradiance += lit(transfer_3, 12, at);
#endif
#if QUADS > 4
    irradiance += lit(transfer_4, 16, at);
#endif
#if QUADS > 5
    irradiance += lit(transfer_5, 20, at);
#endif
#if QUADS > 6
    irradiance += lit(transfer_6, 24, at);
#endif
#if QUADS > 7
    irradiance += lit(transfer_7, 28, at);
#endif
#if TEXTURED
    uv = place;
#endif
#if COLOURED
    colour_of_vertex = tint;
#endif
    gl_Position = clip_from_mesh * vec4(position, 1.0);
}
