"""The surface of a world of cubes as rays meet it: rectangles in Embree, and texels on them.

Space is Embree's unit space. Corners of merged rectangles lie on sides of their neighbours, where
Embree does not promise to be watertight: measured, one ray in some millions slips into the solid
there. Such a ray meets the next face from behind, is known by that, and is followed again from cell
to cell, in float64.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import cell_walk
from bake.rays import Hits, RayScene
from bake.voxel_faces import LONGEST, merged
from formats.lightmap_faces import Faces
from formats.lightmap_rectangles import NONE, face_number, flat_cells, spread
from formats.voxels import Voxels

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

LIFT = np.float32(2.0**-19)
"""How far rays start over their face: 16 steps of float32 at the corners of the world."""


@dataclass(frozen=True, eq=False)
class Ends:
    """Where k rays end. texel : (k,) int64, that of the surface, len(surface) for a miss. face :
    (k,) int8 2 axis + (1 if it looks down the axis), -1 for a miss. distance : (k,) float32 unit
    space. towards : (k,) float32 component of the rays along the face's normal, 0 for a miss.
    slipped : how many were followed from cell to cell."""

    texel: Indices
    face: NDArray[np.int8]
    distance: Float
    towards: Float
    slipped: int


class Surface:
    """Texels of all exposed faces of a world, rectangle by rectangle, rows along u.

    first, across, up : (R,) first texel of a rectangle, and texels along u and v. point : (T, 3)
    float32, unit space, centres on the face. face : (T,) 2 axis + (1 if it looks down the axis).
    cell : (T,) flat index of the solid cell. place : (T,) number of the texel on its cell's face.
    albedo, emission : (T, 3) float32. atlas : (T,) flat index in the atlas, -1 without one.
    """

    def __init__(self, voxels: Voxels, faces: Faces) -> None:
        n = self.texels = faces.texels
        # The side below has no texels, yet stops rays
        r = self.rectangles = merged([voxels.solid], max(1, LONGEST // n), below=True)
        grid = self.grid = voxels.size
        self.solid = voxels.solid
        self.scene = RayScene(*_quads(r))
        self.face_of = face_number(r).astype(np.int8)
        self.across, self.up = (r[side].astype(np.int64) * n for side in ("width", "height"))
        counts = self.across * self.up
        self.first = np.cumsum(counts) - counts
        rows, k = spread(counts)
        tv, tu = np.divmod(k, self.across[rows])
        self.face = self.face_of[rows]
        self.point = self._centres(rows, tu, tv)
        cells = flat_cells(r[rows], tu // n, tv // n, grid)
        self.cell, self.place = cells, tv % n * n + tu % n
        row = voxels.cells.ravel()[cells]
        self.albedo, self.emission = voxels.albedo[row], voxels.emission[row]
        page = faces.pages[faces.page_of.ravel()[cells], self.face].astype(np.int64)
        flat = (page[:, 1] + tv % n) * faces.size[0] + page[:, 0] + tu % n
        self.atlas = np.where(page[:, 0] == NONE, -1, flat)

    def __len__(self) -> int:
        return len(self.face)

    def starts(self, which: Indices, face: int) -> Float:
        """Return origins (k, 3) of rays from texels (k,) that all look the same way."""
        found = self.point[which]
        found[:, face // 2] += -LIFT if face % 2 else LIFT
        return found

    def lowest_corners(self, which: Indices) -> Float:
        """Return the lowest corners (k, 3), unit space, of the cells' faces that texels lie on."""
        nx, ny, _ = self.grid
        cell, face = self.cell[which], self.face[which]
        corner = np.stack([cell % nx, cell // nx % ny, cell // (nx * ny)], axis=-1)
        corner[np.arange(len(which)), face // 2] += face % 2 == 0
        return self.scene.to_unit(corner)

    def cast(self, origins: Float, directions: Float) -> Ends:
        """Follow rays from origins (k, 3) along unit directions (k, 3) to the texels they meet."""
        hits = self.scene.intersect(origins, directions, finite=True)
        met = hits.face >= 0
        row = np.where(met, hits.face >> 1, 0)
        face = np.where(met, self.face_of[row], np.int8(-1))
        towards = along_normals(directions, face)
        texel = np.where(met, self._texels(hits, row), len(self))
        ends = Ends(texel, face, hits.distance, towards, 0)
        slipped = np.flatnonzero(towards > 0)
        return self._walked(ends, origins, directions, slipped) if len(slipped) else ends

    def _texels(self, hits: Hits, row: NDArray[np.int32]) -> Indices:
        """Texels (k,) of hits of rectangles `row`; whatever for a miss."""
        # Corners of the first triangle are 00 10 11, of the second 00 11 01
        second = (hits.face & 1).astype(bool)
        u, v = np.where(hits.face < 0, 0, hits.u), np.where(hits.face < 0, 0, hits.v)
        s, t = np.where(second, u, u + v), np.where(second, u + v, v)
        across, up = self.across[row], self.up[row]
        tu = np.clip((s * across).astype(np.int64), 0, across - 1)
        tv = np.clip((t * up).astype(np.int64), 0, up - 1)
        return np.asarray(self.first[row] + tv * across + tu)

    def _walked(self, ends: Ends, origins: Float, directions: Float, which: Indices) -> Ends:
        """Follow some rays again, from cell to cell."""
        start = origins[which].astype(np.float64) / self.scene.scale + self.scene.centre
        towards = directions[which].astype(np.float64)
        cell, face, distance = cell_walk.first_solid(self.solid, start, towards)
        texel, faces = ends.texel.copy(), ends.face.copy()
        far, along = ends.distance.copy(), ends.towards.copy()
        met = face >= 0
        end = start + np.where(met, distance, 0)[:, None] * towards
        place = np.zeros(len(which), np.int64)
        for i in (2, 1):
            axis = (np.maximum(face, 0) // 2 + i) % 3
            inside = end[np.arange(len(end)), axis] % 1.0
            place = place * self.texels + np.minimum(
                (inside * self.texels).astype(np.int64), self.texels - 1
            )
        key = (cell * 6 + face) * self.texels**2 + place
        order, keys = self._by_key
        found = order[np.minimum(np.searchsorted(keys, np.where(met, key, 0)), len(keys) - 1)]
        texel[which] = np.where(met, found, len(self))
        faces[which] = face
        far[which] = np.where(met, distance * self.scene.scale, np.inf)
        along[which] = along_normals(directions[which], face)
        return Ends(texel, faces, far, along, len(which))

    @cached_property
    def key(self) -> Indices:
        """A number (T,) for each texel that no packing changes."""
        return np.asarray((self.cell * 6 + self.face) * self.texels**2 + self.place)

    @cached_property
    def _by_key(self) -> tuple[Indices, Indices]:
        order = np.argsort(self.key)
        return order, self.key[order]

    def _centres(self, rows: Indices, tu: Indices, tv: Indices) -> Float:
        r, n = self.rectangles[rows], self.texels
        axis = r["axis"]
        points = np.empty((len(rows), 3))
        along = (r["plane"], r["u"] + (tu + 0.5) / n, r["v"] + (tv + 0.5) / n)
        for i, values in enumerate(along):
            points[np.arange(len(rows)), (axis + i) % 3] = values
        return self.scene.to_unit(points)


def along_normals(rays: Float, face: NDArray[np.int8]) -> Float:
    """Return the component (k,) of rays (k, 3) along the normals of faces, 0 for face -1."""
    axis = np.maximum(face, 0) // 2
    along = np.take_along_axis(rays, axis[:, None].astype(np.int64), axis=1)[:, 0]
    return np.where(face < 0, np.float32(0), np.where(face % 2 == 1, -along, along))


def _quads(r: NDArray[Any]) -> tuple[Array, Indices]:
    """Return corners (4 R, 3) in cells and triangles (2 R, 3) of rectangles."""
    s, t = np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1])
    u, v = r["u"][:, None] + s * r["width"][:, None], r["v"][:, None] + t * r["height"][:, None]
    plane = np.broadcast_to(r["plane"][:, None], u.shape)
    corners = np.empty((len(r), 4, 3))
    for i, values in enumerate((plane, u, v)):
        corners[np.arange(len(r))[:, None], np.arange(4), (r["axis"][:, None] + i) % 3] = values
    triangles = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(r))[:, None, None]
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)
