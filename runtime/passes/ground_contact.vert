// A square on the ground round a sprite's foot.
uniform mat4 clip_from_world;
uniform vec2 body;  // metres at scale 1: half widths of foot and crown
uniform float height;

in vec4 place;  // foot xyz, scale

out vec2 spot;  // metres from the foot
flat out vec2 widths;

void main() {
    widths = body * place.w;
    vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 2.0 - 1.0;
    spot = corner * max(3.5 * widths.x, 1.7 * widths.y);
    gl_Position = clip_from_world * vec4(place.x + spot.x, height, place.z + spot.y, 1.0);
}
