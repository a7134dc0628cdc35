"""What a mesh of cells encloses, and the colour of what lies inside.

What cannot be reached from outside, through the sides of empty cells, is inside. Where a mesh has
holes, each cell also asks the six rays along the axes from its centre how often they meet the mesh:
an odd number says inside, and four of six decide. The two rays of an axis agree unless their line
leaves through a hole.

References
----------
Nooruddin, Turk 2003, Simplification and Repair of Polygonal Models Using Volumetric Techniques
(section 3.1, parity counts and votes).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bake.triangle_boxes import Size, batches, expanded

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

VOTES = 4  # of six rays, that make a cell inside


def is_closed(vertices: Array, faces: NDArray[np.int64]) -> bool:
    """Whether every edge has an even number of faces; vertices (n, 3) at one place are one."""
    rows = np.ascontiguousarray(vertices + 0.0).view(f"V{3 * 8}").ravel()
    _, number = np.unique(rows, return_inverse=True)
    corner = number[faces]
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=2).reshape(-1, 2)
    ends.sort(axis=1)
    key = ends[:, 0] * len(vertices) + ends[:, 1]
    # An edge from a vertex to itself bounds nothing
    _, count = np.unique(key[ends[:, 0] != ends[:, 1]], return_counts=True)
    return bool(np.all(count % 2 == 0))


def enclosed(surface: Bools) -> Bools:
    """Return the cells (nz, ny, nx) that are empty and cannot be reached from outside.

    Memory: 6 bytes a cell.
    """
    empty = np.pad(~surface, 1, constant_values=True)
    label, _ = ndimage.label(empty)
    inside = (label != label[0, 0, 0]) & empty
    return np.asarray(inside[1:-1, 1:-1, 1:-1])


def voted(corners: Array, size: Size) -> Bools:
    """Return the cells (nz, ny, nx) whose centres most rays find inside.

    corners : (m, 3, 3) x, y, z in cells, inside 0..size. Memory: 4 bytes a cell.
    """
    votes = np.zeros(size[::-1], np.uint8)
    for axis in range(3):
        crossings = _crossings(corners, size, axis)
        along = 2 - axis
        parity = np.bitwise_xor.accumulate(crossings & 1, axis=along)
        below = np.take(parity, np.arange(size[axis]), axis=along)
        votes += below
        votes += below ^ np.take(parity, [size[axis]], axis=along)
    return np.asarray(votes >= VOTES)


def _crossings(corners: Array, size: Size, axis: int) -> NDArray[np.uint8]:
    """Count, modulo 256, where lines through the centres of columns meet triangles.

    Along the axis, there is one entry more than cells: entry k counts what lies above the centre of
    cell k - 1 and not above that of k.
    """
    a, b = (axis + 1) % 3, (axis + 2) % 3
    p = np.ascontiguousarray(np.moveaxis(corners, 0, 2))
    low, high = p.min(axis=0), p.max(axis=0)
    first = np.ceil(low - 0.5).astype(np.int64)
    count = np.maximum(np.floor(high - 0.5).astype(np.int64) - first + 1, 0)
    shape = [size[i] + (i == axis) for i in range(3)]
    strides = np.array([1, shape[0], shape[0] * shape[1]])
    found = np.zeros(shape[::-1], np.uint8)
    for run in batches(count[a] * count[b]):
        face, k = expanded(count[a, run] * count[b, run])
        j, i = np.divmod(k, np.maximum(count[a, run], 1)[face])
        i, j = i + first[a, run][face], j + first[b, run][face]
        hit = _inside(p[:, :, run], a, b, face, i + 0.5, j + 0.5)
        face, i, j = face[hit], i[hit], j[hit]
        depth = _depth(p[:, :, run], axis, face, i + 0.5, j + 0.5)
        depth = np.clip(depth, low[axis, run][face], high[axis, run][face])
        k = np.clip(np.ceil(depth - 0.5).astype(np.int64), 0, size[axis])
        np.add.at(found.reshape(-1), i * strides[a] + j * strides[b] + k * strides[axis], 1)
    return found


def _inside(p: Array, a: int, b: int, face: NDArray[np.int64], x: Array, y: Array) -> Bools:
    """Tell whether points (n,) lie in the projections of their triangles, p : (3, 3, m).

    Of two triangles with an edge in common, exactly one has each point of it: every edge is taken
    from its lower end to its higher, so that both compute the same numbers.
    """
    odd = np.zeros(len(face), np.bool_)
    for i in range(3):
        start, end = p[i][[a, b]], p[(i + 1) % 3][[a, b]]
        swap = start[1] > end[1]
        start, end = np.where(swap, end, start), np.where(swap, start, end)
        rise = end[1] - start[1]
        slope = (end[0] - start[0]) / np.where(rise > 0, rise, 1.0)
        crosses = (start[1][face] <= y) & (y < end[1][face])
        odd ^= crosses & (x < start[0][face] + (y - start[1][face]) * slope[face])
    return odd


def _depth(p: Array, axis: int, face: NDArray[np.int64], x: Array, y: Array) -> Array:
    """Return where lines (n,) along the axis meet the planes of their triangles."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    e, f = p[1] - p[0], p[2] - p[0]
    na, nb, n = (e[i] * f[j] - e[j] * f[i] for i, j in ((b, axis), (axis, a), (a, b)))
    flat = n == 0  # seen edge on: any depth of the triangle's
    na, nb, n = np.where(flat, 0, na), np.where(flat, 0, nb), np.where(flat, 1, n)
    slopes = na / n, nb / n
    dx, dy = x - p[0, a][face], y - p[0, b][face]
    return np.asarray(p[0, axis][face] - slopes[0][face] * dx - slopes[1][face] * dy)


def spread(rows: NDArray[np.uint16], inside: Bools) -> None:
    """Give cells inside, in place, the row of a cell that has one, in fewest steps through sides.

    rows : (nz, ny, nx), 0 where there is none yet. Cells that none leads to stay 0.
    """
    shape = tuple(side + 2 for side in rows.shape)
    waiting = np.pad(inside & (rows == 0), 1).reshape(-1)
    found = np.pad(rows, 1).reshape(-1)
    front = np.flatnonzero(found)
    steps = [sign * stride for stride in (1, shape[2], shape[1] * shape[2]) for sign in (-1, 1)]
    while len(front):
        reached = []
        for step in steps:
            next_to = front + step
            here = waiting[next_to]
            taken, source = next_to[here], front[here]
            waiting[taken] = False
            found[taken] = found[source]
            reached.append(taken)
        front = np.concatenate(reached)
    rows[:] = found.reshape(shape)[1:-1, 1:-1, 1:-1]
