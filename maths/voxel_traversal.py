"""Rays through a grid of cubes, by cells, by fixed steps, and by a field of distances.

Space is counted in cells: cell (x, y, z) covers [x, x + 1) and so on. Grids are (nz, ny, nx), True
for solid. A ray begins in a cell that is given, for a place on a face belongs to two; its own cell
counts as empty. Rays leave the world at the sides of the grid. Faces count +x, -x, +y, -y, +z, -z.

`exact` goes from cell to cell through faces, one axis at a time (x before y before z where a ray
meets an edge or a corner): so walls of cells that touch by edges or corners alone stop every ray,
and 1 + sum |change of cell| cells are visited. `march` looks at points a step apart. `sphere` leaps
over the empty cube around a cell. Each has a twin in `runtime/glsl/traverse.glsl`; arithmetic is
that of the arrays' type, so float32 rounds as there.

References
----------
Amanatides, Woo 1987, A Fast Voxel Traversal Algorithm for Ray Tracing.
Cohen, Sheffer 1994, Proximity clouds - an acceleration technique for 3D grid traversal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
Real = NDArray[Any]

MISS, INSIDE = -1, 6
"""In place of a face: nothing was hit; the ray began in a solid cell."""
FAR = 1e30
"""Instead of 1 / 0: where a ray does not move along an axis, it never meets the next cell."""
REACH = 15
"""Largest distance in cells that a field tells."""


@dataclass(frozen=True, eq=False)
class Hits:
    """What rays met. cell : (m, 3) x, y, z of the cell, outside of the grid for a miss. face :
    (m,) that the ray came in by, MISS or INSIDE. t : (m,) along the ray, in lengths of its
    direction. visited : (m,) cells looked at, the first one and the outside included."""

    cell: Indices
    face: NDArray[np.int8]
    t: Real
    visited: Indices


def exact(solid: Mask, cell: ArrayLike, origin: ArrayLike, direction: ArrayLike) -> Hits:
    """Follow rays from cell to cell.

    cell : (m, 3) whole, where rays begin.  origin, direction : (m, 3) float32 or float64, finite,
    directions of any length above 0.
    Raises ValueError for a direction of length 0 and for numbers that are not finite.
    """
    return sphere(np.where(solid, 0, 1).astype(np.uint8), cell, origin, direction)


def sphere(
    distance: NDArray[np.uint8], cell: ArrayLike, origin: ArrayLike, direction: ArrayLike
) -> Hits:
    """Follow rays by leaps over empty cubes. distance : from `distances`; the others as `exact`."""
    at, o, d, inverse = _rays(cell, origin, direction)
    size = np.array(distance.shape[::-1])
    t, face = np.zeros(len(d), d.dtype), np.full(len(d), MISS, np.int8)
    visited = np.ones(len(d), np.int64)
    outside = ~_inside(at, size)
    gap = np.where(outside, 1, _look(distance, at, size)).astype(np.int64)
    face[gap == 0] = INSIDE
    forward = d >= 0
    rows = np.flatnonzero((gap > 0) & ~outside)
    while len(rows):
        here, leap, ahead = at[rows], gap[rows, None], forward[rows]
        # The empty cube reaches gap - 1 cells beyond the cell on every side
        wall = np.where(ahead, here + leap, here - leap + 1)
        times = (wall.astype(d.dtype) - o[rows]) * inverse[rows]
        axis = np.argmin(times, axis=1)
        k = np.arange(len(rows))
        now = times[k, axis]
        if leap.max() > 1:
            place = np.floor(o[rows] + d[rows] * now[:, None]).astype(np.int64)
            moved = np.clip(place, here - leap + 1, here + leap - 1)
            # Never back: rounding may put a place before the cell
            moved = np.where(ahead, np.maximum(moved, here), np.minimum(moved, here))
            here = np.where(leap > 1, moved, here)
        here[k, axis] = np.where(ahead[k, axis], wall[k, axis], wall[k, axis] - 1)
        at[rows], t[rows] = here, now
        visited[rows] += 1
        inside = _inside(here, size)
        gap[rows] = np.where(inside, _look(distance, here, size), 1)
        hit = inside & (gap[rows] == 0)
        face[rows[hit]] = (2 * axis + forward[rows, axis])[hit]
        rows = rows[inside & ~hit]
    return Hits(at, face, t, visited)


def march(
    solid: Mask,
    cell: ArrayLike,
    origin: ArrayLike,
    direction: ArrayLike,
    length: ArrayLike,
    samples: int,
    jitter: ArrayLike,
) -> Hits:
    """Look at points along rays, t = length (i + jitter) / samples for i = 0..samples - 1.

    length : (m,) in t.  jitter : (m,) in [0, 1), one number a ray: so a wall whose chord is c is
    missed with chance max(0, 1 - c / step).  Face and t are those where the ray came into the cell.
    The others as `exact`.
    """
    at, o, d, inverse = _rays(cell, origin, direction)
    size = np.array(solid.shape[::-1])
    share = np.asarray(jitter, d.dtype)
    step = np.asarray(length, d.dtype) / d.dtype.type(samples)
    t, face = np.zeros(len(d), d.dtype), np.full(len(d), MISS, np.int8)
    visited, found = np.ones(len(d), np.int64), np.zeros(len(d), np.bool_)
    first = at.copy()
    for i in range(samples):
        now = (d.dtype.type(i) + share) * step
        place = np.floor(o + d * now[:, None]).astype(np.int64)
        full = _inside(place, size) & (_look(solid, place, size) != 0)
        full &= ~found & np.any(place != first, axis=1)
        visited += ~found
        at[full] = place[full]
        found |= full
    # Enter the cell through the nearest of the planes that face the ray
    wall = np.where(d >= 0, at, at + 1).astype(d.dtype)
    with np.errstate(over="ignore"):
        times = (wall - o) * inverse
    axis = np.argmax(times, axis=1)
    entered = 2 * axis + (d[np.arange(len(d)), axis] >= 0)
    face[found] = entered[found]
    t[found] = np.maximum(times[np.arange(len(d)), axis], 0)[found]
    at[~found] = -1
    return Hits(at, face, t, visited)


def distances(solid: Mask, reach: int = REACH) -> NDArray[np.uint8]:
    """Chebyshev distance (nz, ny, nx) of each cell to the nearest solid one, at most `reach`.

    0 in solid cells; cells nearer than that many are empty. The sides of the grid are no walls.
    Raises ValueError for a reach outside of 1 to 255.

    >>> distances(np.array([[[True, False, False, False]]]), 2).tolist()
    [[[0, 1, 2, 2]]]
    """
    if not 1 <= reach <= 255:
        raise ValueError(f"A field of distances reaches 1 to 255 cells, not {reach}.")
    near = np.array(solid, np.bool_)
    found = np.zeros(near.shape, np.uint8)
    for _ in range(reach):
        found += ~near
        # Grow by one cell on every side, axis by axis
        for axis in range(3):
            grown = near.copy()
            low, high = [slice(None)] * 3, [slice(None)] * 3
            low[axis], high[axis] = slice(None, -1), slice(1, None)
            grown[tuple(low)] |= near[tuple(high)]
            grown[tuple(high)] |= near[tuple(low)]
            near = grown
    return found


def exit_length(size: ArrayLike, origin: ArrayLike, direction: ArrayLike) -> Real:
    """Return t (m,) at which rays from inside leave a grid of `size` cells (nx, ny, nz)."""
    _, o, d, inverse = _rays(np.zeros_like(np.asarray(origin), np.int64), origin, direction)
    wall = np.where(d >= 0, np.asarray(size), 0).astype(d.dtype)
    return np.asarray(np.min((wall - o) * inverse, axis=1))


def _rays(
    cell: ArrayLike, origin: ArrayLike, direction: ArrayLike
) -> tuple[Indices, Real, Real, Real]:
    """Check rays; start cells, origins, directions and their inverses, FAR for 0."""
    o, d = np.asarray(origin), np.asarray(direction)
    kind = np.result_type(o, d, np.float32)
    o, d = o.astype(kind), d.astype(kind)
    if not np.all(np.isfinite(o)) or not np.all(np.isfinite(d)):
        raise ValueError("Rays have finite origins and directions.")
    if not np.all(np.any(d != 0, axis=-1)):
        raise ValueError("The direction of a ray has a length above 0.")
    # What is slower than 1 / FAR does not move
    still = np.abs(d) < 1 / FAR
    inverse = np.where(still, kind.type(FAR), 1 / np.where(still, kind.type(1), d))
    return np.array(cell, np.int64), o, np.where(still, 0, d).astype(kind), inverse


def _inside(cell: Indices, size: Indices) -> Mask:
    return np.asarray(np.all((cell >= 0) & (cell < size), axis=-1))


def _look(grid: NDArray[Any], cell: Indices, size: Indices) -> NDArray[Any]:
    """Read a grid at cells (m, 3), clamped to it."""
    x, y, z = np.clip(cell, 0, size - 1).T
    return np.asarray(grid[z, y, x])
