// The ground that a sprite's shadow may reach: a rectangle along the sun's horizontal direction.
uniform mat4 clip_from_world;
uniform vec3 camera_position;
uniform vec3 camera_forward;
uniform vec2 away;  // unit, (x, z): where shadows point
uniform float tangent;  // of the sun's elevation
uniform vec4 reach;  // metres at scale 1: half width, lowest, highest, metres per texel
uniform float height;
uniform int slices;

in vec4 place;  // foot xyz, scale
in vec2 which;  // layer, flip +-1

out vec2 spot;  // metres along and beside
out float depth;
flat out vec3 body;  // half width, metres per texel, flip
flat out vec2 extent;  // metres: lowest, highest
flat out float layer;

void main() {
    vec4 size = reach * place.w;
    float margin = slices > 1 ? size.x : 0.0;
    float start = min(size.y / tangent, 0.0) - margin;
    float end = max(size.z / tangent, 0.0) + margin;
    spot.x = mix(start, end, float(gl_VertexID & 1));
    spot.y = mix(-size.x, size.x, float(gl_VertexID >> 1));
    body = vec3(size.x, size.w, which.y);
    extent = size.yz;
    layer = which.x;
    vec2 level = place.xz + away * spot.x + vec2(-away.y, away.x) * spot.y;
    vec3 point = vec3(level.x, height, level.y);
    depth = dot(point - camera_position, camera_forward);
    gl_Position = clip_from_world * vec4(point, 1.0);
}
