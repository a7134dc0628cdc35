"""What studies of light among cubes share: worlds, gathers on the card, their price and error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from time import process_time
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bake import lightmap, voxels
from formats.errors import InputError
from formats.files import vox
from formats.lightmap import Faces, Lightmap
from formats.voxels import Voxels
from pipelines.studies.interval import Interval, blocks, ratio
from runtime.capture import make_context
from runtime.gather import Gather, Knobs
from runtime.shader import Programs
from runtime.voxel_world import VoxelVolume

Key = TypeVar("Key")
Float = NDArray[np.float32]

COURTYARD = Path(__file__).resolve().parents[2] / "assets" / "voxels" / "courtyard.vox"
GLOW = ("8", (21.0, 9.4, 2.7))
"""Palette index of the far side of the chamber, and what it sends out, W/(m2 sr)."""
NOOK = (slice(12, 28), slice(0, 12), slice(42, 60))
"""Cells (z, y, x) of the courtyard with the doorway, and half of the chamber behind it."""


@lru_cache(maxsize=1)
def own(path: Path) -> Voxels:
    """Return the user's world; where nothing in it glows, its most frequent cells do."""
    world = voxels.from_vox(vox.read(path), params=voxels.Params(0.25))
    if world.emission[world.cells].any():
        return world
    emission = world.emission.copy()
    emission[np.argmax(np.bincount(world.cells[world.cells > 0]))] = GLOW[1]
    return replace(world, emission=emission)


def worlds(source: Path | None) -> tuple[Voxels, Voxels]:
    """Return a world and a part of it: the courtyard, or the user's and its middle."""
    if source is None:
        return courtyard(), nook()
    world = own(source)
    middle = tuple(
        slice(max(0, (n - most) // 2), (n - most) // 2 + most if n > most else n)
        for n, most in zip(world.cells.shape, (16, 12, 18), strict=True)
    )
    part = replace(world, cells=np.ascontiguousarray(world.cells[middle]))
    return world, part if part.solid.any() and part.emission[part.cells].any() else world


@lru_cache(maxsize=1)
def courtyard() -> Voxels:
    """Return the world of the scene `cubeworld`, 60 x 24 x 46 cells; its chamber glows."""
    return voxels.from_vox(vox.read(COURTYARD), params=voxels.Params(0.25, emissive=(GLOW,)))


def nook() -> Voxels:
    """Return a part of the courtyard, 18 x 12 x 16 cells, that lies open where it was cut."""
    whole = courtyard()
    return replace(whole, cells=np.ascontiguousarray(whole.cells[NOOK]))


class Card:
    """A context and its programs; gathers made by it are freed with it."""

    def __init__(self) -> None:
        self.ctx = make_context()
        self._programs = Programs(self.ctx)
        self._made: list[Any] = []

    def volume(self, world: Voxels, **knobs: Any) -> VoxelVolume:
        """Return a volume; knobs : of VoxelVolume."""
        self._made.append(VoxelVolume(self.ctx, world, **knobs))
        return self._made[-1]

    def gather(
        self, world: Voxels, faces: Faces, *, storage: str = "rgba8", **knobs: Any
    ) -> Gather:
        """Return a gather that never ends by itself; knobs : of `runtime.gather`."""
        volume = self.volume(world, storage=storage, gaps=knobs.get("mode") == "sphere")
        knobs = {"error": 0.0, **knobs}
        made = Gather(self.ctx, self._programs, volume, faces, knobs=Knobs(**knobs))
        self._made.append(made)
        return made

    def single(self, volume: VoxelVolume, faces: Faces, **knobs: Any) -> Gather:
        """Return a gather that never ends by itself; who asks for it frees it."""
        knobs = {"error": 0.0, **knobs}
        return Gather(self.ctx, self._programs, volume, faces, knobs=Knobs(**knobs))

    def seconds(self, gather: Gather, passes: int) -> float:
        """Add passes; return processor seconds of all threads: software draws with those."""
        self.ctx.finish()
        started = process_time()
        gather.step(passes)
        self.ctx.finish()
        return process_time() - started

    def best(self, gathers: Mapping[Key, Gather], passes: int, rounds: int) -> dict[Key, float]:
        """Return milliseconds a pass of each, the best of so many rounds in turn."""
        # The first passes compile
        for gather in gathers.values():
            self.seconds(gather, 2)
        found = dict.fromkeys(gathers, np.inf)
        for number in range(rounds):
            order = list(gathers) if number % 2 else list(gathers)[::-1]
            for key in order:
                spent = 1e3 * self.seconds(gathers[key], passes) / passes
                found[key] = min(found[key], spent)
        return found

    def release(self) -> None:
        """Free everything."""
        for made in reversed(self._made):
            made.release()
        self.ctx.release()


@contextmanager
def card() -> Iterator[Card]:
    """Give a context for a study."""
    made = Card()
    try:
        with made.ctx:
            yield made
    finally:
        made.release()


def traced(world: Voxels, faces: Faces, rays: int, bounces: int = -1) -> Lightmap:
    """Return the light by so many rays of Embree a texel, and as many to what glows.

    InputError for a world where that lights nothing.
    """
    params = lightmap.Params(texels=faces.texels, rays=rays, bounces=bounces, target=0.0)
    found = lightmap.gather(world, faces, params=params)
    if not found.irradiance.any():
        remedy = "give a world in which what glows lights other faces"
        raise InputError("voxels", "light", "falls on no face", remedy)
    return found


def error_of(found: Float, truth: Float, used: NDArray[np.bool_]) -> float:
    """Return the error of irradiance (h, w, 3), RMS over texels over the RMS of the truth."""
    apart = np.asarray(found[used], np.float64) - truth[used]
    return float(np.sqrt(np.mean(apart**2) / np.mean(np.square(truth[used], dtype=np.float64))))


def interval_of(found: Float, truth: Float, used: NDArray[np.bool_]) -> Interval:
    """Return `error_of` with its interval, by blocks of the atlas: neighbours are alike."""
    parts, wholes = blocks_of(np.square(found - truth), np.square(truth), used)
    square = ratio(parts, wholes)
    return Interval(*(float(np.sqrt(v)) for v in (square.value, square.low, square.high)))


def blocks_of(
    parts: Float, wholes: Float, used: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the sums of two images (h, w, 3) over the used texels of each block of the atlas."""
    both = [np.where(used, v.sum(axis=2, dtype=np.float64), 0.0) for v in (parts, wholes)]
    sums = [blocks(v) for v in both]
    kept = sums[1] > 0
    return sums[0][kept], sums[1][kept]


def slope(passes: list[int], errors: list[float]) -> float:
    """Return the exponent of errors over passes, by least squares of logarithms."""
    return float(np.polyfit(np.log(passes), np.log(errors), 1)[0])
