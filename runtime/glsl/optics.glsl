// The thin lens: twins of maths/optics.py. Lengths in metres.
// Potmesil, Chakravarty 1981, A Lens and Aperture Camera Model for Synthetic Image Generation.

// Blur circle on the sensor, A f |d - d_f| / (d (d_f - f)) with A = f / N; needs focus > f
float circle_of_confusion(float d, float f, float f_number, float focus) {
    return f / f_number * f / (focus - f) * abs(1.0 - focus / max(d, f));
}

float pixels(float coc, float image_height, float sensor_height) {
    return coc * image_height / sensor_height;
}

// Texels of a sprite at distance d, where a metre covers f / d metres of the sensor
float texels(float coc, float d, float f, float metres_per_texel) {
    return coc * max(d, f) / (f * metres_per_texel);
}

float lod(float coc_texels, float scale, float max_lod) {
    return min(log2(max(scale * coc_texels, 1.0)), max_lod);
}
