// Share of a sun that a sprite lets through to the ground; multiplied into the sun's channel.
#include "shadow.glsl"
#if LENS
#include "optics.glsl"
#endif

uniform highp sampler2DArray planes;
uniform float alpha_scale;
uniform vec2 size;  // texels of level 0
uniform vec2 pivot;
uniform float tangent;
uniform float radius;  // of the sun, radians
uniform vec4 channel;
uniform int slices;
uniform float coarsest;  // level: beyond it the rectangle would not hold the blur
#if LENS
uniform float focal_length;
uniform float f_number;
uniform float focus_distance;
#endif

in vec2 spot;
in float depth;
flat in vec3 body;
flat in vec2 extent;
flat in float layer;

layout(location = 0) out vec4 reaches;

// Coverage of the outline at metres (right, up) from the pivot.
float coverage(vec2 offset, float level) {
    vec2 uv = (pivot + vec2(offset.x * body.z, -offset.y) / body.y) / size;
    return textureLod(planes, vec3(uv, layer), level).a;
}

void main() {
    // Slices of the body that stand between this spot and the sun, within its width and its height
    float low = max(-body.x, spot.x - extent.y / tangent);
    float high = min(body.x, spot.x - extent.x / tangent);
    float step = slices > 1 ? max(high - low, 0.0) / float(slices) : 0.0;
    float first = slices > 1 ? low + 0.5 * step : 0.0;
    // One slice must filter all the height in a pixel; several share it out
    float steep = slices > 1 ? min(tangent, 1.0) : tangent;
    vec2 across = dFdx(spot) * vec2(steep, 1.0);
    vec2 down = dFdy(spot) * vec2(steep, 1.0);
    float width = max(sqrt(max(dot(across, across), dot(down, down))), 0.35 * step * max(tangent, 0.7));
#if LENS
    float coc = circle_of_confusion(depth, focal_length, f_number, focus_distance);
    width = max(width, coc * depth / focal_length * min(tangent, 1.0));
#endif
    float hidden = 0.0;
    for (int i = 0; i < slices; ++i) {
        float slice = first + float(i) * step;
        vec2 offset = shadow_lookup(spot.x, spot.y, slice, tangent);
        float soft = max(width, penumbra(offset.y, tangent, radius));
        float level = clamp(log2(soft / body.y), 0.0, coarsest);
        float cover = coverage(offset, level);
        // Turn from one side of the outline into the other across the axis, without a seam
        float side = shadow_side(spot.y, slice);
        if (side < 1.0) cover = mix(coverage(vec2(-offset.x, offset.y), level), cover, side);
        hidden = max(hidden, cover * alpha_scale);
    }
    reaches = mix(vec4(1.0), vec4(1.0 - hidden), channel);
}
