"""A mesh as cells of a grid: every cell that a face touches, and what the faces enclose.

A cell has the colour and the emission of the face's point nearest to its centre; one inside has
those of a nearest cell of the surface.

Memory: 16 bytes a cell of the box, 24 a cell of the surface and face at it, and some 200 MB.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import triangle_boxes, voxel_inside, workers
from bake.rays import blend
from bake.shading import bilinear
from bake.triangle_boxes import Size
from formats.errors import InputError
from formats.mesh import Mesh
from formats.voxels import MAX_ROWS, MAX_SIDE
from maths.colour import srgb_encode

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Index = NDArray[np.int64]

POINTS = 1 << 17  # nearest points computed at a time


@dataclass(frozen=True, eq=False)
class Voxelised:
    """cells : (nz, ny, nx) uint16, 0 for empty, else a row of the palettes. albedo : (P, 3) float32
    linear, 0..1. emission : (P, 3) float32 radiance, W/(m2 sr). Row 0 of both is 0. cell_size :
    metres. origin : (x, y, z) metres of the lowest corner. closed : whether the mesh has no holes.
    notes : what was simplified.
    """

    cells: NDArray[np.uint16]
    albedo: Float
    emission: Float
    cell_size: float
    origin: tuple[float, float, float]
    closed: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Touched:
    """cell : (n,) flat indices, rising. face : (n,) nearest of the faces that touch it. weights :
    (n, 3) of its corners at the point nearest to the cell's centre."""

    cell: Index
    face: Index
    weights: Array


def voxelise(
    mesh: Mesh, *, grid: int, solid: bool, progress: workers.Progress = workers.silent
) -> Voxelised:
    """Return the cells of a mesh, `grid` of them along its longest side.

    solid : fill what the mesh encloses. The box begins at the mesh's lowest corner. Where there are
    more than 65,535 colours, similar ones become one. Raises InputError for a grid out of range,
    and for a mesh of which no face has an area or that is too small for numbers.
    """
    if not 1 <= grid <= MAX_SIDE:
        raise InputError("voxels", "grid", grid, f"choose from 1 to {MAX_SIDE}")
    used = mesh.vertices[np.unique(mesh.faces)]
    if not len(used):
        raise InputError("mesh", "faces", 0, "give a mesh with faces")
    origin = used.min(axis=0)
    extent = used.max(axis=0) - origin
    cell = float(extent.max()) / grid
    if not cell > 1e-300:
        raise InputError("mesh", "size", float(extent.max()), "give a mesh whose faces have area")
    # A side that is whole but for rounding has no cell more
    x, y, z = (int(n) for n in np.clip(np.ceil(extent / cell - 1e-9), 1, grid))
    corners = np.clip(((mesh.vertices - origin) / cell)[mesh.faces], 0, (x, y, z))

    touched = _touched(corners, (x, y, z), lambda done: progress(0.6 * done))
    if not len(touched.cell):
        raise InputError("mesh", "faces", len(mesh.faces), "give a mesh whose faces have area")
    rows, albedo, emission, notes = _palettes(*_colours(mesh, touched))
    cells = np.zeros((z, y, x), np.uint16)
    cells.reshape(-1)[touched.cell] = rows
    progress(0.7)
    closed = not solid or voxel_inside.is_closed(mesh.vertices, mesh.faces)
    if solid:
        inside = voxel_inside.enclosed(cells > 0)
        if not closed:
            inside |= voxel_inside.voted(corners, (x, y, z))
            notes += ("the mesh has holes: what is inside was voted on",)
        voxel_inside.spread(cells, inside)
    progress(1.0)
    lowest = (float(origin[0]), float(origin[1]), float(origin[2]))
    return Voxelised(cells, albedo, emission, cell, lowest, closed, notes)


def surface(corners: Array, size: Size) -> NDArray[np.bool_]:
    """Return the cells (nz, ny, nx) that triangles (m, 3, 3) in cells touch."""
    found = np.zeros(size[::-1], np.bool_)
    for _, cell in triangle_boxes.overlaps(corners, size):
        found.reshape(-1)[cell] = True
    return found


def _touched(corners: Array, size: Size, progress: workers.Progress) -> _Touched:
    """Return the touched cells, each with its nearest face; of equal ones the first."""
    best: list[tuple[Index, Index, Array, Array]] = []
    done, total = 0, max(len(corners), 1)
    for faces, cells in triangle_boxes.overlaps(corners, size):
        for start in range(0, len(faces), POINTS):
            face, cell = faces[start : start + POINTS], cells[start : start + POINTS]
            z, y, x = np.unravel_index(cell, size[::-1])
            centre = np.stack([x, y, z], axis=1).astype(np.float64) + 0.5
            weights, squared = nearest(centre, corners[face])
            best.append(_first(cell, face, weights, squared))
        done = max(done, int(faces.max(initial=0)))
        progress(done / total)
    if not best:
        return _Touched(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)))
    cell, face, weights, _ = _first(*(np.concatenate(parts) for parts in zip(*best, strict=True)))
    return _Touched(cell, face, weights)


def _first(
    cell: Index, face: Index, weights: Array, squared: Array
) -> tuple[Index, Index, Array, Array]:
    """Keep of each cell the pair of least squared distance, then of the lowest face."""
    order = np.lexsort((face, squared, cell))
    change = np.diff(cell[order], prepend=-1) != 0
    kept = order[change]
    return cell[kept], face[kept], weights[kept], squared[kept]


def nearest(points: Array, corners: Array) -> tuple[Array, Array]:
    """Return the weights (n, 3) of the corners at the points of triangles (n, 3, 3) nearest to
    points (n, 3), and the squared distances.

    The foot of the perpendicular where it lies in the triangle, else the nearest point of an edge.
    """
    a, b, c = (corners[:, i] for i in range(3))
    weights, least = np.zeros((len(points), 3)), np.full(len(points), np.inf)
    for i, (start, end) in enumerate(((a, b), (b, c), (c, a))):
        along, offset = end - start, points - start
        length = _dot(along, along)
        t = np.clip(_dot(offset, along) / np.where(length > 0, length, 1.0), 0, 1)
        away = offset - t[:, None] * along
        squared = _dot(away, away)
        nearer = squared < least
        least[nearer] = squared[nearer]
        weights[nearer] = 0
        weights[nearer, i] = 1 - t[nearer]
        weights[nearer, (i + 1) % 3] = t[nearer]
    e, f, offset = b - a, c - a, points - a
    normal = np.cross(e, f)
    area = _dot(normal, normal)
    sound = area > 0
    area = np.where(sound, area, 1.0)
    v, w = _dot(np.cross(offset, f), normal) / area, _dot(np.cross(e, offset), normal) / area
    within = sound & (v >= 0) & (w >= 0) & (v + w <= 1)
    least[within] = (_dot(offset, normal) ** 2 / area)[within]
    weights[within] = np.stack([1 - v - w, v, w], axis=1)[within]
    return weights, least


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def _colours(mesh: Mesh, touched: _Touched) -> tuple[Float, Float]:
    """Return base colour times texture times vertex colour, and emission, (n, 3) each."""
    kind, corners = mesh.material[touched.face], mesh.faces[touched.face]
    weights = touched.weights.astype(np.float32)
    albedo = np.array([m.base_color for m in mesh.materials], np.float32)[kind]
    if mesh.colours is not None:
        albedo *= blend(weights, mesh.colours[corners])
    for number, material in enumerate(mesh.materials):
        chosen = np.flatnonzero(kind == number)
        if material.texture is not None and mesh.uv is not None and len(chosen):
            uv = blend(weights[chosen], mesh.uv[corners[chosen]])
            albedo[chosen] *= bilinear(material.texture, uv)
    emission = np.array([m.emissive for m in mesh.materials], np.float32)[kind]
    return np.clip(albedo, 0, 1), emission


def _palettes(
    albedo: Float, emission: Float
) -> tuple[NDArray[np.uint16], Float, Float, tuple[str, ...]]:
    """Return the row (n,) of each pair of colours (n, 3), the palettes, and what was simplified.

    Colours too many for the palette are rounded to 5, 6 and 5 bits of sRGB, then to fewer, and a
    row has the mean of its colours.
    """
    glow, glow_row = _distinct(emission)
    exact, row = _distinct(np.concatenate([albedo, emission], axis=1))
    notes: tuple[str, ...] = ()
    codes = srgb_encode(albedo)
    for bits in range(5, -1, -1):
        if len(exact) < MAX_ROWS:
            break
        tops = np.array([1 << bits, 2 << bits, 1 << bits]) - 1
        rounded = np.rint(codes * tops)
        key = np.concatenate([rounded, glow_row[:, None]], axis=1).astype(np.float32)
        exact, row = _distinct(key)
        notes = (f"colours are rounded to {bits}, {bits + 1} and {bits} bits",)
    if len(exact) >= MAX_ROWS:
        raise InputError("mesh", "materials", len(glow), "give it fewer emissions")
    count = np.bincount(row)
    means = [np.bincount(row, weights=channel) / count for channel in (*albedo.T, *emission.T)]
    palette = np.concatenate([np.zeros((1, 6)), np.stack(means, axis=1)]).astype(np.float32)
    return (row + 1).astype(np.uint16), palette[:, :3], palette[:, 3:], notes


def _distinct(values: Float) -> tuple[Float, Index]:
    """Return the distinct rows of (n, c), and the number of each row's among them."""
    rows = np.ascontiguousarray(values + np.float32(0))
    packed = rows.view(f"V{4 * rows.shape[1]}").ravel()
    _, first, number = np.unique(packed, return_index=True, return_inverse=True)
    return rows[first], number
