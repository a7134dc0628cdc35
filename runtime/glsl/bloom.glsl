// Twin of maths/bloom.py.

// Share of a colour that lies over the threshold
float bright_share(vec3 rgb, float threshold) {
    float largest = max(rgb.r, max(rgb.g, rgb.b));
    return largest > threshold ? 1.0 - threshold / largest : 0.0;
}
