// Glyphs and plain colours of imgui.
uniform sampler2D glyphs;

in vec2 at;
in vec4 tint;

layout(location = 0) out vec4 colour;

void main() {
    colour = tint * texture(glyphs, at);
}
