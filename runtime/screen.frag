// The finished picture, and another one left of the divider.
uniform sampler2D live;
uniform sampler2D other;
uniform float divider;  // share of the width

in vec2 screen;

layout(location = 0) out vec4 shown;

void main() {
    shown = vec4(screen.x < divider ? texture(other, screen).rgb : texture(live, screen).rgb, 1.0);
}
