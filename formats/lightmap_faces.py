"""Where the faces of a world of cubes lie in an atlas of texels.

Exposed faces are merged to rectangles, each with n x n texels a cell side and a gutter of one texel
around it (`formats.lightmap_gutters`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import lightmap_gutters
from formats.lightmap_rectangles import NONE, cell_faces, face_number, flat_cells, spread

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Faces:
    """A layout.

    texels : n, a cell side.  size : (w, h) of the atlas, texels.  grid : (nx, ny, nz) cells.
    cell_size : metres.  origin : (x, y, z) metres of the grid's lowest corner.  rectangles : (R,)
    of type RECTANGLE.
    """

    texels: int
    size: tuple[int, int]
    grid: tuple[int, int, int]
    cell_size: float
    origin: tuple[float, float, float]
    rectangles: NDArray[Any]

    @cached_property
    def pages(self) -> NDArray[np.uint16]:
        """Atlas texels (x, y) of the first texel of six faces: (m, 6, 2), NONE for no face; row 0
        has none at all."""
        rows, cells, page_of = self._by_cell
        found = np.full((int(page_of.max()) + 1, 6, 2), NONE, np.uint16)
        face = face_number(self.rectangles)[rows]
        first = np.stack(_first_texels(self), axis=-1)
        found[page_of.ravel()[cells], face] = first
        return found

    @cached_property
    def page_of(self) -> NDArray[np.uint32]:
        """Row of `pages` of each cell (nz, ny, nx); 0 for none."""
        return self._by_cell[2]

    @cached_property
    def _by_cell(self) -> tuple[Indices, Indices, NDArray[np.uint32]]:
        rows, cells, _, _ = cell_faces(self.rectangles, self.grid)
        nx, ny, nz = self.grid
        page_of = np.zeros(nx * ny * nz, np.uint32)
        page_of[cells] = 1
        used = np.flatnonzero(page_of)
        page_of[used] = np.arange(1, len(used) + 1)
        return rows, cells, page_of.reshape(nz, ny, nx)

    @cached_property
    def interior(self) -> tuple[Indices, Indices, Indices, Indices, Indices]:
        """All interior texels, rectangle by rectangle, rows along u: row of the rectangle, texel
        along u and v inside it, atlas x and y, each (T,)."""
        r, n = self.rectangles, self.texels
        width, height = (r[side].astype(np.int64) * n for side in ("width", "height"))
        rows, along = spread(width * height)
        tv, tu = np.divmod(along, width[rows])
        return rows, tu, tv, r["x"][rows] + tu, r["y"][rows] + tv

    def positions(self) -> NDArray[np.float32]:
        """World positions (h, w, 3), metres, of the centres of interior texels; NaN elsewhere."""
        rows, tu, tv, x, y = self.interior
        r, n = self.rectangles[rows], self.texels
        along = [r["plane"], r["u"] + (tu + 0.5) / n, r["v"] + (tv + 0.5) / n]
        found = np.full((self.size[1], self.size[0], 3), np.nan, np.float32)
        found[y, x] = self._metres(r["axis"], along)
        return found

    def normals(self) -> NDArray[np.int8]:
        """Normals (h, w, 3) of interior texels, 0 elsewhere."""
        rows, _, _, x, y = self.interior
        found = np.zeros((self.size[1], self.size[0], 3), np.int8)
        found[y, x, self.rectangles["axis"][rows]] = self.rectangles["sign"][rows]
        return found

    def cell(self) -> NDArray[np.int32]:
        """Flat index (h, w) into (nz, ny, nx) of the solid cell behind interior texels, else -1."""
        rows, tu, tv, x, y = self.interior
        found = np.full((self.size[1], self.size[0]), -1, np.int32)
        n = self.texels
        found[y, x] = flat_cells(self.rectangles[rows], tu // n, tv // n, self.grid)
        return found

    def source(self) -> NDArray[np.int16]:
        """Interior texel (x, y) that each texel of the atlas shows, (h, w, 2): its own inside, as
        `lightmap_gutters` says in gutters, -1 where nothing is."""
        found = np.full((self.size[1], self.size[0], 2), -1, np.int16)
        _, _, _, x, y = self.interior
        found[y, x] = np.stack([x, y], axis=-1)
        lightmap_gutters.fill(found, self)
        return found

    def vertices(self) -> tuple[NDArray[np.float32], NDArray[np.int8], NDArray[np.float32]]:
        """Four corners a rectangle, counter-clockwise from outside: positions (4 R, 3) in metres,
        normals (4 R, 3), atlas coordinates (4 R, 2) in 0..1. Triangles are 0 1 2, 0 2 3."""
        r = np.repeat(self.rectangles, 4)
        i = np.tile(np.arange(4), len(self.rectangles))
        # Corners 00 10 11 01 run counter-clockwise about +axis
        i = np.where(r["sign"] > 0, i, -i % 4)
        s, t = ((i == 1) | (i == 2)).astype(np.int64), (i >= 2).astype(np.int64)
        width, height = r["width"] * s, r["height"] * t
        position = self._metres(r["axis"], [r["plane"], r["u"] + width, r["v"] + height])
        normal = np.zeros((len(r), 3), np.int8)
        normal[np.arange(len(r)), r["axis"]] = r["sign"]
        texel = np.stack([r["x"] + width * self.texels, r["y"] + height * self.texels], axis=-1)
        return position, normal, (texel / np.array(self.size)).astype(np.float32)

    def _metres(self, axis: NDArray[Any], along: list[NDArray[Any]]) -> NDArray[np.float32]:
        """World positions (k, 3) of points given along the face's own axis, u and v, in cells."""
        cells = np.empty((len(axis), 3))
        for i, values in enumerate(along):
            cells[np.arange(len(axis)), (axis + i) % 3] = values
        return np.asarray(np.asarray(self.origin) + self.cell_size * cells, np.float32)


def _first_texels(faces: Faces) -> tuple[NDArray[Any], NDArray[Any]]:
    rows, _, cu, cv = cell_faces(faces.rectangles, faces.grid)
    r, n = faces.rectangles, faces.texels
    return r["x"][rows] + cu * n, r["y"][rows] + cv * n
