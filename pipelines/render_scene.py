"""From a scene to pictures: bake if a hash differs, then play without importing `bake`."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from formats import scene as scenes
from formats.errors import DamagedError, InputError
from formats.files import atomic
from pipelines import current, moments, pass_times
from pipelines.moments import MOVIES, Moment

MAX_SIDE = 16384
Each = TypeVar("Each")


@dataclass
class RenderJob:
    """What a render wrote, and the player's counts.

    size : width and height, pixels. frames : drawn. skipped : files that were there already.
    seconds : from the baked scene to the last file.
    """

    files: list[Path] = field(default_factory=list)
    profile: dict[str, Any] = field(default_factory=dict)
    size: tuple[int, int] = (0, 0)
    frames: int = 0
    skipped: list[Path] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def bytes(self) -> int:
        """Of all files written."""
        return sum(file.stat().st_size for file in self.files)


@dataclass(frozen=True)
class Options:
    """How files are written. layers : of an .exr, beside its light. quality : 1 to 100, of movies.
    skip_existing : leave pictures that are there already as they are."""

    layers: str | None = None
    quality: int = 80
    skip_existing: bool = False


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
    options: Options = Options(),
) -> RenderJob:
    """Render a scene to files. Raises InputError, MachineError, DamagedError.

    out : a picture (.png, .exr), a movie (.gif, .webp, .mp4, with `frames`), a numbered name
    (name.####.exr, with `frames`), or a folder for one picture a time or frame. measured : then
    draw some of its frames again to measure each pass.
    """
    width, height = parse_size(size)
    if out.suffix.lower() not in ("", ".png", ".exr", *MOVIES):
        remedy = "write .png, .exr, .gif, .webp, .mp4 or a folder"
        raise InputError("command line", "--output", str(out), remedy)
    from pipelines import layers

    names = layers.parse(options.layers, out)
    scene = scenes.load(path, root)
    wanted = moments.chosen(scene, times, frames, out)
    if out.suffix.lower() in MOVIES:
        from pipelines import movie

        movie.check(out, _rate(scene, wanted), len(wanted), (width, height))
    player = _player(path, scene, root, build_folder, (width, height))
    job, started = RenderJob(size=(width, height)), perf_counter()
    try:
        _write(player, wanted, out, _rate(scene, wanted), job, names, options)
        job.seconds = perf_counter() - started
        job.profile = player.profile
        if measured:
            from pipelines import profile

            job.profile = profile.measure(player, [moment.time for moment in wanted])
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
    build_folder: Path | None = None,
    options: Options = Options(),
) -> RenderJob:
    """Trace a scene by paths instead of playing it: no bake, no OpenGL. Raises InputError.

    out : a picture (.png through the film, .exr linear with its standard error) or a folder for one
    picture a time or frame. samples : paths a pixel. Light goes on from surface to surface twice,
    or as often as a world of cubes asks. build_folder : has the tiles of an interrupted picture.
    """
    width, height = parse_size(size)
    if out.suffix.lower() not in ("", ".png", ".exr"):
        remedy = "the reference writes .png, .exr or a folder"
        raise InputError("command line", "--output", str(out), remedy)
    if options.layers is not None:
        remedy = "the reference writes light and error only"
        raise InputError("command line", "--layers", options.layers, remedy)
    scene = scenes.load(path, root)
    from bake import reference, reference_cubes, workers
    from pipelines import traced_tiles
    from pipelines.output import bars

    wanted, job = moments.chosen(scene, times, frames, out), RenderJob(size=(width, height))
    for moment in wanted:
        name, target = moment.name, moments.target(out, moment)
        if options.skip_existing and target.is_file():
            job.skipped.append(target)
            continue
        params = reference.Params(
            width=width,
            height=height,
            time=moment.time,
            samples=samples,
            bounces=max(reference.Params.bounces, reference_cubes.bounces(scene)),
        )
        started = perf_counter()
        keeping = (
            traced_tiles.kept(path, scene, params, build_folder) if build_folder else nullcontext()
        )
        with keeping:
            with bars() as bar:
                watch = None if bar is None else partial(bar, name)
                found = reference.render(scene, params=params, progress=watch or workers.silent)
            seconds = perf_counter() - started
            _save_reference(found, scene, moment.time, target)
        job.files.append(target)
        job.frames += 1
        job.seconds += seconds
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


def _rate(scene: scenes.Scene, wanted: list[Moment]) -> float:
    """Frames a second: every second frame at half the rate lasts as long as all of them."""
    return 1.0 / (wanted[1].time - wanted[0].time) if len(wanted) > 1 else scene.time.frame_rate


def _write(
    player: Any, wanted: list[Moment], out: Path, rate: float, job: RenderJob,
    names: tuple[str, ...], options: Options,
) -> None:  # fmt: skip
    if out.suffix.lower() in MOVIES:
        from pipelines import movie

        out.parent.mkdir(parents=True, exist_ok=True)
        atomic.sweep(out.parent)
        frames = progress((player.frame(m.time)[..., :3] for m in wanted), len(wanted))
        movie.write(out, frames, rate, len(wanted), options.quality)
        job.files.append(out)
        job.frames = len(wanted)
        return
    write = _linear(player, names) if out.suffix.lower() == ".exr" else _finished(player)
    for moment in wanted[:1]:
        atomic.sweep(moments.target(out, moment).parent)
    for moment in progress(wanted, len(wanted)):
        target = moments.target(out, moment)
        if options.skip_existing and target.is_file():
            job.skipped.append(target)
            continue
        write(target, moment.time)
        job.files.append(target)
        job.frames += 1


def _finished(player: Any) -> Callable[[Path, float], None]:
    from formats.files import image

    def write(target: Path, time: float) -> None:
        image.write(target, np.ascontiguousarray(player.frame(time)[..., :3]))

    return write


def _linear(player: Any, names: tuple[str, ...]) -> Callable[[Path, float], None]:
    from formats.files import exr
    from pipelines import layers

    if names:
        from runtime.layers import Layers

        taken = Layers(player, names)

        def write_layers(target: Path, time: float) -> None:
            layers.save(target, taken.take(time), layers.attributes(player, time))

        return write_layers

    def write(target: Path, time: float) -> None:
        linear: NDArray[np.float32] = np.ascontiguousarray(player.linear(time)[..., :3])
        exr.write(target, {"beauty": linear}, attributes=layers.attributes(player, time))

    return write


def progress(frames: Iterable[Each], total: int) -> Iterator[Each]:
    """Pass frames on, with a bar on standard error where that is a terminal."""
    from pipelines.output import bars

    with bars() as bar:
        for number, frame in enumerate(frames):
            yield frame
            if bar is not None:
                bar("frames", (number + 1) / total)
