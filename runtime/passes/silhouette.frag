// A fin: the colour just inside the polygon's edge, as opaque as the round outline leaves it to be.
#include "silhouette.glsl"

uniform sampler2D opaque_colour;
uniform sampler2D opaque_depth;

in vec3 past;  // the outline; pixels over which the fin ends; share within the polygon
in float nearness;
flat in vec3 limits;  // nearness of the nearest of the face, and from and to which it is the mesh
flat in vec4 edge;    // a point of it, and outwards

layout(location = 0) out vec4 fin;
layout(location = 1) out float fin_nearness;

const float NEARER = 1.001;  // of two depths that count as one

float nearness_at(ivec2 pixel) {
    return 1.0 - texelFetch(opaque_depth, pixel, 0).r;
}

// Colour of the mesh about a place, and how much of what lies there is the mesh.
vec4 colour_at(vec2 place) {
    ivec2 last = textureSize(opaque_colour, 0) - 1;
    vec2 corner = floor(place - 0.5), share = place - 0.5 - corner;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        ivec2 step = ivec2(i & 1, i >> 1);
        ivec2 pixel = clamp(ivec2(corner) + step, ivec2(0), last);
        vec2 part = mix(1.0 - share, share, vec2(step));
        float here = nearness_at(pixel);
        float own = here >= limits.y && here <= limits.z ? part.x * part.y : 0.0;
        sum += own * vec4(texelFetch(opaque_colour, pixel, 0).rgb, 1.0);
    }
    return vec4(sum.rgb / max(sum.a, 1e-4), sum.a);
}

void main() {
    float half_extent = 0.5 * (abs(edge.z) + abs(edge.w));
    float inside = dot(gl_FragCoord.xy - edge.xy, edge.zw);
    float alpha = fin_alpha(inside, past.x, past.y, half_extent, past.z);
    float opaque = nearness_at(ivec2(gl_FragCoord.xy));
    // The depth of a pixel on the edge may be the mesh's own
    float hides = NEARER * (inside < 2.0 * half_extent ? max(limits.x, nearness) : nearness);
    if (alpha <= 0.0 || opaque > hides) {
        discard;
    }
    // All four pixels lie within the polygon
    vec4 found = colour_at(gl_FragCoord.xy - (inside + 3.0 * half_extent + FIN_SEAM * past.z) * edge.zw);
    alpha *= clamp(4.0 * found.a, 0.0, 1.0);
    fin = vec4(found.rgb * alpha, alpha);
    fin_nearness = alpha >= 0.5 ? max(nearness, opaque) : opaque;
}
