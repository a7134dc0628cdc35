"""The edges of a mesh where it may turn from front to back, with what its normals say of its bend.

Vertices that agree in place, to a millionth, are one point; those that agree in normal too are one
smooth vertex. An edge of two faces may turn; an edge of one face always counts. Left out are edges
of more than two faces, of faces without area, and hollow ones, behind which the mesh hides its own
outline. Faces look where their normals do, however they wind.

References
----------
Rusinkiewicz 2004, Estimating Curvatures and Their Derivatives on Triangle Meshes (bend of normals).
Duff et al. 2017, Building an Orthonormal Basis, Revisited (tangents).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int32]
ALIKE, ALIKE_NORMAL = 2.0**20, 2.0**12  # steps that tell points of a mesh apart, and normals
NO_AREA = 1e-9  # of the square of the longest edge
HOLLOW = 1e-6  # of an edge's length


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of a mesh: 44 bytes each, 32 a face, 24 a point, 56 a smooth vertex.

    points : (p, 3). normals : (s, 3) unit, of smooth vertices. bends : (s, 3), second fundamental
    form xx, xy, yy in the basis `tangents`, 1 / length, positive where the mesh bulges. reach :
    (s,) longest edge at it. planes : (m, 4), unit normal and offset of faces. ends : (e, 2) into
    points. smooth : (e, 2 faces, 2 ends) into normals. faces : (e, 2), the second -1 for none.
    across : (e, 2) points of the faces beside the edge.
    """

    points: Array
    normals: Array
    bends: Array
    reach: Array
    planes: Array
    ends: Index
    smooth: Index
    faces: Index
    across: Index

    @property
    def nbytes(self) -> int:
        """Memory of all arrays."""
        return sum(getattr(self, field.name).nbytes for field in fields(self))

    @cached_property
    def radius(self) -> float:
        """Half the diagonal of the box of all points."""
        if not len(self.points):
            return 0.0
        return 0.5 * float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def turning(self, eye: ArrayLike) -> NDArray[np.int64]:
        """Return numbers of edges that turn from front to back as seen from `eye` (3,)."""
        front = self.planes[:, :3] @ np.asarray(eye, np.float64) + self.planes[:, 3] > 0.0
        one, two = self.faces.T
        return np.flatnonzero((two < 0) | (front[one] != front[two]))


def of_triangles(positions: ArrayLike, normals: ArrayLike, faces: ArrayLike) -> Edges:
    """Return the edges of triangles.

    positions, normals : (n, 3) of vertices, normals unit. faces : (m, 3) into them.
    """
    place = np.asarray(positions, np.float64).reshape(-1, 3)
    normal = np.asarray(normals, np.float64).reshape(-1, 3)
    corners = np.asarray(faces, np.int64).reshape(-1, 3)
    size = float(np.abs(place).max(initial=0.0)) or 1.0
    point, first = _same(*np.rint(place.T * (ALIKE / size)).astype(np.int64))
    smooth, at = _same(point, *np.rint(normal.T * ALIKE_NORMAL).astype(np.int64))
    points, normal = place[first], normal[at]
    corners = corners[_different(point[corners])]
    triangle, corner = point[corners], smooth[corners]
    planes = _planes(points[triangle], normal[corner])

    # Half-edges: face by face, from corner k to the next
    begin, end = triangle.ravel(), triangle[:, [1, 2, 0]].ravel()
    low, high, swap = np.minimum(begin, end), np.maximum(begin, end), begin > end
    key = low * len(points) + high
    order = np.argsort(key, kind="stable")
    one, two = _partners(key[order])
    one, alone = order[one], two < 0
    two = np.where(alone, one, order[two])

    first, second = corner.ravel(), corner[:, [1, 2, 0]].ravel()
    low_owner, high_owner = np.where(swap, second, first), np.where(swap, first, second)
    both = np.stack([one, two], axis=1)
    smooth = np.stack([low_owner[both], high_owner[both]], axis=2)
    ends = np.stack([low[one], high[one]], axis=1)
    bends, reach = _bends(normal, smooth, points[ends[:, 1]] - points[ends[:, 0]])
    edges = Edges(
        points=points,
        normals=normal,
        bends=bends,
        reach=reach,
        planes=planes,
        ends=ends.astype(np.int32),
        smooth=smooth.astype(np.int32),
        faces=np.stack([one // 3, np.where(alone, -1, two // 3)], axis=1).astype(np.int32),
        across=triangle[:, [2, 0, 1]].ravel()[both].astype(np.int32),
    )
    return _chosen(edges, _may_turn(edges))


def tangents(normals: Array) -> tuple[Array, Array]:
    """Return two unit vectors (..., 3) that make a right-handed basis with normals (..., 3)."""
    x, y, z = np.moveaxis(normals, -1, 0)
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    u = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    return u, np.stack([b, sign + y * y * a, -y], axis=-1)


def _same(*columns: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number rows, given by columns (n,), so that equal ones share a number; and where each is."""
    key, values = np.zeros(len(columns[0]), np.int64), 1
    for column in columns:
        least = int(column.min(initial=0))
        range_ = int(column.max(initial=0)) - least + 1
        if values * range_ >= 1 << 62:
            # Ranks take less room than what they stand for
            key = np.unique(key, return_inverse=True)[1].reshape(-1)
            values = len(key) + 1
        key, values = key * range_ + column - least, values * range_
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    return number.reshape(-1), first


def _different(triangle: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of the faces with three points, the first of those that share all three."""
    low, middle, high = np.sort(triangle, axis=1).T
    whole = np.flatnonzero((low < middle) & (middle < high))
    return np.sort(whole[_same(low[whole], middle[whole], high[whole])[1]])


def _planes(corners: Array, normals: Array) -> Array:
    """Planes (m, 4) of triangles (m, 3, 3), towards the mean of their normals; 0 without area."""
    a, b, c = np.moveaxis(corners, 1, 0)
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    longest = np.max([np.sum((x - y) ** 2, axis=1) for x, y in ((a, b), (b, c), (c, a))], axis=0)
    good = area > NO_AREA * longest
    sign = np.where(np.einsum("mi,mki->m", across, normals) < 0, -1.0, 1.0)
    across = across * np.where(good, sign / np.where(good, area, 1.0), 0.0)[:, None]
    return np.concatenate([across, -np.sum(across * a, axis=1)[:, None]], axis=1)


def _partners(ordered: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of half-edges in order that share a key, -1 for no second; none of three."""
    new = np.ones(len(ordered), bool)
    new[1:] = ordered[1:] != ordered[:-1]
    start = np.flatnonzero(new)
    count = np.diff(np.append(start, len(ordered)))
    start, count = start[count <= 2], count[count <= 2]
    return start, np.where(count == 2, start + 1, -1)


def _bends(normals: Array, smooth: NDArray[np.int64], along: Array) -> tuple[Array, Array]:
    """Least squares of the normals' change along the edges at each smooth vertex.

    smooth : (e, 2 faces, 2 ends). along : (e, 3) from the first end to the second.
    """
    # At a crease the two sides are vertices of their own
    folded = np.flatnonzero((smooth[:, 0] != smooth[:, 1]).any(axis=1))
    owner = np.concatenate([smooth[:, 0], smooth[folded, 1]])
    along = np.concatenate([along, along[folded]])
    square = np.einsum("ei,ei->e", along, along)
    turn = np.einsum("ei,ei->e", normals[owner[:, 1]] - normals[owner[:, 0]], along) / square
    count, sums, reach = len(normals), np.zeros((9, len(normals))), np.zeros(len(normals))
    u, v = tangents(normals)
    for at in (owner[:, 0], owner[:, 1]):
        x, y = np.einsum("ei,ei->e", u[at], along), np.einsum("ei,ei->e", v[at], along)
        whole = np.maximum(x * x + y * y, 1e-18 * square)
        xx, xy, yy = x * x / whole, 2.0 * x * y / whole, y * y / whole
        terms = (xx * xx, xx * xy, xx * yy, xy * xy, xy * yy, yy * yy)
        for number, term in enumerate([*terms, xx * turn, xy * turn, yy * turn]):
            sums[number] += np.bincount(at, term, count)
        np.maximum.at(reach, at, np.sqrt(square))
    matrix = sums[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]].transpose(2, 0, 1)
    # A corner of one face has two directions for three unknowns: the least bend that explains them
    weight = 1e-6 * np.trace(matrix, axis1=1, axis2=2) + 1e-30
    matrix = matrix + weight[:, None, None] * np.diag([1.0, 2.0, 1.0])
    return np.linalg.solve(matrix, sums[6:].T[..., None])[..., 0], reach


def _may_turn(edges: Edges) -> NDArray[np.bool_]:
    """Tell which edges (e,) lie on faces with an area, and are not hollow."""
    flat = np.all(edges.planes[:, :3] == 0.0, axis=1)
    good = ~flat[edges.faces[:, 0]] & ~flat[edges.faces[:, 1]]
    alone = edges.faces[:, 1] < 0
    good[alone] = ~flat[edges.faces[alone, 0]]
    start, end = edges.points[edges.ends[:, 0]], edges.points[edges.ends[:, 1]]
    beyond = edges.points[edges.across[:, 1]] - start
    rise = np.sum(beyond * edges.planes[edges.faces[:, 0], :3], axis=1)
    hollow = rise > HOLLOW * np.linalg.norm(end - start, axis=1)
    return np.asarray(good & (alone | ~hollow))


def _chosen(edges: Edges, which: NDArray[np.bool_]) -> Edges:
    cut = {name: getattr(edges, name)[which] for name in ("ends", "smooth", "faces", "across")}
    kept = {f.name: getattr(edges, f.name) for f in fields(edges) if f.name not in cut}
    return Edges(**kept, **cut)
