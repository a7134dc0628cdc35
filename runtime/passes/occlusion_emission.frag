// What surfaces emit, added after the shadows.
uniform vec3 emissive;

in vec3 point;
in vec3 normal;

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(min(emissive, vec3(65504.0)), 0.0);
}
