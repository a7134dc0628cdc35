"""Convex polygons of light, sampled by the solid angle that they fill.

Cut into a fan of triangles, each sampled as in Arvo 1995, *Stratified Sampling of Spherical
Triangles*. From far away, where that cancels, the area is sampled instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake.reference_emission import Sample, choose, on_triangle

Array = NDArray[np.float64]

SMALL = 1e-3
"""Steradians under which the area is sampled: over so small a light cos / d^2 hardly varies."""


@dataclass(frozen=True, eq=False)
class PolygonSampler:
    """A flat convex polygon. corners : (k, 3). axis : (3,) unit, towards its front."""

    corners: Array
    axis: Array
    radiance: Array
    two_sided: bool

    def sample(self, points: Array, u: Array) -> Sample:
        """Sample a direction to the polygon; what is behind a one-sided one gets no light."""
        towards = self.corners - points[:, None]
        height = np.einsum("nki,i->nk", towards, self.axis)[:, 0]
        length = np.sqrt(np.maximum(np.einsum("nki,nki->nk", towards, towards), 1e-60))
        unit = towards / length[..., None]
        solid = np.stack([solid_angle(*_fan(unit, i)) for i in range(self.corners.shape[0] - 2)], 1)
        total = solid.sum(axis=1)
        direction, distance, weight = self._by_area(points, u)
        wide = np.flatnonzero(total > SMALL)
        if len(wide):
            found = _in_fan(unit[wide], solid[wide], u[wide])
            steep = found @ self.axis
            direction[wide] = found
            safe = np.where(np.abs(steep) > 1e-9, steep, 1.0)
            # A direction along the plane ends on the rim, as far as rounding can tell
            distance[wide] = np.where(safe == steep, height[wide] / safe, length[wide].min(axis=1))
            weight[wide] = total[wide]
        lit = (height != 0) if self.two_sided else height < 0
        return Sample(direction, (weight * lit)[:, None] * self.radiance, distance)

    def _by_area(self, points: Array, u: Array) -> tuple[Array, Array, Array]:
        """Return direction, distance, and solid angle per density of points of the area."""
        first, rest = self.corners[0], self.corners[1:]
        sides = np.stack([rest[:-1] - first, rest[1:] - first], axis=1)
        areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        which, within = choose(np.cumsum(areas), u[:, 0])
        place = first + on_triangle(sides[which], np.stack([within, u[:, 1]], axis=-1))
        offset = place - points
        distance = np.sqrt(np.maximum(np.einsum("ij,ij->i", offset, offset), 1e-60))
        direction = offset / distance[:, None]
        return direction, distance, areas.sum() * np.abs(direction @ self.axis) / distance**2


def solid_angle(a: Array, b: Array, c: Array) -> Array:
    """Solid angle (n,) of triangles of unit corners (n, 3) (Van Oosterom, Strackee 1983)."""
    volume = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    dots = [np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a))]
    return np.asarray(2 * np.arctan2(volume, 1 + dots[0] + dots[1] + dots[2]))


def spherical_triangle(a: Array, b: Array, c: Array, area: Array, u: Array) -> Array:
    """Directions (n, 3) spread evenly over spherical triangles of unit corners (n, 3) and solid
    angles (n,), by numbers u (n, 2) (Arvo 1995, figure 3)."""
    # The angle at a, between the planes of its two sides
    ab, ac = np.cross(a, b), np.cross(a, c)
    sine = np.linalg.norm(np.cross(ab, ac), axis=1)
    alpha = np.arctan2(sine, np.einsum("ij,ij->i", ab, ac))
    part = u[:, 0] * area - alpha
    s, t = np.sin(part), np.cos(part)
    p = t - np.cos(alpha)
    q = s + np.sin(alpha) * np.einsum("ij,ij->i", a, b)
    below = (q * s + p * t) * np.sin(alpha)
    safe = np.where(np.abs(below) > 1e-30, below, 1.0)
    cosine = np.where(safe == below, ((q * t - p * s) * np.cos(alpha) - q) / safe, 1.0)
    # A smaller triangle of that share of the area, then a point on its far side
    corner = _along(a, c, np.clip(cosine, -1, 1))
    return _along(b, corner, 1 - u[:, 1] * (1 - np.einsum("ij,ij->i", corner, b)))


def _along(start: Array, towards: Array, cosine: Array) -> Array:
    """Unit vectors (n, 3) at an angle of `cosine` (n,) from start (n, 3), in the plane of both."""
    across = towards - np.einsum("ij,ij->i", towards, start)[:, None] * start
    length = np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
    sine = np.sqrt(np.maximum(0, 1 - cosine * cosine))
    return np.asarray(cosine[:, None] * start + sine[:, None] * (across / length))


def _fan(unit: Array, i: int) -> tuple[Array, Array, Array]:
    return unit[:, 0], unit[:, i + 1], unit[:, i + 2]


def _in_fan(unit: Array, solid: Array, u: Array) -> Array:
    """Directions (n, 3) spread evenly over fans of corners (n, k, 3), triangles of solid (n, k-2)
    angles."""
    ends = np.cumsum(solid, axis=1)
    scaled = u[:, 0] * ends[:, -1]
    which = np.minimum((scaled[:, None] >= ends).sum(axis=1), solid.shape[1] - 1)
    row = np.arange(len(which))
    area = solid[row, which]
    within = np.clip((scaled - ends[row, which] + area) / np.maximum(area, 1e-300), 0, 1)
    corners = unit[:, 0], unit[row, which + 1], unit[row, which + 2]
    return spherical_triangle(*corners, area, np.stack([within, u[:, 1]], axis=-1))
