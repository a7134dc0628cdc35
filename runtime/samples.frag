// A pixel of the opaque picture: the mean colour of its samples, and the depth of the first.
#ifdef GL_ES
// ES 3.00 reads no samples: it is for its driver to average them
layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(float(SAMPLES));
}
#else
uniform sampler2DMS colours;
uniform sampler2DMS depths;

layout(location = 0) out vec4 colour;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < SAMPLES; ++i) {
        sum += texelFetch(colours, at, i);
    }
    colour = sum / float(SAMPLES);
    gl_FragDepth = texelFetch(depths, at, 0).r;
}
#endif
