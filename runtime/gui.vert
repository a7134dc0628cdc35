// What imgui draws: window units from the top left.
uniform vec2 window;

in vec2 position;
in vec2 place;
in vec4 colour;

out vec2 at;
out vec4 tint;

void main() {
    at = place;
    tint = colour;
    vec2 share = position / window;
    gl_Position = vec4(2.0 * share.x - 1.0, 1.0 - 2.0 * share.y, 0.0, 1.0);
}
