"""Light that a path can also meet by itself: environments and glowing triangles.

Both are sampled by power, triangles by distance too, and tell their density along any direction, so
that their samples can be weighed against the surface's own (Veach, Guibas 1995, *Optimally
Combining Sampling Techniques for Monte Carlo Rendering*: the balance heuristic).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake.reference_clusters import Clusters
from bake.reference_world import World
from maths import transforms
from maths.colour import luminance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sample:
    """Light on n points: direction (n, 3) unit, towards it; weight (n, 3) radiance over density.

    distance : (n,) metres to it, None for infinity. density : (n,) 1/sr, None for light that only
    its own samples find. face : (n,) that glows, None for lights that are not traced.
    """

    direction: Array
    weight: Array
    distance: Array | None = None
    density: Array | None = None
    face: NDArray[np.int64] | None = None


@dataclass(frozen=True, eq=False)
class EnvironmentSampler:
    """A lat-long map of radiance (h, w, 3), constant over each texel, turned about +y."""

    radiance: Array
    turn: float
    share: Array
    """Cumulative share of power, by texel in order."""
    density: Array
    """Density (h, w) per steradian of `sample`."""

    @classmethod
    def of_map(cls, radiance: Array, turn: float) -> EnvironmentSampler:
        """Make one of radiance (h, w, 3) and a turn in radians."""
        solid = transforms.latlong_solid_angles(*radiance.shape[:2])[:, None]
        power = luminance(radiance) * solid
        total = power.sum()
        return cls(radiance, turn, np.cumsum(power.ravel()) / total, power / (total * solid))

    def sample(self, points: Array, u: Array) -> Sample:
        """Sample a texel by its power and a direction evenly over its solid angle."""
        height, width = self.density.shape
        row, column = np.divmod(choose(self.share, u[:, 0])[0], width)
        top, bottom = np.cos(np.pi * row / height), np.cos(np.pi * (row + 1) / height)
        y = top + (bottom - top) * u[:, 1]
        phi = 2 * np.pi * ((column + u[:, 2]) / width - 0.5)
        ring = np.sqrt(np.maximum(0, 1 - y * y))
        direction = np.stack([ring * np.sin(phi), y, -ring * np.cos(phi)], axis=-1)
        density = self.density[row, column]
        weight = self.radiance[row, column] / density[:, None]
        world = direction @ transforms.rotation("y", self.turn).T
        return Sample(world, weight, density=density)

    def look(self, directions: Array) -> tuple[Array, Array]:
        """Return radiance (n, 3) and density (n,) along unit directions (n, 3)."""
        height, width = self.density.shape
        uv = transforms.latlong_uv(directions @ transforms.rotation("y", self.turn))
        column = np.minimum((uv[:, 0] * width).astype(np.int64), width - 1)
        row = np.minimum((uv[:, 1] * height).astype(np.int64), height - 1)
        return self.radiance[row, column], self.density[row, column]


class EmitterSampler:
    """All glowing faces of the traced meshes, sampled by power, near ones more; they glow to both
    sides."""

    def __init__(self, world: World) -> None:
        glow = luminance(world.emission)
        faces = np.flatnonzero(glow[world.material] > 0)
        power = glow[world.material[faces]] * _areas(world.triangles(faces))
        self.faces = faces[power > 0]
        self.number = np.full(len(world.material), -1, np.int64)
        self.number[self.faces] = np.arange(len(self.faces))
        corners = world.triangles(self.faces)
        self.corner = corners[:, 0]
        self.sides = np.stack([corners[:, i] - corners[:, 0] for i in (1, 2)], axis=1)
        cross = np.cross(self.sides[:, 0], self.sides[:, 1])
        self.normal = cross / np.linalg.norm(cross, axis=1, keepdims=True)
        self.emission = world.emission[world.material[self.faces]]
        if len(self.faces):
            self._cluster(corners, power[power > 0])

    def __len__(self) -> int:
        return len(self.faces)

    def _cluster(self, corners: Array, power: Array) -> None:
        middle = corners.mean(axis=1)
        # Of a triangle: the mean over its corners, by a quarter
        spread = np.sum((corners - middle[:, None]) ** 2, axis=(1, 2)) / 12
        self.clusters = Clusters.around(middle, spread, power)
        self.order = np.argsort(self.clusters.of, kind="stable")
        self.share = np.cumsum(power[self.order])
        count = np.bincount(self.clusters.of)
        self.stop = np.cumsum(count) - 1
        self.start = self.stop + 1 - count
        self.last = self.share[self.stop]
        self.first = np.concatenate([[0.0], self.last[:-1]])
        self.per_area = luminance(self.emission) / self.clusters.power[self.clusters.of]

    def sample(self, points: Array, u: Array) -> Sample:
        """Sample a cluster by what may come from it, a face by its power, a point evenly on it."""
        cluster, chance, rest = self.clusters.choose(points, u[:, 0])
        place = self.first[cluster] + rest * (self.last - self.first)[cluster]
        found = np.searchsorted(self.share, place, side="right")
        # Rounding at its end may not lead out of a cluster
        which = self.order[np.clip(found, self.start[cluster], self.stop[cluster])]
        offset = self.corner[which] + on_triangle(self.sides[which], u[:, 1:]) - points
        distance = np.sqrt(np.maximum(np.einsum("ij,ij->i", offset, offset), 1e-60))
        direction = offset / distance[:, None]
        density = chance * self._density(which, direction, distance)
        return Sample(
            direction,
            self.emission[which] / density[:, None],
            distance,
            density,
            self.faces[which],
        )

    def density(
        self, points: Array, face: NDArray[np.int32], directions: Array, distance: Array
    ) -> Array:
        """Density (n,) per steradian of `sample` on points (n, 3) along unit directions (n, 3) that
        meet glowing faces (n,) at a distance (n,) in metres."""
        which = self.number[face]
        chance = self.clusters.chance(points, self.clusters.of[which])
        return np.asarray(chance * self._density(which, directions, distance))

    def _density(self, which: NDArray[np.int64], directions: Array, distance: Array) -> Array:
        """Density (n,) per steradian within the faces' clusters."""
        cosine = np.abs(np.einsum("ij,ij->i", directions, self.normal[which]))
        return np.asarray(self.per_area[which] * distance**2 / np.maximum(cosine, 1e-12))


def _areas(corners: Array) -> Array:
    """Areas (n,) of triangles (n, 3, 3)."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(0.5 * np.linalg.norm(cross, axis=1))


def choose(share: Array, u: Array) -> tuple[NDArray[np.int64], Array]:
    """Return for each u (n,) in [0, 1) the first index whose cumulative share is above it, and how
    far u is into it, 0..1."""
    scaled = u * share[-1]
    found = np.minimum(np.searchsorted(share, scaled, side="right"), len(share) - 1)
    below = np.where(found > 0, share[found - 1], 0.0)
    width = share[found] - below
    rest = np.divide(scaled - below, width, where=width > 0, out=np.zeros(len(u)))
    return np.asarray(found, np.int64), np.clip(rest, 0, 1)


def on_triangle(sides: Array, u: Array) -> Array:
    """Return offsets (n, 3) spread evenly over triangles of sides (n, 2, 3) from a corner, by
    numbers u (n, 2)."""
    root = np.sqrt(u[:, 0])
    return root[:, None] * ((1 - u[:, 1])[:, None] * sides[:, 0] + u[:, 1][:, None] * sides[:, 1])
