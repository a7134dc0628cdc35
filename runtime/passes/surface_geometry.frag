// What later passes ask of the nearest surface of a pixel: where it is, how it lies, whose it is.
uniform int number;  // of the mesh in the scene, from 1

in vec3 point;
in vec3 normal;

#if POSITION
layout(location = AT_POSITION) out vec4 position_out;
#endif
#if NORMAL
layout(location = AT_NORMAL) out vec4 normal_out;
#endif
#if ID
layout(location = AT_ID) out int id_out;
#endif

void main() {
#if POSITION
    position_out = vec4(point, float(number));
#endif
#if NORMAL
    normal_out = vec4(normalize(gl_FrontFacing ? normal : -normal), 1.0);
#endif
#if ID
    id_out = number;
#endif
}
