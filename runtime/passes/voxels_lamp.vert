// A cube of two triangles a side, counter-clockwise from outside, counted out of 36 vertices.
uniform mat4 clip_from_world;
uniform vec3 middle;
uniform float half_side;

const int CORNER[6] = int[6](0, 1, 2, 2, 1, 3);

void main() {
    int side = gl_VertexID / 6;
    int corner = CORNER[gl_VertexID % 6];
    int axis = side % 3;
    float s = side < 3 ? 1.0 : -1.0;
    vec2 uv = vec2(float(corner & 1), float(corner >> 1)) * 2.0 - 1.0;
    vec3 at = vec3(s, s > 0.0 ? uv.x : -uv.x, uv.y);
    at = axis == 0 ? at : (axis == 1 ? at.zxy : at.yzx);
    gl_Position = clip_from_world * vec4(middle + half_side * at, 1.0);
}
