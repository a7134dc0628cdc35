"""The rectangles that the exposed faces of a grid of cubes are merged to.

Faces count 2 axis + (1 if they look down the axis): +x, -x, +y, -y, +z, -z. The two axes along a
face follow its own: x has (y, z), y has (z, x), z has (x, y).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]

RECTANGLE = np.dtype(
    [
        *((name, "<i4") for name in ("axis", "sign", "plane", "u", "v")),
        *((name, "<i4") for name in ("width", "height", "x", "y", "body")),
    ]
)
"""One rectangle. axis : 0..2.  sign : +1 or -1.  plane : of the grid, along the axis.  u, v :
lowest cell along the two other axes.  width, height : cells along u and v.  x, y : atlas texel of
its first interior one.  body : 0, the world itself."""
NONE = 0xFFFF
"""In `pages`: the cell has no such face."""


def face_number(rectangles: NDArray[Any]) -> NDArray[Any]:
    """Return 2 axis + (1 where the sign is -1) of rectangles (k,)."""
    return np.asarray(2 * rectangles["axis"] + (rectangles["sign"] < 0))


def flat_cells(
    rectangles: NDArray[Any], cu: Indices, cv: Indices, grid: tuple[int, int, int]
) -> Indices:
    """Return flat indices (k,) into (nz, ny, nx) of the solid cells behind places of rectangles.

    rectangles : (k,).  cu, cv : (k,) cells along u and v from the rectangle's first.
    """
    axis = rectangles["axis"].astype(np.int64)
    stride = np.array([1, grid[0], grid[0] * grid[1]])
    depth = rectangles["plane"].astype(np.int64) - (rectangles["sign"] > 0)
    across = (rectangles["u"] + cu) * stride[(axis + 1) % 3]
    return np.asarray(depth * stride[axis] + across + (rectangles["v"] + cv) * stride[axis - 1])


def cell_faces(
    rectangles: NDArray[Any], grid: tuple[int, int, int]
) -> tuple[Indices, Indices, Indices, Indices]:
    """List all faces of cells: row of the rectangle, flat index of the solid cell, cell along u and
    v from the rectangle's first, each (F,)."""
    width, height = (rectangles[side].astype(np.int64) for side in ("width", "height"))
    rows, along = spread(width * height)
    cv, cu = np.divmod(along, width[rows])
    return rows, flat_cells(rectangles[rows], cu, cv, grid), cu, cv


def spread(counts: Indices) -> tuple[Indices, Indices]:
    """Return for items that have `counts` (k,) parts: item and number within it of each part.

    >>> [part.tolist() for part in spread(np.array([2, 0, 1]))]
    [[0, 0, 2], [0, 1, 0]]
    """
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(counts) else 0
    rows = np.repeat(np.arange(len(counts)), counts)
    return rows, np.arange(total) - np.repeat(ends - counts, counts)
