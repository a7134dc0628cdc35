"""Where to look at the light of a world of cubes for many things that stand in it. Units are cells.

Few places are looked at themselves; of many, the corners of a grid are that lie around them, as
fine as a bound on their number allows. Corners in walls move to the nearest gap; those behind a
wall do not count, and what sees none looks from where it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST = 32
"""Points that are not those of things themselves, at most."""
FINEST = 2.0
"""Spacing of the finest grid, cells."""
FAR = 0.1
"""Weight that a corner of the grid has at least: less than an eighth, so that some always do."""
STEP = 2.0**0.25
"""A coarser grid over the next finer one."""
LOOKS = 16
"""Places on the way to a corner that are looked at for walls."""
APART = np.indices((2, 2, 2)).reshape(3, 8).T
NEAREST = np.array(sorted(np.ndindex(5, 5, 5), key=lambda p: sum((i - 2) ** 2 for i in p))) - 2


@dataclass(frozen=True, eq=False)
class Places:
    """Where to look: points (m, 3), metres; for n sprites numbers (n, k) of points and weights (n,
    k), which sum to 1."""

    points: Array
    number: NDArray[np.int64]
    weight: Array

    def between(self, values: Array) -> Array:
        """Return values (n, ...) at the sprites of values (m, ...) at the points."""
        if self.number.shape[1] == 1:
            return np.asarray(values[self.number[:, 0]])
        flat = values.reshape(len(values), math.prod(values.shape[1:]))
        found = np.zeros((len(self.number), flat.shape[1]))
        for k in range(self.number.shape[1]):
            found += self.weight[:, k, None] * flat[self.number[:, k]]
        return found.reshape(len(found), *values.shape[1:])


def spread(
    places: Array, solid: NDArray[np.bool_], every: Array | None = None, most: int = MOST
) -> Places:
    """Return the points for things at places (n, 3), all in cells. solid : (nz, ny, nx).

    every : (m, 3) places of all things by which the grid is chosen, of which `places` may be some:
    then what is found at one place does not ask which others are. `places` themselves unless given.
    """
    free = freed(places, solid)
    if every is None:
        every = places
    if len(every) <= most:
        n = len(places)
        return Places(free, np.arange(n)[:, None], np.ones((n, 1)))
    spacing = FINEST
    while len(_corners(every, spacing)[0]) > max(8, most):
        spacing *= STEP
    nodes, number, share = _corners(free, spacing)
    points = freed(nodes * spacing + 0.5, solid)
    open_to = ~is_solid(points, solid)[number] & clear(free, points[number], solid)
    weight = share * open_to
    _look_from_themselves(free, points, number, weight)
    kept, number = np.unique(number, return_inverse=True)
    every = np.concatenate([points, free])
    return Places(
        every[kept], number.reshape(weight.shape), weight / weight.sum(axis=1, keepdims=True)
    )


def _corners(places: Array, spacing: float) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return the corners (m, 3) of a grid that count for places (n, 3), and which do for each and
    by how much, both (n, 8)."""
    base = np.floor((places - 0.5) / spacing).astype(np.int64)
    inside = ((places - 0.5) / spacing - base)[:, None]
    share = np.where(APART == 1, inside, 1.0 - inside).prod(axis=2)
    # Corners of little weight are left out, smoothly: the rest are nearer by
    share = np.maximum(share - FAR, 0.0)
    used = share > 0
    corners, row = np.unique((base[:, None] + APART)[used], axis=0, return_inverse=True)
    number = np.zeros(share.shape, np.int64)
    number[used] = row.reshape(-1)
    return corners, number, share


def _look_from_themselves(
    free: Array, points: Array, number: NDArray[np.int64], weight: Array
) -> None:
    """Let sprites (n, 3) that see none of the points (m, 3) have points m + i of their own, or
    that of a neighbour; at most `MOST` more. Changes numbers and weights (n, 8) in place."""
    alone = np.flatnonzero(~weight.any(axis=1))
    if not len(alone):
        return
    _, first, near = np.unique(
        np.floor(free[alone] / FINEST), axis=0, return_index=True, return_inverse=True
    )
    step = -(-len(first) // MOST)
    own = alone[first[near.reshape(-1) // step * step]]
    number[alone], weight[alone] = (len(points) + own)[:, None], 1.0 / number.shape[1]


def freed(places: Array, solid: NDArray[np.bool_]) -> Array:
    """Return places (n, 3); those in a wall are moved to the nearest empty cell within two."""
    found = places.copy()
    for i in np.flatnonzero(is_solid(places, solid)):
        near = np.floor(places[i]) + NEAREST + 0.5
        empty = near[~is_solid(near, solid)]
        if len(empty):
            found[i] = empty[np.argmin(np.sum((empty - places[i]) ** 2, axis=1))]
    return found


def clear(places: Array, points: Array, solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell from which places (n, 3) points (n, k, 3) are seen, by looking at places between."""
    found = np.ones(points.shape[:2], np.bool_)
    for part in (np.arange(LOOKS) + 0.5) / LOOKS:
        found &= ~is_solid(places[:, None] + part * (points - places[:, None]), solid)
    return found


def is_solid(places: Array, solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which places (..., 3), in cells, lie in solid cells; none outside."""
    cell = np.floor(places).astype(np.int64)
    inside = np.all((cell >= 0) & (cell < solid.shape[::-1]), axis=-1)
    x, y, z = np.moveaxis(np.where(inside[..., None], cell, 0), -1, 0)
    return np.asarray(solid[z, y, x] & inside)
