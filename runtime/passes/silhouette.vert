// Fins where the picture needs them: places are pixels from the lower left.
uniform vec2 size;

in vec2 place;
in float beyond;
in float fade;
in vec4 depths;
in vec4 chord;
in float seam;

out vec3 past;  // the outline; pixels over which the fin ends; share within the polygon
out float nearness;
flat out vec3 limits;
flat out vec4 edge;

void main() {
    past = vec3(beyond, fade, seam);
    nearness = depths.x;
    limits = depths.yzw;
    edge = chord;
    gl_Position = vec4(2.0 * place / size - 1.0, 0.0, 1.0);
}
