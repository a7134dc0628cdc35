// Rays through a world of cubes, in cells: twins of maths/voxel_traversal.py.
// Amanatides, Woo 1987, A Fast Voxel Traversal Algorithm for Ray Tracing.
#include "voxel_light.glsl"

// face: 0..5 for +x, -x, +y, -y, +z, -z; -1 for none. t: in lengths of the direction.
struct Hit {
    ivec3 cell;
    int face;
    float t;
    int visited;
};

bool is_inside(ivec3 cell, ivec3 size) {
    return all(greaterThanEqual(cell, ivec3(0))) && all(lessThan(cell, size));
}

vec3 inverse_of(vec3 d) {
    bvec3 still = lessThan(abs(d), vec3(1e-30));
    return mix(1.0 / mix(d, vec3(1.0), still), vec3(1e30), still);
}

// From cell to cell through faces, x before y before z at edges
Hit exact(WORLD world, ivec3 size, ivec3 cell, vec3 origin, vec3 direction) {
    vec3 inverse = inverse_of(direction);
    bvec3 forward = greaterThanEqual(direction, vec3(0.0));
    ivec3 ahead = ivec3(forward);
    ivec3 way = 2 * ahead - 1;
    Hit hit = Hit(cell, -1, 0.0, 1);
    int limit = is_inside(cell, size) ? size.x + size.y + size.z : 0;
    vec3 wall = vec3(cell + ahead);
    bool x = true;
    bool y = false;
    for (int i = 0; i < limit; ++i) {
        vec3 t = (wall - origin) * inverse;
        x = t.x <= t.y && t.x <= t.z;
        y = !x && t.y <= t.z;
        hit.t = min(t.x, min(t.y, t.z));
        vec3 taken = vec3(x, y, !x && !y);
        wall += vec3(way) * taken;
        hit.cell = ivec3(wall) - ahead;
        hit.visited++;
        if (solid_at(world, hit.cell)) {
            break;
        }
    }
    int axis = x ? 0 : y ? 1 : 2;
    hit.face = is_inside(hit.cell, size) ? 2 * axis + ahead[axis] : -1;
    return hit;
}

// The same by leaps over the empty cube around a cell; gaps: cells to the nearest solid one
Hit sphere(usampler3D gaps, ivec3 size, ivec3 cell, vec3 origin, vec3 direction) {
    vec3 inverse = inverse_of(direction);
    bvec3 forward = greaterThanEqual(direction, vec3(0.0));
    ivec3 ahead = ivec3(forward);
    Hit hit = Hit(cell, -1, 0.0, 1);
    int limit = is_inside(cell, size) ? size.x + size.y + size.z : 0;
    int gap = int(texelFetch(gaps, cell + 1, 0).x);
    int axis = 0;
    for (int i = 0; i < limit; ++i) {
        ivec3 low = hit.cell - gap + 1;
        ivec3 high = hit.cell + gap - 1;
        ivec3 wall = low + ahead * (2 * gap - 1);
        vec3 t = (vec3(wall) - origin) * inverse;
        bool x = t.x <= t.y && t.x <= t.z;
        bool y = !x && t.y <= t.z;
        hit.t = x ? t.x : y ? t.y : t.z;
        axis = x ? 0 : y ? 1 : 2;
        ivec3 place = clamp(ivec3(floor(origin + direction * hit.t)), low, high);
        // Never back: rounding may put a place before the cell
        ivec3 on = low + ahead * (hit.cell - low);
        place = clamp(place, on, on + (1 - ahead) * (hit.cell - low) + ahead * (high - hit.cell));
        hit.cell = ivec3(
            x ? wall.x - 1 + ahead.x : place.x,
            y ? wall.y - 1 + ahead.y : place.y,
            x || y ? place.z : wall.z - 1 + ahead.z
        );
        hit.visited++;
        gap = int(texelFetch(gaps, hit.cell + 1, 0).x);
        if (gap == 0) {
            break;
        }
    }
    hit.face = is_inside(hit.cell, size) ? 2 * axis + ahead[axis] : -1;
    return hit;
}

// By points a step apart, `length (i + jitter) / samples`; thin walls may be missed
Hit march(
    WORLD world, ivec3 size, ivec3 cell, vec3 origin, vec3 direction, float far, int samples,
    float jitter
) {
    Hit hit = Hit(ivec3(-1), -1, 0.0, 1);
    float pace = far / float(samples);
    bool found = false;
    for (int i = 0; i < samples; ++i) {
        float now = (float(i) + jitter) * pace;
        ivec3 place = clamp(ivec3(floor(origin + direction * now)), ivec3(-1), size);
        hit.visited++;
        if (place != cell && is_inside(place, size) && solid_at(world, place)) {
            hit.cell = place;
            found = true;
            break;
        }
    }
    // Enter the cell through the last of the planes that face the ray
    bvec3 forward = greaterThanEqual(direction, vec3(0.0));
    vec3 inverse = inverse_of(direction);
    vec3 t = (vec3(hit.cell + 1 - ivec3(forward)) - origin) * inverse;
    int axis = t.x >= t.y && t.x >= t.z ? 0 : t.y >= t.z ? 1 : 2;
    hit.face = found ? 2 * axis + ivec3(forward)[axis] : -1;
    hit.t = found ? max(t[axis], 0.0) : 0.0;
    return hit;
}

// t at which a ray from inside leaves the world
float exit_length(ivec3 size, vec3 origin, vec3 direction) {
    bvec3 forward = greaterThanEqual(direction, vec3(0.0));
    vec3 t = (vec3(size * ivec3(forward)) - origin) * inverse_of(direction);
    return min(t.x, min(t.y, t.z));
}
