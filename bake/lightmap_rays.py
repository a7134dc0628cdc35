"""Rays of texels on cubes: what they find by the cosine, and samples of all that glows.

A texel's irradiance is the integral of radiance times cosine. Light that faces send out by
themselves is found twice, by directions spread as the cosine and by points on glowing faces, chosen
by power through an alias table; so is an environment. The balance heuristic weighs the two (Veach,
Guibas 1995, *Optimally Combining Sampling Techniques for Monte Carlo Rendering*): every sample
counts `L cos / (sum of n_i p_i)`, at most pi L / n however close the light is. What a
surface hands on is found by the cosine alone: those rays' ends are kept for the bounces.

Numbers come from additive recurrences (Roberts 2018), shifted by a hash of the face, the texel on
it, the set, and the dimension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake.lightmap_lights import LampRays
from bake.lightmap_surface import Surface, along_normals
from bake.reference_emission import EnvironmentSampler
from maths.alias_table import AliasTable
from maths.colour import luminance
from maths.hashing import uniform01

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

NEAR = 1 - 2e-5
"""Share of the way to a glowing face that nothing may block."""
GOLDEN = {2: 1.3247179572447460, 3: 1.2207440846057596}
"""Real roots of g^(d+1) = g + 1: the recurrence steps by powers of 1/g."""


@dataclass(frozen=True)
class Run:
    """Which rays are cast: numbers start to stop of set `number`. independent : by independent
    random numbers, to compare with."""

    number: int
    start: int
    stop: int
    independent: bool = False

    @property
    def count(self) -> int:
        """Rays a texel."""
        return self.stop - self.start


class Tracer:
    """Casts the rays of one world. environment : (h, w, 3) lat-long radiance; None for black.
    sample_lights : False leaves all to the cosine. others : lights that are not part of it."""

    def __init__(
        self,
        surface: Surface,
        environment: Array | None,
        *,
        sample_lights: bool = True,
        others: LampRays | None = None,
    ) -> None:
        self.surface = surface
        self.n = len(surface)
        self.glows = np.append(surface.emission.any(axis=1), False)
        self.emission = np.concatenate([surface.emission, np.zeros((1, 3), np.float32)])
        self.sky = None
        if environment is not None and environment.any():
            self.sky = EnvironmentSampler.of_map(np.asarray(environment, np.float64), 0.0)
        self.sample_lights = sample_lights
        self.others = others
        # One lamp is one face of a cell, told by its first texel
        cell_face = surface.cell * 6 + surface.face
        lit = np.flatnonzero(self.glows[:-1])
        _, chosen, inverse = np.unique(cell_face[lit], return_index=True, return_inverse=True)
        self.lamps = lit[chosen]
        self.lamp_of = np.full(self.n + 1, -1, np.int64)
        self.lamp_of[lit] = inverse
        self.table: AliasTable | None = None
        if len(lit):
            self.table = AliasTable.of(luminance(surface.emission[self.lamps].astype(np.float64)))
        self.corners = surface.lowest_corners(self.lamps)

    def tile(self, which: Indices, face: int, run: Run) -> tuple[Array, NDArray[np.int32], int]:
        """Trace texels (m,) that all look one way.

        Returns irradiance (m, 3) of what glows, the texels (count, m) that rays met, self.n for
        none, and how many rays slipped between rectangles and were followed by cells.
        """
        starts = self.surface.starts(which, face)
        m, count = len(which), run.count
        u = self._numbers(which, run, 0, 2).astype(np.float32)
        np.minimum(u, np.float32(1 - 2.0**-24), out=u)
        # Polar coordinates keep a shifted pattern whole
        z = np.sqrt(np.float32(1) - u[0])
        radius, phi = np.sqrt(u[0]), np.float32(2 * np.pi) * u[1]
        local = (-z if face % 2 else z, radius * np.cos(phi), radius * np.sin(phi))
        directions = np.empty((m, count, 3), np.float32)
        for i, values in enumerate(local):
            directions[..., (face // 2 + i) % 3] = values
        rays = directions.reshape(-1, 3)
        ends = self.surface.cast(np.repeat(starts, count, axis=0), rays)
        total = np.zeros((m, 3))
        if self.table is not None:
            lit = np.flatnonzero(self.glows[ends.texel])
            cosine, met = z.reshape(-1)[lit], ends.texel[lit]
            other = self._lamp_density(met, ends.distance[lit], -ends.towards[lit])
            weight = cosine / (count * (cosine / np.pi + other))
            _add(total, lit // count, weight, self.emission[met])
            if self.sample_lights:
                self._sample_lamps(total, which, starts, face, run)
        if self.sky is not None:
            away = np.flatnonzero(ends.face < 0)
            seen, density = self.sky.look(rays[away].astype(np.float64))
            sky_cosine = z.reshape(-1)[away].astype(np.float64)
            weight = 1 / (count * (sky_cosine / np.pi + density * self.sample_lights))
            _add(total, away // count, sky_cosine * weight, seen)
            if self.sample_lights:
                self._sample_sky(total, which, starts, face, run)
        self._sample_others(total, which, starts, face, run)
        kept = np.ascontiguousarray(ends.texel.reshape(m, count).T, np.int32)
        return total, kept, ends.slipped

    def _sample_lamps(
        self, total: Array, which: Indices, starts: Float, face: int, run: Run
    ) -> None:
        """Add samples of glowing faces, as many as rays."""
        if self.table is None:
            return
        count, scene = run.count, self.surface.scene
        u = self._numbers(which, run, 2, 3).reshape(3, -1)
        lamp = self.table.choose(u[0])
        texel = self.lamps[lamp]
        looks = self.surface.face[texel]
        end = self.corners[lamp]
        side = np.float32(scene.scale)
        row = np.arange(len(lamp))
        for i in (1, 2):
            end[row, (looks // 2 + i) % 3] += side * u[i].astype(np.float32)
        owner = row // count
        to = end - starts[owner]
        rise = -to[:, face // 2] if face % 2 else to[:, face // 2]
        fall = -along_normals(to, looks)
        seen = np.flatnonzero((rise > 0) & (fall > 0))
        to, owner, rise, fall = to[seen], owner[seen], rise[seen], fall[seen]
        hits = scene.intersect(starts[owner], to, finite=True)
        free = np.flatnonzero((hits.distance > NEAR) | (hits.face < 0))
        to, owner, seen = to[free], owner[free], seen[free]
        distance = np.sqrt(np.einsum("ij,ij->i", to, to, dtype=np.float64))
        cosine = rise[free] / distance
        density = self._lamp_density(texel[seen], distance, fall[free] / distance)
        weight = cosine / (count * (cosine / np.pi + density))
        _add(total, owner, weight, self.emission[texel[seen]])

    def _sample_sky(self, total: Array, which: Indices, starts: Float, face: int, run: Run) -> None:
        """Add samples of the environment, as many as rays."""
        if self.sky is None:
            return
        u = self._numbers(which, run, 5, 3).reshape(3, -1).T
        found = self.sky.sample(np.zeros((len(u), 3)), u)
        rise = found.direction[:, face // 2] * (-1 if face % 2 else 1)
        up = np.flatnonzero(rise > 0)
        owner, towards = up // run.count, found.direction[up].astype(np.float32)
        hidden = self.surface.scene.occluded(starts[owner], towards, finite=True)
        up, owner = up[~hidden], owner[~hidden]
        density = 1.0 if found.density is None else found.density[up]
        # The sampler gives radiance over its density
        weight = rise[up] * density / (run.count * (rise[up] / np.pi + density))
        _add(total, owner, weight, found.weight[up])

    def _sample_others(
        self, total: Array, which: Indices, starts: Float, face: int, run: Run
    ) -> None:
        """Add samples of each light of the scene, as many as rays."""
        for number in range(len(self.others or ())):
            assert self.others is not None
            u = self._numbers(which, run, 8 + 2 * number, 2).reshape(2, -1).T
            repeated = np.repeat(starts, run.count, axis=0)
            found = self.others.irradiance(repeated, face, number, u)
            total += found.reshape(len(which), run.count, 3).mean(axis=1)

    def _lamp_density(
        self, texel: Indices, distance: NDArray[np.floating], cosine: Float | Array
    ) -> Array:
        """Density (k,) per steradian of samples of lamps, in unit space; 0 without sampling."""
        if not self.sample_lights or self.table is None:
            return np.zeros(len(texel))
        per_area = self.table.share[self.lamp_of[texel]] / self.surface.scene.scale**2
        squared = np.square(np.asarray(distance, np.float64))
        return np.asarray(per_area * squared / np.maximum(cosine, 1e-12))

    def _numbers(self, which: Indices, run: Run, first: int, dimensions: int) -> Array:
        """Return numbers (dimensions, m, count) in [0, 1)."""
        index = np.arange(run.start, run.stop)
        found = np.empty((dimensions, len(which), run.count))
        key = self.surface.key[which]
        for d in range(dimensions):
            if run.independent:
                name = (key[:, None], run.number, first + d, index)
                found[d] = uniform01(*name)
                continue
            shift = uniform01(key, run.number, first + d)
            points = np.mod(0.5 + index * GOLDEN[dimensions] ** -(d + 1), 1.0)
            np.add(shift[:, None], points, out=found[d])
            found[d] -= found[d] >= 1
        return found


def _add(
    total: Array, owner: Indices, weight: NDArray[np.floating], radiance: NDArray[np.floating]
) -> None:
    """Add weighted radiance (k, 3) to the rows `owner` (k,) of totals (m, 3)."""
    for channel in range(3):
        values = np.asarray(weight * radiance[:, channel], np.float64)
        total[:, channel] += np.bincount(owner, values, minlength=len(total))
