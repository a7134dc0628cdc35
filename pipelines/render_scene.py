"""From a scene to pictures: bake if a hash differs, then play without importing `bake`."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import scene as scenes
from formats.errors import DamagedError, InputError
from formats.schema import MAX_SECONDS
from pipelines import current, pass_times

MAX_SIDE = 16384
MOVIES = (".gif", ".webp", ".mp4")
MAX_FRAMES = 1_000_000


@dataclass
class RenderJob:
    """What a render wrote, and the player's counts."""

    files: list[Path] = field(default_factory=list)
    profile: dict[str, Any] = field(default_factory=dict)


def render_scene(
    path: Path,
    out: Path,
    *,
    size: str = "1280x720",
    times: tuple[float, ...] = (),
    frames: str | None = None,
    root: Path | None = None,
    build_folder: Path = Path("build"),
    measured: bool = False,
) -> RenderJob:
    """Render a scene to files. Raises InputError, MachineError, DamagedError.

    out : a picture (.png, .exr), a movie (.gif, .webp, .mp4, with `frames`), or a folder for one
    picture a time or frame. measured : then draw some of its frames again to measure each pass.
    """
    width, height = parse_size(size)
    if out.suffix.lower() not in ("", ".png", ".exr", *MOVIES):
        remedy = "write .png, .exr, .gif, .webp, .mp4 or a folder"
        raise InputError("command line", "--output", str(out), remedy)
    scene = scenes.load(path, root)
    wanted = _moments(scene, times, frames, out)
    player = _player(path, scene, root, build_folder, (width, height))
    job = RenderJob()
    try:
        _write(player, wanted, out, scene.time.frame_rate, job)
        job.profile = player.profile
        if measured:
            from pipelines import profile

            job.profile = profile.measure(player, [time for _, time in wanted])
    finally:
        player.close()
    # What one frame took in passing does not replace what was measured
    if measured or not pass_times.known(scene, build_folder, height):
        pass_times.keep(scene, build_folder, job.profile)
    return job


def trace_scene(
    path: Path,
    out: Path,
    *,
    size: str = "1280x720",
    times: tuple[float, ...] = (),
    frames: str | None = None,
    samples: int = 64,
    root: Path | None = None,
) -> RenderJob:
    """Trace a scene by paths instead of playing it: no bake, no OpenGL. Raises InputError.

    out : a picture (.png through the film, .exr linear with its standard error) or a folder for one
    picture a time or frame. samples : paths a pixel. Light goes on from surface to surface twice,
    or as often as a world of cubes asks.
    """
    width, height = parse_size(size)
    if out.suffix.lower() not in ("", ".png", ".exr"):
        remedy = "the reference writes .png, .exr or a folder"
        raise InputError("command line", "--output", str(out), remedy)
    scene = scenes.load(path, root)
    from bake import reference, reference_cubes, workers
    from pipelines.output import bars

    wanted, job = _moments(scene, times, frames, out), RenderJob()
    for name, time in wanted:
        params = reference.Params(
            width=width,
            height=height,
            time=time,
            samples=samples,
            bounces=max(reference.Params.bounces, reference_cubes.bounces(scene)),
        )
        started = perf_counter()
        with bars() as bar:
            watch = None if bar is None else partial(bar, name)
            found = reference.render(scene, params=params, progress=watch or workers.silent)
        seconds = perf_counter() - started
        target = _target(out, name, len(wanted))
        _save_reference(found, scene, time, target)
        job.files.append(target)
        job.profile[name] = {
            "seconds": seconds,
            "samples": found.samples,
            "rays": found.rays,
            "rays_per_second": found.rays / seconds,
            "mean_error": float(found.error.mean(dtype=np.float64)),
            "notes": list(found.notes),
        }
    return job


def _save_reference(found: Any, scene: scenes.Scene, time: float, target: Path) -> None:
    if target.suffix.lower() == ".exr":
        found.save(target)
        return
    from bake.reference_film import develop
    from formats.files import image

    image.write(target, develop(found.radiance, scene, time))


def view_scene(path: Path, *, size: str, root: Path | None, build_folder: Path) -> None:
    """Open a scene in a window. MachineError where there is no display."""
    width, height = parse_size(size)
    scene = scenes.load(path, root)
    folder = current.ensure(path, scene, root, build_folder)
    from runtime.viewer import view

    view(folder, size=(width, height), pictures=build_folder / "renders")


def _player(
    path: Path, scene: scenes.Scene, root: Path | None, build_folder: Path, size: tuple[int, int]
) -> Any:
    """Open the player on a baked scene; one whose bytes changed is baked anew, once."""
    folder = current.ensure(path, scene, root, build_folder)
    from runtime.player import Player

    try:
        return Player(folder, size=size)
    except DamagedError as error:
        print(f"warning: {error}; baking it again", file=sys.stderr)
        current.bake(path, root, build_folder)
        return Player(folder, size=size)


def parse_size(text: str) -> tuple[int, int]:
    """Read WIDTHxHEIGHT.

    >>> parse_size("640x360")
    (640, 360)
    """
    match = re.fullmatch(r"(\d{1,6})x(\d{1,6})", text.strip().lower())
    sides = tuple(int(n) for n in match.groups()) if match else (0, 0)
    if not all(1 <= n <= MAX_SIDE for n in sides):
        raise InputError("command line", "--size", text, f"write WxH, each from 1 to {MAX_SIDE}")
    return sides[0], sides[1]


def _moments(
    scene: scenes.Scene, times: tuple[float, ...], frames: str | None, out: Path
) -> list[tuple[str, float]]:
    """List (name, time) of the pictures to make."""
    if frames is not None and times:
        raise InputError("command line", "--frames", frames, "give either --frames or --time")
    if frames is None:
        chosen = tuple(dict.fromkeys(times)) or (0.0,)
        for time in chosen:
            if not abs(time) <= MAX_SECONDS:
                remedy = f"give seconds, at most {MAX_SECONDS:.0f}"
                raise InputError("command line", "--time", time, remedy)
        if len(chosen) > 1 and out.suffix:
            raise InputError(
                "command line", "--output", str(out), "name a folder for several times"
            )
        if out.suffix.lower() in MOVIES:
            raise InputError("command line", "--output", str(out), "a movie needs --frames A:B")
        return [
            (f"{scene.name}-{stamp}", time)
            for stamp, time in zip(_stamps(chosen), chosen, strict=True)
        ]
    match = re.fullmatch(r"(\d{1,12}):(\d{1,12})(?::(\d{1,12}))?", frames)
    first, last, step = (int(n or 1) for n in match.groups()) if match else (0, 0, 0)
    if not (last > first and step):
        remedy = "write A:B or A:B:STEP with A < B, such as 0:48"
        raise InputError("command line", "--frames", frames, remedy)
    if len(range(first, last, step)) > MAX_FRAMES:
        raise InputError("command line", "--frames", frames, f"ask for at most {MAX_FRAMES:,}")
    rate = scene.time.frame_rate
    return [(f"{scene.name}-{n:05d}", n / rate) for n in range(first, last, step)]


def _stamps(times: tuple[float, ...]) -> list[str]:
    """Write times with as many decimals, two at least, as tell them all apart.

    >>> _stamps((0.5, 12.0))
    ['000.50', '012.00']
    """
    for decimals in range(2, 17):
        stamps = [f"{time:0{decimals + 4}.{decimals}f}" for time in times]
        if len(set(stamps)) == len(times):
            break
    return stamps


def _write(
    player: Any, wanted: list[tuple[str, float]], out: Path, rate: float, job: RenderJob
) -> None:
    from formats.files import image

    if out.suffix.lower() in MOVIES:
        from pipelines import movie

        out.parent.mkdir(parents=True, exist_ok=True)
        if len(wanted) > 1:
            # Every second frame shown at half the rate lasts as long as all of them
            rate = 1.0 / (wanted[1][1] - wanted[0][1])
        movie.write(out, (player.frame(time)[..., :3] for _, time in wanted), rate, len(wanted))
        job.files.append(out)
        return
    for name, time in wanted:
        target = _target(out, name, len(wanted))
        if target.suffix.lower() == ".exr":
            from formats.files import exr

            linear: NDArray[np.float32] = np.ascontiguousarray(player.linear(time)[..., :3])
            exr.write(target, {"beauty": linear})
        else:
            image.write(target, np.ascontiguousarray(player.frame(time)[..., :3]))
        job.files.append(target)


def _target(out: Path, name: str, count: int) -> Path:
    """Return the file of one of `count` pictures, its folder made."""
    suffix = out.suffix.lower()
    target = out
    if not suffix or count > 1:
        target = (out.parent / out.stem if suffix else out) / f"{name}{suffix or '.png'}"
    target.parent.mkdir(parents=True, exist_ok=True)
    return target


def progress(frames: Iterable[NDArray[np.uint8]], total: int) -> Iterator[NDArray[np.uint8]]:
    """Pass frames on, with a bar on standard error where that is a terminal."""
    from pipelines.output import bars

    with bars() as bar:
        for number, frame in enumerate(frames):
            yield frame
            if bar is not None:
                bar("frames", (number + 1) / total)
