"""The truth of pictures: a whole scene as declared, traced by paths, with error bars.

Unbiased but for what the scene means by its own words: lights themselves are not seen, the sky is
seen by the camera only and lights nothing, environments light and are not seen, sprites are the
meshes they were baked from, Lambert, turned to the camera as the player turns them, a world of
cubes is closed below, and lamps in it stand at their exact place. Samples of a pixel fall into
independent batches, each evenly spread over pixel and lens; the spread of the batches is the error
bar.

Pixels are traced in tiles over threads; a tile holds PATHS paths at a time, about 20 MB.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bake import (
    reference_air,
    reference_camera,
    reference_lights,
    reference_scene,
    workers,
)
from bake.reference_camera import Camera
from bake.reference_paths import Tracer
from bake.reference_world import World
from bake.tiles import kept
from formats.errors import InputError
from formats.files import exr
from formats.scene import Scene

Array = NDArray[np.float64]
Float = NDArray[np.float32]

BATCHES = 16
"""Most batches of a pixel's samples: the error bar is Student's with one degree less."""
PIXELS = 2048
"""Most pixels of a tile."""
PATHS = 16384
"""Paths traced at once by a thread."""


@dataclass(frozen=True)
class Params:
    """Knobs. width, height : pixels. time : seconds. samples : paths a pixel, at least 2, rounded
    up to a multiple of 16 above that. bounces : how often light goes from surface to surface beyond
    a light's own. shadows : False lets lights shine through everything, without bounces. lens :
    False takes a pinhole. seed : another seed, other noise."""

    width: int = 640
    height: int = 360
    time: float = 0.0
    samples: int = 64
    bounces: int = 2
    shadows: bool = True
    lens: bool = True
    seed: int = 0

    def check(self) -> None:
        """Raise InputError for the first knob that is out of its range."""
        ranges = {"width": (1, 16384), "height": (1, 16384), "samples": (2, 65536)}
        ranges |= {"bounces": (0, 1024), "seed": (0, 2**32 - 1)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high or value != int(value):
                remedy = f"choose a whole number from {low} to {high}"
                raise InputError("reference", name, value, remedy)
        if not math.isfinite(self.time):
            raise InputError("reference", "time", self.time, "give finite seconds")


@dataclass(frozen=True, eq=False)
class Reference:
    """A traced picture.

    radiance, error : (h, w, 3) float32, scene-linear before the film, and its standard error.
    distance : (h, w) float32, mean metres to what was seen, infinite where all was sky. coverage :
    (h, w) float32, share of the samples that met a surface. samples : a pixel. rays : cast in all.
    notes : what was left out.
    """

    radiance: Float
    error: Float
    distance: Float
    coverage: Float
    samples: int
    rays: int
    notes: tuple[str, ...] = ()

    def save(self, path: Path) -> None:
        """Write an EXR with the parts `beauty` and `error`, float32."""
        exr.write(path, {"beauty": self.radiance, "error": self.error})


@dataclass(frozen=True, eq=False)
class Tile:
    """What a run of pixels gave, arrays of n or (n, 3)."""

    mean: Array
    error: Array
    distance: Array
    coverage: Array
    rays: int


@dataclass(frozen=True, eq=False)
class Standing:
    """What stands in a scene at one moment, for rays. notes : what was left out."""

    world: World
    notes: tuple[str, ...]


def stand(scene: Scene, time: float) -> Standing:
    """Read and place what stands in a scene at `time` seconds, as its camera sees it: sprites turn
    with it. Raises InputError as `render` does."""
    camera = reference_camera.at(scene, time, (1, 1))
    parts, notes = reference_scene.parts_of(scene, time, camera.yaw, camera.position)
    return Standing(World(reference_scene.merged(parts), scene.ground), tuple(notes))


def render(
    scene: Scene,
    *,
    params: Params,
    progress: workers.Progress = workers.silent,
    standing: Standing | None = None,
) -> Reference:
    """Trace a scene. standing : of `stand`, where the same moment is traced again. Raises
    InputError for knobs out of range, sources that cannot be read, and scenes of too many
    triangles."""
    params.check()
    size = params.width, params.height
    camera = reference_camera.at(scene, params.time, size, lens=params.lens)
    standing = standing or stand(scene, params.time)
    world = standing.world
    lights = reference_lights.at(scene, params.time, world, shadows=params.shadows)
    air = reference_air.at(scene, params.time)
    tracer = Tracer(world, lights, air, bounces=params.bounces, shadows=params.shadows)
    batches, each = layout(params.samples)
    pixels, step = params.width * params.height, max(1, min(PIXELS, PATHS // each))
    spans = [(start, min(start + step, pixels)) for start in range(0, pixels, step)]
    tiles = kept(
        lambda span: _tile(tracer, camera, span, batches, each, params.seed),
        spans,
        progress,
        (Tile,),
    )
    shape = params.height, params.width

    def whole(name: str) -> Float:
        rows = np.concatenate([getattr(tile, name) for tile in tiles])
        return rows.reshape(*shape, *rows.shape[1:]).astype(np.float32)

    return Reference(
        radiance=whole("mean"),
        error=whole("error"),
        distance=whole("distance"),
        coverage=whole("coverage"),
        samples=batches * each,
        rays=sum(tile.rays for tile in tiles),
        notes=standing.notes,
    )


def layout(samples: int) -> tuple[int, int]:
    """Return into how many batches samples fall, and how many there are in each.

    >>> layout(4), layout(64), layout(100)
    ((4, 1), (16, 4), (16, 7))
    """
    batches = min(samples, BATCHES)
    return batches, -(-samples // batches)


def _tile(
    tracer: Tracer, camera: Camera, span: tuple[int, int], batches: int, each: int, seed: int
) -> Tile:
    pixel = np.arange(*span)
    n, rays, found = len(pixel), 0, []
    seen, covered = np.zeros(n), np.zeros(n)
    together = max(1, PATHS // (each * n))
    for start in range(0, batches, together):
        batch = np.arange(start, min(start + together, batches))
        paths = tracer.trace(camera.rays(pixel, batch, each, seed))
        found.append(paths.radiance.reshape(len(batch), each, n, 3).mean(axis=1))
        distance = paths.distance.reshape(-1, n)
        met = np.isfinite(distance)
        covered += met.sum(axis=0)
        seen += np.where(met, distance, 0).sum(axis=0)
        rays += paths.rays
    means = np.concatenate(found)
    distance = np.divide(seen, covered, where=covered > 0, out=np.full(n, np.inf))
    error = means.std(axis=0, ddof=1) / np.sqrt(batches)
    return Tile(means.mean(axis=0), error, distance, covered / (batches * each), int(rays))
