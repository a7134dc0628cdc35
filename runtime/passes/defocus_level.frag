// The next coarser level of the half-size layers: means of two by two texels.
uniform sampler2D front;
uniform sampler2D blurred;
uniform sampler2D base;
uniform sampler2D radii;
uniform int finer;  // the level that is read

layout(location = 0) out vec4 front_mean;
layout(location = 1) out vec4 blurred_mean;
layout(location = 2) out vec4 base_mean;
layout(location = 3) out vec4 radii_mean;

vec4 mean(sampler2D layer) {
    ivec2 at = 2 * ivec2(gl_FragCoord.xy);
    vec4 low = texelFetch(layer, at, finer) + texelFetch(layer, at + ivec2(1, 0), finer);
    vec4 high = texelFetch(layer, at + ivec2(0, 1), finer) + texelFetch(layer, at + 1, finer);
    return 0.25 * (low + high);
}

void main() {
    front_mean = mean(front);
    blurred_mean = mean(blurred);
    base_mean = mean(base);
    radii_mean = mean(radii);
}
