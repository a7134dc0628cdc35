"""Traces a picture coarsely, then finer, then better and better: work for a process beside."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.scene import Scene
from pipelines.beside import Tell
from runtime.truth import Traced

COARSE = (8, 4, 2)  # pixels a side that first share one traced pixel
FIRST, EACH = 4, 16  # paths a pixel of the first whole picture, and of each that is added to it
MOST = 1024  # paths a pixel, then it is done
PLACING = "placing what stands in the scene"
MANY = 40  # sprites of a set that is left out of the first picture
FEWER = "sets of many sprites are to come"
BLURRED = "radial blur is left out"


@dataclass(frozen=True)
class Request:
    """What to trace: a scene whose camera stands still, seconds, (width, height) pixels, threads
    (0: one a core)."""

    scene: Scene
    time: float
    size: tuple[int, int]
    threads: int = 0


def trace(request: Request, tell: Tell) -> None:
    """Trace coarsely, then finer, then better and better; tell what goes on and each picture."""
    from bake import reference, reference_cubes, workers

    workers.use(request.threads)
    scene, (width, height) = request.scene, request.size
    bounces = max(reference.Params.bounces, reference_cubes.bounces(scene))

    def render(share: int, samples: int, seed: int, said: str, standing: Any) -> Any:
        last = -1

        def progress(fraction: float) -> None:
            nonlocal last
            now = int(100 * fraction)
            tell(f"tracing {said}, {now} %" if now != last else None)
            last = now

        params = reference.Params(
            width=-(-width // share),
            height=-(-height // share),
            time=request.time,
            samples=samples,
            bounces=bounces,
            seed=seed,
        )
        return reference.render(scene, params=params, progress=progress, standing=standing)

    def coarsely(share: int, standing: Any, notes: tuple[str, ...]) -> None:
        if min(width, height) >= 4 * share:
            found = render(share, FIRST, 0, "coarsely", standing)
            large = found.radiance.repeat(share, axis=0).repeat(share, axis=1)[:height, :width]
            samples = found.samples / share**2
            tell(Traced(_film(large, scene, request.time), samples, _error(found), notes=notes))

    blurred = (BLURRED,) if scene.picture.radial_blur else ()
    if (few := _few(request)) is not None:
        standing = _standing(few, tell)
        coarsely(COARSE[0], standing, (*standing.notes, *blurred, FEWER))
    standing = _standing(request, tell)
    notes = (*standing.notes, *blurred)
    for share in COARSE:
        coarsely(share, standing, notes)
    mean = np.zeros((height, width, 3))
    variance, total, seed = np.zeros_like(mean), 0, 0
    while total < MOST:
        seed, step = seed + 1, EACH if total else FIRST
        found = render(1, step, seed, f"{total + step} paths a pixel", standing)
        # A mean of independent means, each by its number of samples
        n, total = found.samples, total + found.samples
        mean += (found.radiance - mean) * (n / total)
        variance = (variance * (total - n) ** 2 + (n * found.error.astype(np.float64)) ** 2) / (
            total**2
        )
        error = float(np.sqrt(variance).mean() / max(mean.mean(), 1e-12))
        picture = _film(mean, scene, request.time)
        tell(Traced(picture, total, error, total >= MOST, notes))


_stood: dict[Hashable, Any] = {}


def _standing(request: Request, tell: Tell) -> Any:
    """Place what stands in the scene, or take it as it was placed the last time."""
    from bake import reference

    key = _key(request)
    if key not in _stood:
        tell(PLACING)
        _stood.clear()
        _stood[key] = reference.stand(request.scene, request.time)
        tell(None)
    return _stood[key]


def _key(request: Request) -> Hashable:
    """Return all that what stands depends on."""
    from bake import reference_camera

    scene, time = request.scene, request.time
    camera = reference_camera.at(scene, time, request.size)
    eye = (camera.yaw, camera.position.tobytes()) if scene.billboards else None
    parts = scene.meshes, scene.billboards, scene.voxels, scene.ground
    return _content(parts), time, eye


def _few(request: Request) -> Request | None:
    """Return the request without the sets of many sprites, which take long to place.

    None where there are none, or where all stands already.
    """
    every = request.scene.billboards
    few = tuple(each for each in every if len(each.instances()) <= MANY)
    if len(few) == len(every) or _key(request) in _stood:
        return None
    return replace(request, scene=replace(request.scene, billboards=few))


def _content(value: Any) -> Hashable:
    """Return what a value says, to be compared: arrays and tables too."""
    if is_dataclass(value):
        said = tuple(_content(getattr(value, field.name)) for field in fields(value))
        return type(value).__name__, said
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, dict):
        return tuple((key, _content(each)) for key, each in value.items())
    if isinstance(value, list | tuple):
        return tuple(_content(each) for each in value)
    return str(value)


def _error(found: Any) -> float:
    return float(found.error.mean(dtype=np.float64) / max(found.radiance.mean(), 1e-12))


def _film(radiance: NDArray[Any], scene: Scene, time: float) -> NDArray[np.uint8]:
    """Finish a picture as the player does, by the twins of its passes."""
    from bake.reference_film import develop
    from maths import bloom

    linear: NDArray[Any] = np.asarray(radiance, np.float64)
    if (wanted := scene.picture.bloom) is not None:
        strength = float(wanted.strength.at(time))
        linear = bloom.bloom(linear, strength, wanted.threshold, wanted.radius * linear.shape[0])
    return develop(linear, scene, time)
