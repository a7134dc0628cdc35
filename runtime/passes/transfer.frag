// Albedo / pi times the irradiance that the vertices brought, and what the surface emits.
uniform vec3 base_color;
uniform vec3 emissive;
#if TEXTURED
uniform sampler2D albedo_texture;
in vec2 uv;
#endif
#if COLOURED
in vec3 colour_of_vertex;
#endif

in vec3 irradiance;

layout(location = 0) out vec4 colour;

const float PI = 3.14159265358979;

void main() {
    vec3 albedo = base_color;
#if TEXTURED
    albedo *= texture(albedo_texture, uv).rgb;
#endif
#if COLOURED
    // Samples beyond an edge may extrapolate
    albedo *= clamp(colour_of_vertex, 0.0, 1.0);
#endif
    vec3 radiance = albedo / PI * max(irradiance, vec3(0.0)) + emissive;
    colour = vec4(min(radiance, vec3(65504.0)), 1.0);
}
