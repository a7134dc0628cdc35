"""Small worlds of cubes, and their light in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from formats.lightmap import Faces, Lightmap
from formats.lightmap_rectangles import face_number
from formats.voxels import Voxels
from maths.area_lights import rectangle_irradiance

Array = NDArray[np.float64]


def room(side: int) -> NDArray[np.uint16]:
    """A closed room of `side` empty cells each way, with walls of one cell, all of row 1."""
    cells = np.ones((side + 2,) * 3, np.uint16)
    cells[1:-1, 1:-1, 1:-1] = 0
    return cells


def of(cells: NDArray[np.uint16], albedo: object, emission: object) -> Voxels:
    """A world with rows 1, 2, ... of these albedos and emissions, numbers or colours."""
    columns = [np.asarray(values, np.float32).T for values in (albedo, emission)]
    palettes = [np.stack([np.broadcast_to(c, (len(c.T) if c.ndim else 1,))] * 3, -1) if c.ndim < 2
                else c.T for c in columns]  # fmt: skip
    zero = np.zeros((1, 3), np.float32)
    first, second = (np.concatenate([zero, palette]) for palette in palettes)
    return Voxels(cells, first, second)


def coloured_room(side: int, *, seed: int, glowing: float) -> Voxels:
    """A closed room in which each cell has a colour and, of a share of them, light of its own."""
    rng = np.random.default_rng(seed)
    cells = room(side)
    count = int(cells.sum())
    cells[cells > 0] = np.arange(1, count + 1)
    emission = rng.uniform(0, 4, (count, 3)) * (rng.random((count, 1)) < glowing)
    return of(cells, rng.uniform(0, 0.8, (count, 3)), emission)


def texels(lightmap: Lightmap) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the texels of faces."""
    return np.nonzero(lightmap.faces.cell() >= 0)


def inside(faces: Faces, side: int) -> NDArray[np.bool_]:
    """Texels (h, w) that look into a room."""
    ahead = faces.positions() + 0.5 * faces.normals()
    with np.errstate(invalid="ignore"):
        return np.all((ahead > 1) & (ahead < side + 1), axis=2)


def patches(faces: Faces) -> tuple[Array, Array, Array, Array]:
    """Centre, normal, and the two half sides (F, 3) of all texels, in order of `interior`; the
    second half side is such that half_u x half_v is along the normal."""
    rows, _, _, x, y = faces.interior
    centre = faces.positions()[y, x].astype(np.float64)
    normal = faces.normals()[y, x].astype(np.float64)
    axis = faces.rectangles["axis"][rows]
    k, half = np.arange(len(rows)), 0.5 * faces.cell_size / faces.texels
    u, v = np.zeros((2, len(rows), 3))
    u[k, (axis + 1) % 3] = half
    v[k, (axis + 2) % 3] = half * faces.rectangles["sign"][rows]
    return centre, normal, u, v


def from_patches(
    point: Array, normal: Array, sources: tuple[Array, Array, Array], radiance: Array
) -> Array:
    """Irradiance (n, 3) at points from unblocked glowing patches (m), one at a time."""
    total = np.zeros((len(point), 3))
    for centre, u, v, glow in zip(*sources, radiance, strict=True):
        total += rectangle_irradiance(point, normal, centre, u, v, 1.0)[:, None] * glow
    return total


def room_truth(voxels: Voxels, faces: Faces, side: int, bounces: int = -1) -> tuple[Array, Array]:
    """Light on the texels of a convex room by a dense system: indices into `interior`, and
    irradiance there (k, 3)."""
    _, _, _, x, y = faces.interior
    which = np.flatnonzero(inside(faces, side)[y, x])
    centre, normal, u, v = (part[which] for part in patches(faces))
    form = np.stack([
        rectangle_irradiance(centre, normal, c, a, b, 1.0)
        for c, a, b in zip(centre, u, v, strict=True)
    ], axis=1)  # fmt: skip
    row = voxels.cells.ravel()[faces.cell()[y, x][which]]
    emission, albedo = voxels.emission[row].astype(float), voxels.albedo[row].astype(float)
    first = form @ emission
    if bounces >= 0:
        total, last = first.copy(), first
        for _ in range(bounces):
            last = form @ (albedo / np.pi * last)
            total += last
        return which, total
    unit = np.eye(len(which))
    found = [np.linalg.solve(unit - form * (albedo[:, c] / np.pi), first[:, c]) for c in range(3)]
    return which, np.stack(found, axis=-1)


def at_interior(lightmap: Lightmap) -> tuple[Array, Array]:
    """Irradiance and error (T, 3) in order of `interior`."""
    _, _, _, x, y = lightmap.faces.interior
    return lightmap.irradiance[y, x].astype(float), lightmap.error[y, x].astype(float)


def glowing_patches(faces: Faces, voxels: Voxels) -> tuple[tuple[Array, Array, Array], Array]:
    """All texels that glow, as sources, and their radiance."""
    _, _, _, x, y = faces.interior
    emission = voxels.emission[voxels.cells.ravel()[faces.cell()[y, x]]].astype(float)
    which = np.flatnonzero(emission.any(axis=1))
    centre, _, u, v = (part[which] for part in patches(faces))
    return (centre, u, v), emission[which]


def looking(faces: Faces, face: int) -> NDArray[np.bool_]:
    """Of the texels in order of `interior`, those of one of the six faces."""
    return np.asarray(face_number(faces.rectangles)[faces.interior[0]] == face)
