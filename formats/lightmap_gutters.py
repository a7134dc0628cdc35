"""Which texels the gutters of an atlas show.

A gutter copies the texel that goes on in the same plane, so that bilinear lookups have no seams
there, and the rectangle's own edge where nothing goes on: no light crosses an edge. Where three of
four faces around a grid point go on, the place of the fourth stands for the one opposite, from
whichever of the three it is looked at; with one texel a cell side and two such points on one side
of a cell, the second keeps a seam. Faces that touch in a point alone share nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from formats.lightmap_rectangles import NONE, face_number, flat_cells, spread

if TYPE_CHECKING:
    from formats.lightmap_faces import Faces

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]


def fill(source: NDArray[np.int16], faces: Faces) -> None:
    """Set the gutters in source (h, w, 2): atlas texel (x, y) that each texel shows."""
    ring = _Ring(faces)
    corner = (ring.du != 0) & (ring.dv != 0)
    _fill_corners(source, ring, np.flatnonzero(corner))
    _fill_sides(source, ring, np.flatnonzero(~corner))


class _Ring:
    """The cells just around each rectangle in its plane, corners included, (k,) each.

    rows : of the rectangle. cu, cv : cell along u and v from its first. iu, iv : the nearest cell
    inside. du, dv : -1, 0 or 1, on which side.
    """

    def __init__(self, faces: Faces) -> None:
        r, self.n = faces.rectangles, faces.texels
        wide, high = (r[side].astype(np.int64) + 2 for side in ("width", "height"))
        self.rows, k = spread(2 * (wide + high) - 4)
        wide, high = wide[self.rows], high[self.rows]
        # Two full rows, then the two columns between them
        side = k - 2 * wide
        column = side < high - 2
        self.cu = np.where(side < 0, k % wide, np.where(column, 0, wide - 1)) - 1
        down = np.where(column, side, side - high + 2)
        self.cv = np.where(side < 0, np.where(k < wide, -1, high - 2), down)
        self.iu, self.iv = np.clip(self.cu, 0, wide - 3), np.clip(self.cv, 0, high - 3)
        self.du, self.dv = self.cu - self.iu, self.cv - self.iv
        # What a lookup in the plane needs of each rectangle
        zero, one = np.zeros(len(r), np.int64), np.ones(len(r), np.int64)
        self._base = flat_cells(r, zero, zero, faces.grid)
        self._step_u = flat_cells(r, one, zero, faces.grid) - self._base
        self._step_v = flat_cells(r, zero, one, faces.grid) - self._base
        self._u, self._v = (r[side].astype(np.int64) for side in ("u", "v"))
        sides = np.asarray(faces.grid)
        self._end_u, self._end_v = sides[(r["axis"] + 1) % 3], sides[(r["axis"] + 2) % 3]
        self._face = face_number(r)
        self.first = np.stack([r["x"], r["y"]], axis=-1).astype(np.int64)
        self._page_of, self._pages = faces.page_of.ravel(), faces.pages

    def at(self, which: Indices, cu: Indices, cv: Indices) -> tuple[Indices, Mask]:
        """First atlas texels (k, 2) of the faces at cells (k,) in the planes of some of the ring's
        rectangles, and whether there are any."""
        rows = self.rows[which]
        u, v = self._u[rows] + cu, self._v[rows] + cv
        inside = (u >= 0) & (v >= 0) & (u < self._end_u[rows]) & (v < self._end_v[rows])
        cells = self._base[rows] + cu * self._step_u[rows] + cv * self._step_v[rows]
        page = self._page_of[np.where(inside, cells, 0)]
        found = self._pages[page, self._face[rows]].astype(np.int64)
        return found, inside & (found[:, 0] != NONE)

    def own(self, which: Indices) -> Indices:
        """First atlas texels (k, 2) of the nearest cells inside."""
        inner = np.stack([self.iu[which], self.iv[which]], axis=-1) * self.n
        return np.asarray(self.first[self.rows[which]] + inner)

    def gutter(self, which: Indices) -> Indices:
        """Atlas texels (k, 2) of the gutter: the corner, or the first of a side."""
        place = [np.where(cell < 0, -1, cell * self.n) for cell in (self.cu[which], self.cv[which])]
        return np.asarray(self.first[self.rows[which]] + np.stack(place, axis=-1))


def _fill_corners(source: NDArray[np.int16], ring: _Ring, k: Indices) -> None:
    """Show a diagonal that one can walk to, else the side that goes on, else the own corner."""
    n = ring.n
    # Texel of a cell that lies at the side towards -1 or 1, and at the opposite side
    near_u, near_v = (np.where(d[k] < 0, 0, n - 1) for d in (ring.du, ring.dv))
    far_u, far_v = n - 1 - near_u, n - 1 - near_v
    own = ring.own(k) + np.stack([near_u, near_v], axis=-1)
    diagonal, goes_on = ring.at(k, ring.cu[k], ring.cv[k])
    at_u, has_u = ring.at(k, ring.cu[k], ring.iv[k])
    at_v, has_v = ring.at(k, ring.iu[k], ring.cv[k])
    at_u += np.stack([far_u, near_v], axis=-1)
    at_v += np.stack([near_u, far_v], axis=-1)
    diagonal += np.stack([far_u, far_v], axis=-1)
    shown = np.where((has_u != has_v)[:, None], np.where(has_u[:, None], at_u, at_v), own)
    shown = np.where((goes_on & (has_u | has_v))[:, None], diagonal, shown)
    _set(source, ring.gutter(k), shown)


def _fill_sides(source: NDArray[np.int16], ring: _Ring, k: Indices) -> None:
    """Show what goes on beyond a cell's side, else its own edge, but for the ends of an edge that
    three faces surround."""
    n, upright = ring.n, ring.du[k] != 0
    along = np.stack([~upright, upright], axis=-1).astype(np.int64)
    low = np.where(upright, ring.du[k], ring.dv[k]) < 0
    # Across the side: the own edge, and the edge of what lies beyond
    own_edge = (np.where(low, 0, n - 1)[:, None]) * along[:, ::-1]
    beyond_edge = (np.where(low, n - 1, 0)[:, None]) * along[:, ::-1]
    beyond, goes_on = ring.at(k, ring.cu[k], ring.cv[k])
    start = np.where(goes_on[:, None], beyond + beyond_edge, ring.own(k) + own_edge)
    gutter = ring.gutter(k)
    for i in range(n):
        _set(source, gutter + i * along, start + i * along)
    # Show the opposite of a place that three faces surround
    for step in (-1, 1):
        j = np.flatnonzero(~goes_on)
        su, sv = step * along[j, 0], step * along[j, 1]
        which = k[j]
        beside, has = ring.at(which, ring.iu[which] + su, ring.iv[which] + sv)
        _, further = ring.at(which, ring.cu[which] + su, ring.cv[which] + sv)
        end, other = (0, n - 1) if step < 0 else (n - 1, 0)
        j, shown = j[has & further], beside[has & further]
        _set(source, gutter[j] + end * along[j], shown + own_edge[j] + other * along[j])


def _set(source: NDArray[np.int16], at: Indices, shown: NDArray[Any]) -> None:
    source[at[:, 1], at[:, 0]] = shown
