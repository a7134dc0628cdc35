// Lays the fins over the picture; depth is theirs where they are mostly opaque.
uniform sampler2D fins;
uniform sampler2D fins_nearness;

layout(location = 0) out vec4 colour;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    colour = texelFetch(fins, pixel, 0);
    if (colour.a <= 0.0) {
        discard;
    }
    gl_FragDepth = 1.0 - texelFetch(fins_nearness, pixel, 0).r;
}
