// Tiles: the widest circles in each, then of all that reach it. Red: front, green: blurred base,
// blue: whether small circles are here.
#include "defocus.glsl"

uniform sampler2D front;
uniform sampler2D blurred;
uniform sampler2D radii;
uniform sampler2D tiles;
uniform int side;    // texels of a tile
uniform int spread;  // tiles; 0 reduces

layout(location = 0) out vec4 widest;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    widest = vec4(0.0);
    if (spread == 0) {
        for (int i = 0; i < side * side; ++i) {
            ivec2 at = here * side + ivec2(i % side, i / side);
            vec4 r = texelFetch(radii, at, 0);
            vec4 near = texelFetch(front, at, 0);
            vec4 far = texelFetch(blurred, at, 0);
            if (near.a > 0.0) widest.r = max(widest.r, -r.r / radius_weight(near));
            if (far.a > 0.0) widest.g = max(widest.g, abs(r.g) / radius_weight(far));
            widest.b = max(widest.b, r.a);
        }
        return;
    }
    ivec2 last = textureSize(tiles, 0) - 1;
    for (int y = -spread; y <= spread; ++y) {
        for (int x = -spread; x <= spread; ++x) {
            vec4 there = texelFetch(tiles, clamp(here + ivec2(x, y), ivec2(0), last), 0);
            // Pixels between the nearest rims of the tiles
            float away = float(2 * side * max(max(abs(x), abs(y)) - 1, 0));
            if (there.r > away - 3.0) widest.r = max(widest.r, there.r);
            if (there.g > away - 3.0) widest.g = max(widest.g, there.g);
            if (max(abs(x), abs(y)) <= 1) widest.b = max(widest.b, there.b);
        }
    }
}
