// Fins along outlines; maths/silhouette.py has the twin.
const float FIN_SEAM = 1.5;  // pixels

// Share of a fin's colour laid over a pixel that the polygon covers already in part: pixels past the
// polygon's edge and past the outline, pixels over which the fin ends, half of the pixel's extent
// across the edge, and the most over whole pixels within.
float fin_alpha(float inside, float beyond, float fade, float half_extent, float seam) {
    float whole = 2.0 * half_extent;
    float covered = clamp(0.5 - inside / whole, 0.0, 1.0);
    float wanted = 1.0 - clamp((beyond + 0.5 * whole) / (whole + fade), 0.0, 1.0);
    float over = clamp((wanted - covered) / max(1.0 - covered, 1e-6), 0.0, 1.0);
    float within = clamp(1.0 + (inside + half_extent) / FIN_SEAM, 0.0, 1.0);
    return covered < 1.0 ? over * min(2.0 * seam, 1.0) : seam * within;
}
