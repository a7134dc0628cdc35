// Faces of a world of cubes, as they are laid out.
uniform mat4 clip_from_world;

in vec3 position;
in vec3 direction;
in vec2 place;
in vec3 lowest;   // cells behind the rectangle
in vec3 highest;

out vec3 point;
flat out vec3 normal;
out vec2 texel;
flat out ivec3 first;
flat out ivec3 last;
// Faces are drawn again for what they emit, and must pass the same depth
invariant gl_Position;

void main() {
    point = position;
    normal = direction;
    texel = place;
    first = ivec3(lowest);
    last = ivec3(highest);
    gl_Position = clip_from_world * vec4(position, 1.0);
}
