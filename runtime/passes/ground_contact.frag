// Share of the sky, and close by of the suns, that reaches the ground round a foot.
#include "shadow.glsl"

uniform float cover;

in vec2 spot;
flat in vec2 widths;

layout(location = 0) out vec4 reaches;

void main() {
    float distance = length(spot);
    float sky = 1.0 - contact(distance, widths.x, widths.y, cover);
    float sun = 1.0 - contact(distance, widths.x, 0.0, cover);
    reaches = vec4(sun, sun, sun, sky);
}
