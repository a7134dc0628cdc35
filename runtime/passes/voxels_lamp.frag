// A lamp: one radiance on all sides.
uniform vec3 radiance;

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(min(radiance, vec3(65504.0)), 1.0);
}
