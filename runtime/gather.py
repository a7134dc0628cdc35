"""Light in a world of cubes, gathered on the card while it plays: one ray a texel a pass.

The estimator is that of `bake/lightmap_rays.py`: directions along the cosine and points on glowing
faces take turns, weighed by the balance heuristic, so that a pass costs the same whatever glows.
Sums are float32. What surfaces hand on is kept apart from what glows, for it has to be found again
when light changes (`runtime/gather_schedule.py`). Where light may have changed, sums begin anew and
what was shown fades by half every four passes; elsewhere they go on.

Passes belong to two sets with shifts of their own, in turn. Half the difference of their means is
the error of a texel's own rays: with evenly spread rays the variance of samples would overstate it.
That of the light handed on, which both sets share, comes on top (`runtime/gather_error.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.lightmap_faces import Faces
from maths.colour import luminance
from runtime import gather_error, gather_schedule, light_sights, light_uniforms, reuse
from runtime.gather_draws import Draws
from runtime.gather_targets import Targets
from runtime.shader import Programs
from runtime.voxel_lamps import FreeLamp, Lamps
from runtime.voxel_world import Adopt, Box, Change, Glow, VoxelVolume, adopt_nothing

MODES = ("exact", "sphere", "march", "talk")
FORGET = 0.25
"""Of the target: a change of irradiance, over its RMS, that starts sums anew."""
MEASURE = 64
"""Passes between looks at the sums."""
EVERYTHING = 1e30
"""Radiance of a change that may reach all texels."""


@dataclass(frozen=True)
class Knobs:
    """mode : how rays are followed.  bounces : from 0; -1 for all.  error : relative, RMS over
    texels, at which passes end; 0 for never.  most : passes after a change at which they end in
    any case.
    samples : points on a ray of mode `march`.  seed : of the shifts.  spread : evenly spread rays,
    or independent ones to compare with.  aim : half the rays at what glows.  visits : gather the
    number of cells that a ray looks at in place of light.  downsample : texels along a side of a
    cell that are shown as their mean; it divides those that a cell has.  falloff : A (square
    metres) and B of mode `talk`; A is 1.5 faces of a cell unless given, what a cube shows on
    average."""

    mode: str = "exact"
    bounces: int = -1
    error: float = 0.02
    most: int = 1 << 16
    samples: int = 20
    seed: int = 0
    spread: bool = True
    aim: bool = True
    visits: bool = False
    downsample: int = 1
    falloff: tuple[float, float] | None = None

    def check(self) -> None:
        """Raise InputError for the first knob out of its range."""
        if self.mode not in MODES:
            raise InputError("gather", "mode", self.mode, f"choose from {', '.join(MODES)}")
        ranges = {
            "bounces": (-1, 1000),
            "error": (0, 1),
            "most": (2, 1 << 22),
            "samples": (1, 1000),
            "downsample": (1, 64),
        }
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError("gather", name, value, f"choose from {low} to {high}")


class Gather:
    """Gathers the light of a volume on to a layout of its faces.

    environment : (h, w, 3) lat-long radiance that rays out of the world see; None for black.
    free : lamps that move freely among the cells; their number stays, and mode `talk` has none.
    lights : runtime.lighting.Lights in cells, of which the same holds; None for none.
    adopt : called with each texture made and its bytes. Raises InputError for knobs out of range.
    """

    def __init__(
        self,
        ctx: Any,
        programs: Programs,
        volume: VoxelVolume,
        faces: Faces,
        *,
        knobs: Knobs = Knobs(),
        environment: NDArray[np.float32] | None = None,
        free: Sequence[FreeLamp] = (),
        lights: Any = None,
        adopt: Adopt = adopt_nothing,
    ) -> None:
        knobs.check()
        if faces.texels % knobs.downsample:
            remedy = f"choose a divisor of the {faces.texels} texels of a cell side"
            raise InputError("gather", "downsample", knobs.downsample, remedy)
        if knobs.mode == "sphere" and volume.gaps is None:
            raise InputError("gather", "mode", "sphere", "make the volume with gaps=True")
        self.volume, self.faces, self.knobs = volume, faces, knobs
        self._ctx, self._programs = ctx, programs
        self.targets = Targets(ctx, faces, adopt)
        self.lamps = Lamps(ctx, adopt, destinations=knobs.mode == "talk", aim=knobs.aim)
        self.lamps.update(volume)
        self._free = tuple(free) if knobs.mode != "talk" else ()
        self._lights = lights if knobs.mode != "talk" else None
        self._bounces = 0 if knobs.mode == "talk" or knobs.visits else knobs.bounces
        self._settled = gather_schedule.settling(self._albedo(), knobs.error)
        if environment is not None:
            self.targets.set_sky(environment)
        self._draws = self._make_draws()
        self._brightness, self._measured = 0.0, -MEASURE
        self.passes = self._start = 0
        self._error: float | None = None
        self._pairs = gather_schedule.pairs(self._bounces, self._settled)

    # what it does

    def step(self, passes: int) -> int:
        """Add passes, in pairs, unless the light has settled; returns how many."""
        done = 0
        while done < passes and not (self.since % MEASURE == 0 and self.converged):
            pair = next(self._pairs)
            self._draws.cast(
                self.passes // 2,
                pair,
                self.volume,
                self.lamps,
                self.knobs.seed,
                self._free,
                self._lights,
            )
            if pair.send and self._bounces != 0:
                self._draws.send(pair.send, self.volume, one_by_one=self._bounces > 0)
            self.passes += 2
            self._error = None
            done += 2
        if done:
            self._draws.show(self.targets.lightmap_buffer, self.knobs.downsample, calm=True)
        return done

    def update(
        self,
        cells: NDArray[Any] | None = None,
        boxes: Sequence[Box] = (),
        glows: Sequence[Glow] | None = None,
    ) -> list[Change]:
        """Take over the cells (nz, ny, nx) of some boxes, and lamps; returns what changed."""
        changes: list[Change] = []
        if cells is not None:
            changes += self.volume.set_cells(cells, boxes)
        if glows is not None:
            changes += self.volume.set_glow(glows)
        self.changed(changes)
        return changes

    def set_free(self, lamps: Sequence[FreeLamp]) -> None:
        """Move the free lamps: as many as there were. Light begins anew where they matter."""
        if self.knobs.mode == "talk":
            return
        pairs = list(zip(self._free, lamps, strict=True))
        moved = [lamp.change for pair in pairs if pair[0] != pair[1] for lamp in pair]
        self._free = tuple(lamps)
        if moved:
            self._begin_anew(moved)

    def set_lights(self, lights: Any) -> None:
        """Take the scene's lights as they are now, in cells. Light begins anew where they matter,
        everywhere for a sun."""
        if self._lights is None or reuse.frozen(lights) == reuse.frozen(self._lights):
            return
        moved = [
            _change(ball, self.volume.size)
            for old, new in zip(*map(light_sights.one_by_one, (self._lights, lights)), strict=True)
            if reuse.frozen(old) != reuse.frozen(new)
            for ball in (*light_sights.balls(old), *light_sights.balls(new))
        ]
        self._lights = lights
        self._begin_anew(moved)

    def set_environment(self, radiance: NDArray[np.float32]) -> None:
        """Take another map (h, w, 3) for what rays out of the world see; all light begins anew."""
        if self.targets.set_sky(radiance):
            self._draws.release()
            self._draws = self._make_draws()
        self._begin_anew([Change((0, 0, 0), self.volume.size, EVERYTHING)])

    def changed(self, changes: Sequence[Change]) -> None:
        """Take changes of the volume: list what glows anew, and let sums begin anew wherever the
        light of these boxes may reach."""
        if changes:
            self.lamps.update(self.volume)
            self._begin_anew(changes)

    def _begin_anew(self, changes: Sequence[Change]) -> None:
        # Before the first pass there is nothing to forget
        if self.passes:
            if self.passes - self._measured >= MEASURE:
                self._measure()
            self._draws.change(changes, FORGET * self.knobs.error * self._brightness)
        self._restart()

    # what it found

    @property
    def since(self) -> int:
        """Passes since the last change."""
        return self.passes - self._start

    @property
    def converged(self) -> bool:
        """Whether the light has settled: passes add nothing until something changes."""
        if self.since < 2 * self._settled:
            return False
        if self.since >= self.knobs.most:
            return True
        return self.knobs.error > 0 and self.error() <= self.knobs.error

    def error(self) -> float:
        """Relative standard error, RMS over texels over RMS irradiance; 0 in the dark."""
        if self._error is None:
            self._error = self._measure()
        return self._error

    def bars(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the standard error (h, w) of each texel's luminance, W/m2, 0 where none is, and
        its degrees of freedom."""
        sums, used = self._sums()
        own, count = gather_error.pooled(sums.variance, used, self.faces)
        found, degrees = np.zeros(used.shape), np.ones(used.shape)
        found[used] = np.sqrt(own + (sums.handed_on() * sums.indirect) ** 2)
        degrees[used] = count
        return found, degrees

    def lightmap(self) -> Any:
        """Return the RGBA16F texture of irradiance, bilinear, gutters filled; alpha 1 where a texel
        has light, 0 where it is covered or unused."""
        return self.targets.lightmap

    def read(self) -> NDArray[np.float32]:
        """Return irradiance (h, w, 3), W/m2, gutters filled."""
        buffer = self.targets.exact_buffer()
        self._draws.show(buffer, self.knobs.downsample, calm=False)
        w, h = self.faces.size
        raw = buffer.read(components=4, dtype="f4")
        return np.frombuffer(raw, np.float32).reshape(h, w, 4)[..., :3].copy()

    def release(self) -> None:
        """Free all textures and framebuffers of the gather; the volume stays."""
        self._draws.release()
        self.targets.release()
        self.lamps.release()

    # pieces

    def _restart(self) -> None:
        self._start = self.passes
        self._error = None
        self._pairs = gather_schedule.pairs(self._bounces, self._settled)

    def _albedo(self) -> float:
        """Return the albedo that a hundredth of all cells with faces reaches."""
        rows = self.volume.cells[self.faces.page_of > 0]
        return float(np.quantile(self.volume.albedo.max(axis=1)[rows], 0.99))

    def _make_draws(self) -> Draws:
        knobs, area = self.knobs, self.volume.cell_size**2
        defines = {
            **self.volume.defines,
            "MODE": MODES.index(knobs.mode),
            "SKY": self.targets.has_sky,
            "BOUNCES": self._bounces != 0,
            "SPREAD": knobs.spread,
            "FREE": len(self._free),
            "VISITS": knobs.visits and knobs.mode != "talk",
            **light_uniforms.counts_of(self._lights),
        }
        A, B = knobs.falloff or (1.5 * area, 0.0)
        cast = {
            "size": self.volume.size,
            "n": self.faces.texels,
            "samples": knobs.samples,
            # In cells
            "falloff": (A / area, B),
        }
        return Draws(self._ctx, self._programs, self.targets, defines, cast, self._settled)

    def _measure(self) -> float:
        """Read the sums: relative error; keeps how bright the world is."""
        sums, _ = self._sums()
        self._measured = self.passes
        self._brightness = float(np.sqrt(np.mean(sums.light**2))) if len(sums.light) else 0.0
        return sums.relative_error()

    @cached_property
    def _cell(self) -> NDArray[np.int32]:
        return self.faces.cell()

    def _sums(self) -> tuple[gather_error.Sums, NDArray[np.bool_]]:
        """Read the sums of texels in use, and which (h, w) those are."""
        light, difference, passes, handed, rays = self.targets.read_sums()
        used = passes > 0
        count = passes[used].astype(np.float64)
        older, later = np.ones_like(count), 1.0
        if self._bounces != 0:
            cast = count / self._draws.passes_per_ray(self.lamps, self._free)
            older = np.maximum(cast / np.maximum(rays[used], 1.0), 1.0)
        if self._bounces < 0:
            chain = 2.0 * gather_schedule.CHAIN * self._settled
            later = max(0.0, 1.0 - chain / max(self.since, 1))
        rows = self.volume.cells.ravel()[self._cell[used]]
        sums = gather_error.Sums(
            light=np.asarray(luminance(light[used]), np.float64),
            indirect=np.asarray(luminance(handed[used]), np.float64),
            albedo=np.asarray(luminance(self.volume.albedo[rows]), np.float64),
            apart=difference[used] / count,
            older=older,
            renewed=1.0 + (gather_error.RENEWED - 1.0) * later,
        )
        return sums, used


def _change(ball: Any, size: tuple[int, int, int]) -> Change:
    """What changes where a light comes or goes, of a ball that holds it; None for a sun."""
    if ball is None:
        return Change((0, 0, 0), size, EVERYTHING)
    middle, radius, radiance = ball
    low, high = np.floor(middle - radius), np.ceil(middle + radius)
    return Change(tuple(low.astype(int).tolist()), tuple(high.astype(int).tolist()), radiance)
