// Writes alpha alone: whether a sample holds something opaque.
uniform float alpha;

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(0.0, 0.0, 0.0, alpha);
}
