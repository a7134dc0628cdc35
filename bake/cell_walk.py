"""Rays from cell to cell through a grid of cubes: exact, slow, and unable to slip through.

Amanatides, Woo 1987, *A Fast Voxel Traversal Algorithm for Ray Tracing*. Each step crosses one side
of a cell, so that cells which touch along an edge alone stop what would pass between them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def first_solid(
    solid: NDArray[np.bool_], origins: Array, directions: Array
) -> tuple[Indices, NDArray[np.int8], Array]:
    """Return the first solid cell that rays enter.

    solid : (nz, ny, nx).  origins : (k, 3) x, y, z in cells, inside the grid; the cell that holds
    one counts as empty.  directions : (k, 3), not 0. Returns flat indices (k,) into the grid, -1
    for none; the faces (k,) int8 they are entered by, 2 axis + (1 if it looks down the axis), -1
    for none; and distances (k,), in lengths of the direction. Raises ValueError for a ray without a
    direction.
    """
    if not np.all(np.abs(directions).max(axis=1, initial=0.0) > 0):
        raise ValueError("A ray needs a direction.")
    sides = np.array(solid.shape[::-1])
    stride = np.array([1, sides[0], sides[0] * sides[1]])
    k = len(origins)
    cell, face, distance = np.full(k, -1), np.full(k, -1, np.int8), np.full(k, np.inf)
    at = np.clip(np.floor(origins).astype(np.int64), 0, sides - 1)
    step = np.sign(directions).astype(np.int64)
    # An axis along which the ray stands still is never crossed
    slope = np.where(directions == 0, 1.0, directions)
    per_cell = np.where(directions == 0, np.inf, np.abs(1 / slope))
    ahead = np.where(step > 0, at + 1 - origins, origins - at)
    next_side = np.where(directions == 0, np.inf, np.maximum(ahead, 0) * np.abs(1 / slope))
    alive = np.arange(k)
    while len(alive):
        axis = np.argmin(next_side[alive], axis=1)
        t = next_side[alive, axis]
        moved = step[alive, axis]
        at[alive, axis] += moved
        next_side[alive, axis] += per_cell[alive, axis]
        inside = (at[alive, axis] >= 0) & (at[alive, axis] < sides[axis])
        alive, axis, t, moved = alive[inside], axis[inside], t[inside], moved[inside]
        flat = at[alive] @ stride
        hit = solid.ravel()[flat]
        ended = alive[hit]
        cell[ended], distance[ended] = flat[hit], t[hit]
        face[ended] = 2 * axis[hit] + (moved[hit] > 0)
        alive = alive[~hit]
    return cell, face, distance
