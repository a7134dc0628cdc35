// One triangle over the whole screen; rays have length 1 along the camera's axis.
uniform mat3 world_from_ray;  // columns: right * half width, up * half height, forward

out vec3 ray;
out vec2 screen;  // 0..1, y up

void main() {
    vec2 corner = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
    screen = corner;
    ray = world_from_ray * vec3(2.0 * corner - 1.0, 1.0);
    gl_Position = vec4(2.0 * corner - 1.0, 1.0, 1.0);
}
