"""Rounds of rays from texels, and the light that they hand on.

Rays come in sets, each spread by a shift of its own; all sets of a round have equally many rays.
In a set, rays gather what glows, and where they end is kept: light is then handed on as often as
is wanted by reading the texels at those ends (a radiosity by point samples). As a texel never sees
itself, the mean over sets has no bias worth the name, and the spread of the sets is the error.

References
----------
Cohen, Wallace 1993, Radiosity and Realistic Image Synthesis, ch. 4 (point-sampled form factors).
L'Ecuyer, Lemieux 2002, Recent Advances in Randomized Quasi-Monte Carlo Methods (error bars from
replicated shifts).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bake import workers
from bake.lightmap_rays import Run, Tracer
from bake.lightmap_surface import Surface
from bake.tiles import once
from formats.lightmap import Faces, Lightmap
from maths import intervals

Array = NDArray[np.float64]
Ended = tuple[NDArray[np.int64], NDArray[np.int32]]
"""Texels (m,), and what their rays met (count, m)."""

SETS = 8
"""Sets of a round: the spread of eight tells an error to a quarter."""
TILE = 1 << 16
"""Rays in memory at once, a thread."""
MAX_ENDS = 1 << 26
"""Ends of rays in memory at once."""
FEW = 16
"""Tiles that are not worth threads in a bounce."""
REST = 0.003
"""Share of the light that is still to be handed on when the rest is taken as a geometric series."""
MOST = 1000
"""Bounces at which a series ends in any case: albedo .98 has .98^1000 = 2e-9 left."""


@dataclass(eq=False)
class Gathering:
    """Sums over rounds: mean and variance of the mean (T, 3), weighed by rays.

    bounces : how often light is handed on, -1 for all.  spread : False for independent numbers.
    seed : of the rays.
    """

    surface: Surface
    tracer: Tracer
    bounces: int
    spread: bool
    seed: int = 0
    rays: int = 0
    sets: int = 0
    slipped: int = 0
    handed_on: int = 0
    mean: Array = field(init=False)
    variance: Array = field(init=False)

    def __post_init__(self) -> None:
        self.mean = np.zeros((len(self.surface), 3))
        self.variance = np.zeros_like(self.mean)
        self.active = np.flatnonzero(self.surface.atlas >= 0)
        self.rounds: list[int] = []

    def add_round(self, count: int, most: int, progress: workers.Progress) -> None:
        """Gather SETS sets of `count` rays; `most` is the limit, for the progress alone."""
        mean, squares = np.zeros_like(self.mean), np.zeros_like(self.mean)
        for k in range(SETS):
            begun = self.rays / SETS + count * k / SETS
            found = self._set(count, partial(_scaled, progress, begun / most, count / SETS / most))
            self.sets += 1
            # Welford's update
            difference = found - mean
            mean += difference / (k + 1)
            squares += difference * (found - mean)
        share = count * SETS / (self.rays + count * SETS)
        self.mean += share * (mean - self.mean)
        self.variance *= (1 - share) ** 2
        self.variance += share**2 * squares / (SETS * (SETS - 1))
        self.rays += count * SETS
        self.rounds.append(count)

    def relative_error(self) -> float:
        """Standard error over light, both RMS over texels and channels; 0 in the dark."""
        power = float(np.sum(self.mean[self.active] ** 2))
        return float(np.sqrt(self.variance[self.active].sum() / power)) if power > 0 else 0.0

    def degrees(self) -> float:
        """Degrees of freedom of the variance: its rounds add up by their rays, as the variance of
        one with n of the N rays counts (n / N)^2 and is as 1 / n where numbers are independent."""
        return intervals.effective_degrees(self.rounds, SETS - 1)

    def result(self, faces: Faces) -> Lightmap:
        """Put the light where the layout has it."""
        w, h = faces.size
        at = self.surface.atlas[self.active]
        maps = []
        for values in (self.mean, np.sqrt(self.variance)):
            found = np.zeros((h * w, 3), np.float32)
            found[at] = values[self.active]
            maps.append(found.reshape(h, w, 3))
        quality = {
            "rays": self.rays,
            "sets": self.sets,
            "bounces": self.handed_on,
            "texels": len(at),
            "relative_error": self.relative_error(),
            "coverage_factor": intervals.coverage_factor(self.degrees()),
            "rays_walked": self.slipped,
            "mean_irradiance": self.mean[self.active].mean(axis=0),
            "glowing_faces": len(self.tracer.lamps),
        }
        return Lightmap(maps[0], maps[1], faces, quality)

    def _set(self, count: int, progress: workers.Progress) -> Array:
        """Return the light (T, 3) by one set of rays."""
        total = np.zeros_like(self.mean)
        step = max(1, min(count, MAX_ENDS // max(1, len(self.active))))
        for start in range(0, count, step):
            stop = min(start + step, count)
            run = Run((self.seed << 16) + self.sets, start, stop, not self.spread)
            part = partial(_scaled, progress, start / count, (stop - start) / count)
            light, slipped, bounces = once(partial(self._batch, run, part))
            total += light * (stop - start)
            self.slipped += slipped
            self.handed_on = max(self.handed_on, bounces)
            progress(stop / count)
        return total / count

    def _batch(self, run: Run, progress: workers.Progress) -> tuple[Array, int, int]:
        """Trace and hand on. Return light (T, 3), rays that slipped, and how many bounces."""
        tiles = self._tiles(run.count)
        traced = workers.map_tiles(lambda tile: self.tracer.tile(*tile, run), tiles, progress)
        first, slipped = np.zeros((len(self.surface) + 1, 3)), 0
        for (which, _), (found, _, slips) in zip(tiles, traced, strict=True):
            first[which] = found
            slipped += int(slips)
        ends = [(which, met) for (which, _), (_, met, _) in zip(tiles, traced, strict=True)]
        light, bounces = self._handed_on(first, ends)
        return light[:-1], slipped, bounces

    def _tiles(self, count: int) -> list[tuple[NDArray[np.int64], int]]:
        """Share the texels out, all of a tile looking one way."""
        size, found = max(1, TILE // count), []
        looks = self.surface.face[self.active]
        for face in range(6):
            which = self.active[looks == face]
            found += [(which[i : i + size], face) for i in range(0, len(which), size)]
        return found

    def _handed_on(self, first: Array, ends: list[Ended]) -> tuple[Array, int]:
        """Return light (T + 1, 3) with its bounces, and how many those are. ends : texels, and what
        their rays met."""
        albedo = np.append(self.surface.albedo, np.zeros((1, 3), np.float32), axis=0)
        total, last, count = first.copy(), first, 0
        limit = MOST if self.bounces < 0 else self.bounces
        for bounce in range(limit if albedo.any() else 0):
            before = last.sum(axis=0)
            last = _bounce(albedo * last, ends)
            total += last
            count = bounce + 1
            now = last.sum(axis=0)
            if not now.any():
                break
            # By and by each bounce is the last one times a number
            ratio = np.minimum(now / np.where(before > 0, before, 1), 1 - 1 / MOST)
            rest = ratio / (1 - ratio)
            if self.bounces < 0 and np.all(rest * now <= REST * total.sum(axis=0)):
                total += rest * last
                break
        return total, count


def _scaled(progress: workers.Progress, start: float, length: float, fraction: float) -> None:
    progress(start + length * fraction)


def _bounce(sent: Array, ends: list[Ended]) -> Array:
    """Return light (T + 1, 3) that comes from surfaces which send out `sent` (T + 1, 3) / pi."""

    def tile(ended: Ended) -> Array:
        met = ended[1]
        total = np.zeros((met.shape[1], 3))
        for row in met:
            total += sent.take(row, axis=0)
        return total / len(met)

    # Few tiles are done before threads have started
    few = len(ends) < FEW
    values = [tile(each) for each in ends] if few else workers.map_tiles(tile, ends)
    found = np.zeros_like(sent)
    for (which, _), light_of_tile in zip(ends, values, strict=True):
        found[which] = light_of_tile
    return found
