"""The faces of a world of cubes, merged to rectangles and packed into an atlas.

A face is exposed where a solid cell has an empty one, or the outside of the grid, in front of it.
For a world that changes, faces exposed at any time get texels. Merging joins runs of cells along
one axis of the face, then equal runs along the other; both orders are tried, plane by plane, and
the one with fewer rectangles stays. Packing is by shelves of falling height (Coffman et al. 1980,
*Performance Bounds for Level-Oriented Two-Dimensional Packing Algorithms*: next fit).

Memory: a dozen bytes a cell, and some 200 a face at the peak.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.lightmap_faces import Faces
from formats.lightmap_rectangles import RECTANGLE

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

LONGEST = 128
"""Texels along a side of a rectangle: longer ones are split, so that shelves fill up."""
MAX_SIDE = 16384
"""Texels along a side of an atlas."""
SIDES = tuple((axis, sign) for axis in range(3) for sign in (1, -1))
MAX_TEXELS = 64
"""Largest number of texels along a cell side."""


def layout(
    cells: NDArray[Any] | Iterable[NDArray[Any]],
    *,
    texels: int,
    cell_size: float = 1.0,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    below: bool = False,
) -> Faces:
    """Lay out the exposed faces of a grid.

    cells : (nz, ny, nx), 0 for empty; or such states of one world, one at a time.  texels : along a
    cell side.  below : give texels to the lowest side of the world, too.
    Raises InputError where nothing is exposed, states differ in shape, or an atlas of MAX_SIDE a
    side does not hold all texels.
    """
    if not 1 <= texels <= MAX_TEXELS:
        raise InputError("lightmap", "texels", texels, f"choose from 1 to {MAX_TEXELS}")
    states = [cells] if isinstance(cells, np.ndarray) else cells
    shapes: set[tuple[int, ...]] = set()

    def solids() -> Iterator[Mask]:
        for state in states:
            shapes.add(np.shape(state))
            if len(shapes) > 1 or np.ndim(state) != 3:
                raise InputError("lightmap", "cells", sorted(shapes), "give states of one 3D shape")
            yield np.asarray(state) != 0
        if not shapes:
            raise InputError("lightmap", "cells", "no state", "give one at least")

    rectangles = merged(solids(), max(1, LONGEST // texels), below=below)
    if not len(rectangles):
        raise InputError("lightmap", "cells", "nothing is exposed", "give a world with solid cells")
    size = pack(rectangles, texels)
    nz, ny, nx = next(iter(shapes))
    return Faces(texels, size, (nx, ny, nz), cell_size, origin, rectangles)


def merged(solids: Iterable[Mask], longest: int, *, below: bool) -> NDArray[Any]:
    """Return rectangles (R,) that cover each exposed face once, x and y still 0.

    solids : states (nz, ny, nx), one at a time.  longest : cells along a side.
    """
    exposed: dict[tuple[int, int], Mask] = {}
    for solid in solids:
        for axis, sign in SIDES:
            found = exposed_faces(solid, axis, sign)
            before = exposed.setdefault((axis, sign), found)
            np.logical_or(before, found, out=before)
    if not below:
        exposed[1, -1][:, 0] = False
    parts = []
    for (axis, sign), cells in exposed.items():
        # To (plane, v, u): arrays are (z, y, x), x has (y, z), y has (z, x), z has (x, y)
        order = (2 - axis, 2 - (axis + 2) % 3, 2 - (axis + 1) % 3)
        parts.append(_of_planes(cells.transpose(order), axis, sign, longest))
    return np.concatenate(parts)


def exposed_faces(solid: Mask, axis: int, sign: int) -> Mask:
    """Tell which cells (nz, ny, nx) are solid with nothing in front along an axis, 0 for x."""
    along = 2 - axis
    exposed = solid.copy()
    low = tuple(slice(None, -1) if i == along else slice(None) for i in range(3))
    high = tuple(slice(1, None) if i == along else slice(None) for i in range(3))
    here, front = (low, high) if sign > 0 else (high, low)
    exposed[here] &= ~solid[front]
    return exposed


def _of_planes(exposed: Mask, axis: int, sign: int, longest: int) -> NDArray[Any]:
    """Merge exposed faces (planes, v, u), in the order with fewer rectangles, plane by plane."""
    plane, v, u, height, width = _stacked(exposed, longest)
    plane2, u2, v2, width2, height2 = _stacked(exposed.transpose(0, 2, 1), longest)
    count, count2 = (np.bincount(p, minlength=len(exposed)) for p in (plane, plane2))
    first, second = (count <= count2)[plane], (count > count2)[plane2]
    found = np.zeros(int(first.sum() + second.sum()), RECTANGLE)
    pairs = {
        "plane": (plane + (sign > 0), plane2 + (sign > 0)),
        "u": (u, u2),
        "v": (v, v2),
        "width": (width, width2),
        "height": (height, height2),
    }
    for name, (one, other) in pairs.items():
        found[name] = np.concatenate([one[first], other[second]])
    found["axis"], found["sign"] = axis, sign
    return found


def _stacked(mask: Mask, longest: int) -> tuple[Indices, Indices, Indices, Indices, Indices]:
    """Join runs along the last axis of a mask (p, b, a), then equal runs along b.

    Returns p, b, a of the first cell, then cells along b and a.
    """
    planes, rows, columns = mask.shape
    # An empty cell after each row ends its runs
    padded = np.zeros((planes, rows, columns + 1), np.bool_)
    padded[..., :-1] = mask
    flat = padded.ravel()
    change = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    if flat[0]:
        change = np.concatenate([[0], change])
    start, length = _split(change[::2], change[1::2] - change[::2], longest)
    row, a = np.divmod(start, columns + 1)
    p, b = np.divmod(row, rows)
    order = np.lexsort((b, length, a, p))
    p, b, a, length = p[order], b[order], a[order], length[order]
    new = np.ones(len(p), np.bool_)
    new[1:] = (p[1:] != p[:-1]) | (a[1:] != a[:-1]) | (length[1:] != length[:-1])
    new[1:] |= b[1:] != b[:-1] + 1
    first = np.flatnonzero(new)
    number, high = _split(first, np.diff(np.append(first, len(p))), longest)
    return p[number], b[number], a[number], high, length[number]


def _split(start: Indices, length: Indices, longest: int) -> tuple[Indices, Indices]:
    """Cut intervals into parts of at most `longest`; starts and lengths."""
    parts = -(-length // longest)
    ends = np.cumsum(parts)
    part = np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - parts, parts)
    rest = np.repeat(length, parts) - part * longest
    return np.repeat(start, parts) + part * longest, np.minimum(rest, longest)


def pack(rectangles: NDArray[Any], texels: int) -> tuple[int, int]:
    """Set x and y of rectangles and return the atlas's (width, height); InputError if too large."""
    widths, heights = (rectangles[side] * texels + 2 for side in ("width", "height"))
    area = int(np.sum(widths.astype(np.int64) * heights))
    side = max(int(np.ceil(np.sqrt(area))), int(widths.max()))
    side = min(-(-side // 8) * 8, MAX_SIDE)
    order = np.lexsort((-widths, -heights))
    x, y, top = 0, 0, 0
    places = []
    for w, h in zip(widths[order].tolist(), heights[order].tolist(), strict=True):
        if x + w > side:
            x, y, top = 0, y + top, 0
        top = top or h
        places.append((x + 1, y + 1))
        x += w
    height = -(-(y + top) // 8) * 8
    if height > MAX_SIDE:
        remedy = f"an atlas has at most {MAX_SIDE} texels a side: lower the texels a cell side"
        raise InputError("lightmap", "atlas", f"{side} x {height}", remedy)
    found = np.array(places)
    rectangles["x"][order], rectangles["y"][order] = found[:, 0], found[:, 1]
    return side, height
