// The lens as a gather over the picture: twins of maths/defocus.py. Radii in pixels.
// Scatter as gather: Jimenez 2014, Next Generation Post Processing in Call of Duty: Advanced Warfare.

const float SHARP = 0.25;  // radius that changes nothing: a circle half a pixel across

// Radius of the circle of confusion, negative nearer than focus
float signed_radius(float depth, float farthest, float focus_over_near) {
    return farthest * (1.0 - focus_over_near * (1.0 - depth));
}

float depth_of_radius(float radius, float farthest, float focus_over_near) {
    return 1.0 - max(1.0 - radius / farthest, 0.0) / focus_over_near;
}

// Radius of the soft disc over whole pixels with the variance of a disc
float kernel_radius(float radius) {
    float small = clamp((radius - SHARP) / (1.0 - SHARP), 0.0, 1.0);
    return radius < 1.0 ? 0.5 + 0.316496581 * small * small : sqrt(radius * radius - 1.0 / 3.0);
}

// Share of a disc's light that a pixel gets, its rim a ramp of one texel
float disc_share(float distance, float radius, float texel) {
    float inside = clamp((radius - distance) / texel + 0.5, 0.0, 1.0);
    return inside / (3.14159265358979 * (radius * radius + texel * texel / 12.0));
}

// Share of a blur that the half-size layers hold; the window of single pixels has the rest
float layered(float radius) {
    return smoothstep(2.0, 3.0, radius);
}

// What a texel's radii are weighted by: its light, so that a small lamp keeps its own circle, and
// its coverage where it is dark
float radius_weight(vec4 layer) {
    return dot(layer, vec4(0.2126, 0.7152, 0.0722, 0.02));
}

// How surely one surface lies behind another a few pixels off, not on its slope
float behind(float radius, float than, float distance) {
    float slack = 0.25 + 0.1 * distance;
    return smoothstep(slack, 2.0 * slack, radius - than);
}
