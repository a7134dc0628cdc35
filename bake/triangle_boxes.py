"""Which cells of a grid triangles touch, exactly: separating axes, tested on many pairs at once.

A cell and a triangle are apart if, and only if, one of thirteen axes separates them: the cell's
three, the triangle's normal, and nine products of their edges. Seen along an axis of the grid, the
nine become three edges in each of three projections. Small triangles are tested against all cells
of their box, where each projection is shared by a row of cells. Larger ones are first projected
along the normal's largest component, which gives columns of cells; the plane then cuts a column to
at most four.

Cells hold their lower sides: a triangle that lies in the plane between two cells touches the upper
one only. Everything else counts where it touches: rounding never loses a cell.

References
----------
Akenine-Moller 2001, Fast 3D Triangle-Box Overlap Testing.
Schwarz, Seidel 2010, Fast Parallel Surface and Solid Voxelization on GPUs (section 3).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Size = tuple[int, int, int]

SMALL = 4  # cells a side of the boxes whose cells are all tested
TOGETHER = 1 << 18
"""Cells or columns tested at a time, in some 40 MB; one triangle may have more."""
# Rounding of a few products and sums, each of relative error 2^-53
ROUNDING = 1e-15


@dataclass(frozen=True, eq=False)
class _Triangles:
    """m triangles. face : (m,) their numbers. corners : (3 corners, 3 axes, m) in cells, from the
    lowest cell of their box. normal : (3, m) times twice the area. low, count : (3, m) cells.
    """

    face: Index
    corners: Array
    normal: Array
    low: Index
    count: Index

    def pick(self, which: Index | slice) -> _Triangles:
        """Return some of the triangles."""
        return _Triangles(
            self.face[which],
            self.corners[:, :, which],
            self.normal[:, which],
            self.low[:, which],
            self.count[:, which],
        )


def overlaps(corners: Array, size: Size) -> Iterator[tuple[Index, Index]]:
    """Yield all pairs of a triangle and a cell that it touches: (p,) triangles, (p,) cells.

    corners : (m, 3, 3) x, y, z in cells, inside 0..size. size : (nx, ny, nz). Cells are flat
    indices of (z, y, x). Triangles without an area touch nothing. Pairs come once, in a fixed
    order, in parts of about `TOGETHER`.
    """
    triangles = _prepared(corners, size)
    strides = np.array([1, size[0], size[0] * size[1]])
    small = triangles.count.max(axis=0, initial=0) <= SMALL
    key = np.where(small, np.array([1, 8, 64]) @ triangles.count, 1 << 10)
    order = np.argsort(key, kind="stable")
    ends = [*np.flatnonzero(np.diff(key[order])) + 1, len(order)] if len(order) else []
    start = 0
    for end in ends:
        group = triangles.pick(order[start:end])
        start = end
        if not small[order[end - 1]]:
            yield from _by_columns(group, strides)
            continue
        shape = tuple(group.count[:, 0].tolist())
        step = TOGETHER // int(np.prod(shape))
        for at in range(0, len(group.face), step):
            yield _by_boxes(group.pick(slice(at, at + step)), shape, strides)


def _prepared(corners: Array, size: Size) -> _Triangles:
    """Return the triangles that have an area."""
    p = np.ascontiguousarray(np.moveaxis(corners, 0, 2))
    e, f = p[1] - p[0], p[2] - p[0]
    normal = np.stack([e[i - 2] * f[i - 1] - e[i - 1] * f[i - 2] for i in range(3)])
    last = np.array(size)[:, None] - 1
    low = np.clip(np.floor(np.minimum(np.minimum(p[0], p[1]), p[2])), 0, last).astype(np.int64)
    high = np.clip(np.floor(np.maximum(np.maximum(p[0], p[1]), p[2])), 0, last).astype(np.int64)
    found = _Triangles(np.arange(len(corners)), p - low, normal, low, high - low + 1)
    area = normal.any(axis=0)
    return found if area.all() else found.pick(np.flatnonzero(area))


def _by_boxes(group: _Triangles, shape: tuple[int, ...], strides: Index) -> tuple[Index, Index]:
    """Return the pairs of triangles whose boxes have one shape (x, y, z), by testing all cells."""
    x, y, z = shape
    touches = _grid(group, 0, 1, x, y)[None] & _grid(group, 1, 2, y, z)[:, :, None]
    touches &= _grid(group, 0, 2, x, z)[:, None]
    # The plane touches a cell where its distance from the centre is at most the cell's reach
    n, p = group.normal, group.corners[0]
    reach = np.abs(n).sum(axis=0) * (0.5 + 16 * ROUNDING * SMALL) + _lost(group)
    i, j, k = (n[axis] * (np.arange(shape[axis])[:, None] + 0.5) for axis in range(3))
    k -= n[0] * p[0] + n[1] * p[1] + n[2] * p[2]
    touches &= np.abs(k[:, None, None] + (j[:, None] + i)) <= reach
    cell, row = np.divmod(np.flatnonzero(touches), len(reach))
    k, j, i = np.indices((z, y, x)).reshape(3, -1)
    offset = np.stack([i, j, k], axis=1) @ strides
    return group.face[row], (strides @ group.low)[row] + offset[cell]


def _grid(group: _Triangles, a: int, b: int, rows: int, columns: int) -> NDArray[np.bool_]:
    """Tell which unit squares (columns, rows, m) the projections onto axes a, b touch."""
    found = np.ones((columns, rows, len(group.face)), np.bool_)
    for p, q, r in _edges(group.corners, group.normal, a, b):
        along = p * np.arange(rows)[:, None] + r
        found &= (q * np.arange(columns)[:, None])[:, None] + along >= 0
    return found


def _edges(corners: Array, normal: Array, a: int, b: int) -> Iterator[tuple[Array, Array, Array]]:
    """Yield p, q, r (m,) of the three edges of a projection onto two axes.

    A square at (i, j) touches the inner side of an edge where p i + q j + r >= 0, taken at the
    square's innermost corner.
    """
    # The third component of the normal is twice the area of the projection, with its sign
    area = normal[3 - a - b] if (b - a) % 3 == 1 else -normal[3 - a - b]
    side = np.where(area < 0, -1.0, 1.0)
    for i in range(3):
        (x, y), (x2, y2) = corners[i, (a, b)], corners[(i + 1) % 3, (a, b)]
        p, q = (y - y2) * side, (x2 - x) * side
        slack = 8 * ROUNDING * (np.abs(p) * (np.abs(x) + 1) + np.abs(q) * (np.abs(y) + 1))
        yield p, q, np.maximum(p, 0) + np.maximum(q, 0) - p * x - q * y + slack


def _lost(group: _Triangles) -> Array:
    """Return what rounding may add to the plane's distance (m,), times the normal's length.

    Each component of the normal is a difference of products of lengths, and is off by as much as
    those round: slivers have no sure normal.
    """
    longest = group.corners.max(axis=(0, 1)) + 1
    return np.asarray(16 * ROUNDING * longest**3)


def _by_columns(group: _Triangles, strides: Index) -> Iterator[tuple[Index, Index]]:
    """Yield the pairs of triangles of any size."""
    # Turn the axes so that the normal's largest component is the last
    turn = (np.abs(group.normal).argmax(axis=0) + np.array([[1], [2], [0]])) % 3
    group = _Triangles(
        group.face,
        np.take_along_axis(group.corners, turn[None], axis=1),
        np.take_along_axis(group.normal, turn, axis=0),
        np.take_along_axis(group.low, turn, axis=0),
        np.take_along_axis(group.count, turn, axis=0),
    )
    for run in batches(group.count[0] * group.count[1]):
        part, stride = group.pick(run), strides[turn[:, run]]
        face, *cell = _columns(part)
        flat = (part.low * stride).sum(axis=0)[face]
        for axis, each in enumerate(cell):
            flat += each * stride[axis][face]
        yield part.face[face], flat


def _columns(group: _Triangles) -> tuple[Index, Index, Index, Index]:
    """Return pairs as the row in the group, and the cell's (u, v, w) on the turned axes."""
    face, k = expanded(group.count[0] * group.count[1])
    v, u = np.divmod(k, group.count[0][face])
    kept = _touches(group, 0, 1, face, u, v)
    face, u, v = face[kept], u[kept], v[kept]

    # Cut each column by the plane
    n, p = group.normal, group.corners[0]
    a, b = -n[0] / n[2], -n[1] / n[2]
    start, slack = p[2] - a * p[0] - b * p[1], _lost(group) * (1 + 1 / np.abs(n[2]))
    below = start + np.minimum(a, 0) + np.minimum(b, 0) - slack
    above = start + np.maximum(a, 0) + np.maximum(b, 0) + slack
    level, top = a[face] * u + b[face] * v, group.count[2][face] - 1
    first = np.clip(np.floor(below[face] + level), 0, top).astype(np.int64)
    last = np.clip(np.floor(above[face] + level), 0, top).astype(np.int64)
    column, k = expanded(last - first + 1)
    face, u, v, w = face[column], u[column], v[column], first[column] + k

    # Test the two other projections
    kept = _touches(group, 1, 2, face, v, w) & _touches(group, 2, 0, face, w, u)
    return face[kept], u[kept], v[kept], w[kept]


def _touches(
    group: _Triangles, a: int, b: int, face: Index, i: Index, j: Index
) -> NDArray[np.bool_]:
    """Tell which unit squares (n,) at (i, j) the projections of their triangles touch."""
    found = np.ones(len(face), np.bool_)
    for p, q, r in _edges(group.corners, group.normal, a, b):
        found &= p[face] * i + q[face] * j + r[face] >= 0
    return found


def expanded(count: Index) -> tuple[Index, Index]:
    """Return, for `count` things of each row, the row and the number of each thing in its row."""
    row = np.repeat(np.arange(len(count)), count)
    start = np.cumsum(count) - count
    return row, np.arange(len(row)) - start[row]


def batches(count: Index) -> Iterator[slice]:
    """Cut rows into runs that hold about `TOGETHER` things each, `count` of them in each row."""
    total = np.cumsum(count)
    start = 0
    while start < len(count):
        done = total[start - 1] if start else 0
        end = max(start + 1, int(np.searchsorted(total, done + TOGETHER, "right")))
        yield slice(start, end)
        start = end
