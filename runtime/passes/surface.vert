// A mesh where it stands.
uniform mat4 clip_from_mesh;
uniform mat4 world_from_mesh;
uniform mat3 world_from_normal;

in vec3 position;
in vec3 direction;
#if TEXTURED
in vec2 place;
out vec2 uv;
#endif
#if COLOURED
in vec3 tint;
out vec3 colour_of_vertex;
#endif

out vec3 point;
out vec3 normal;
// Passes that draw a mesh again test for the same depth
invariant gl_Position;

void main() {
    point = (world_from_mesh * vec4(position, 1.0)).xyz;
    normal = world_from_normal * direction;
#if TEXTURED
    uv = place;
#endif
#if COLOURED
    colour_of_vertex = tint;
#endif
    gl_Position = clip_from_mesh * vec4(position, 1.0);
}
