"""What do relit sprites cost and lack as suns are added, 1 to 10,000 of them?

A sprite under a ring and one under a dome, both baked from the same mesh, are lit by more and more
suns all over the hemisphere, together as bright. The truth is traced: the mesh under every single
one of the suns. Measured are the error of the picture, and the player's frame with all lights
projected anew, a hundred sprites in it. What sprites draw from is a few numbers, however many suns
there are: what a frame takes more is the projection of the suns.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import billboard, dome_renders
from bake.photographs import Photographs
from formats import scene as scenes
from formats.mesh import Mesh
from maths.sampling import GOLDEN_ANGLE
from pipelines.bake_scene import bake_scene
from pipelines.studies import interval, sprite_errors, sprite_methods, stages
from pipelines.studies.answer import Answer, Panel, Row, Shot, lines_of, point
from pipelines.studies.shadow_lights import LitPlayer
from pipelines.studies.sprite_methods import Relit
from pipelines.studies.subjects import Setting, placed

Array = NDArray[np.float64]

TAKES = ("mesh",)
COUNTS = (1, 10, 100, 1_000, 10_000)
WAYS = ("ring", "dome")
RING = float(np.radians(30.0))
SPRITES = 100
IRRADIANCE = 4.0  # of all suns together, W/m2


def measure(setting: Setting) -> Answer:
    """Light a sprite by more and more suns; compare with the traced mesh, and time frames."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    size, rounds = ((160, 90), 1) if setting.quick else ((480, 270), 9)
    counts = COUNTS[:: setting.pick(2, 1)]
    for name, mesh in setting.meshes("lantern").items():
        truths = {n: truth(mesh, suns(n), setting.pick(16, 48)) for n in counts}
        methods = baked(mesh, setting.pick(16, 48))
        spent = frames(setting, size, rounds, counts)
        for way, relit in methods.items():
            for count in counts:
                what = f"{way}, {count:,} sun{'s' if count > 1 else ''}"
                made = relit(np.array(suns(count)))
                rows.append(
                    point(
                        name,
                        what,
                        error_of(made, truths[count]),
                        series=way,
                        frame_ms=spent[way, count],
                        default=way == "ring",
                        lights=count,
                    )
                )
                shots[name, what] = shot(made, truths[count])
    errors = {(str(row["series"]), int(row["lights"])): float(row["error"]) for row in rows}
    each = {
        way: 1e3 * (spent[way, COUNTS[-1]].value - spent[way, 1].value) / COUNTS[-1] for way in WAYS
    }
    return Answer(
        question="sprite_lights",
        title=f"A sun costs {each['ring']:.0f} (ring) or {each['dome']:.0f} (dome) microseconds to "
        f"project for {SPRITES} sprites, however large they are drawn: a frame takes "
        + " or ".join(f"{spent[way, 1].value:.2g}" for way in WAYS)
        + " ms under 1 and "
        + " or ".join(f"{spent[way, COUNTS[-1]].value:,.0f}" for way in WAYS)
        + f" under {COUNTS[-1]:,}, and errs "
        + " or ".join(f"{errors[way, COUNTS[-1]] / errors[way, 1]:.2f}" for way in WAYS)
        + " times as much",
        truth="the mesh traced under every single sun",
        rows=rows,
        unit="RMS error of the picture, share of its brightest value",
        axes={"lights": "suns"},
        panels=(
            Panel(
                "suns",
                "processor milliseconds a frame",
                lines_of(rows, "lights", "frame_ms", "series"),
                None,
                ("log", "log"),
                title=f"A frame of {SPRITES} sprites grows by {each['ring']:.0f} (ring) or "
                f"{each['dome']:.0f} (dome) microseconds a sun",
            ),
        ),
        decibels=True,
        shots=shots,
        figures={"microseconds_a_sun": each},
    )


@cache
def suns(count: int) -> tuple[tuple[float, float, float], ...]:
    """Return directions of a golden spiral, z even in .1 to 1; sprite's frame."""
    z = 0.1 + 0.9 * (np.arange(count) + 0.5) / count
    turn, r = 1.0 + GOLDEN_ANGLE * np.arange(count), np.sqrt(1 - z * z)
    found = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)
    return tuple((float(x), float(y), float(z)) for x, y, z in found)


def truth(
    mesh: Mesh, towards: tuple[tuple[float, float, float], ...], resolution: int
) -> Photographs:
    """Trace the mesh under each sun; a single picture, the mean of all, in a hundred at a time."""
    total: Any = 0.0
    for first in range(0, len(towards), 100):
        some = towards[first : first + 100]
        params = dome_renders.Params(resolution=resolution, samples=4, directions=some)
        found = dome_renders.render(mesh, params=params)
        total = total + found.pictures.sum(axis=0, dtype=np.float64)
    mean = np.asarray(total / len(towards), np.float32)[None]
    return Photographs(
        mean, found.directions[:1], "linear", coverage=found.coverage, pivot=found.pivot
    )


def baked(mesh: Mesh, resolution: int) -> dict[str, Relit]:
    """Return a sprite by ring and by dome, as 8 bits hold them."""
    params = dome_renders.Params(resolution=resolution, samples=4)
    knobs = billboard.Params(resolution=resolution, samples=4, elevation=RING)
    training = dome_renders.render(mesh, params=params)
    return {
        "ring": sprite_methods.ring(mesh, knobs),
        "dome": sprite_methods.hemisphere(training, "linear"),
    }


def error_of(made: NDArray[np.float32], found: Photographs) -> interval.Interval:
    """Return the error over covered texels, its spread that between blocks."""
    picture = found.pictures[0].astype(np.float64)
    squares = np.mean(np.square(made - picture), axis=-1) / float(picture.max()) ** 2
    assert found.coverage is not None
    kept = interval.blocks(squares, 8)[interval.blocks(found.coverage, 8) > 0]
    return interval.rms(kept)


def shot(made: NDArray[np.float32], found: Photographs) -> Shot:
    """Return a picture and its truth before grey."""
    assert found.coverage is not None
    peak = sprite_errors.peak_of(found.pictures[0])
    pictures = [sprite_errors.seen(p, found.coverage, peak) for p in (made, found.pictures[0])]
    return Shot(pictures[0], pictures[1])


def frames(
    setting: Setting, size: tuple[int, int], rounds: int, counts: tuple[int, ...]
) -> dict[tuple[str, int], interval.Interval]:
    """Return milliseconds of a frame by way and number of suns."""
    found = {}
    with TemporaryDirectory() as folder:
        for way in WAYS:
            scene = baked_in(Path(folder), way, setting)
            with LitPlayer(scene, size, lamps(1)) as player:
                player.reuse = False
                for count in counts:
                    player.scene = replace(player.scene, lights=lamps(count))
                    # The first frame compiles and allocates
                    times = [once(player, float(k)) for k in range(rounds + 1)][1:]
                    found[way, count] = interval.fastest(times)
    return found


def once(player: LitPlayer, time: float) -> float:
    """Return processor milliseconds of a frame."""
    player.ctx.finish()
    started = process_time()
    player.draw(time)
    player.ctx.finish()
    return 1e3 * (process_time() - started)


@cache
def lamps(count: int) -> tuple[Any, ...]:
    """Return suns as the player takes them, read 256 at a time: a file has as many at most."""
    found: list[Any] = []
    for first in range(0, count, 256):
        some = [
            {"type": "sun", "to_light": list(way), "irradiance": [IRRADIANCE / count] * 3}
            for way in suns(count)[first : first + 256]
        ]
        data = described("ring", "lantern.glb") | {"lights": some}
        found += scenes.from_dict(data, where="lights.json", root=None).lights
    return tuple(found)


def described(way: str, source: str) -> dict[str, Any]:
    """Return the scene as data: a hundred sprites, in ten rows."""
    grid = [(i % 10 - 4.5, i // 10) for i in range(SPRITES)]
    sprite = {
        "name": "sprite",
        "source": f"meshes/{source}",
        "height": 1.0,
        "resolution": 64,
        "samples": 4,
        "shadow": False,
        "positions": [[0.8 * x, 0.0, -0.8 * z] for x, z in grid],
        way: {"elevation": 30} if way == "ring" else {},
    }
    return {
        "format": 1,
        "time": {"duration": 10.0},
        "camera": {"position": [0, 1.5, 6], "target": [0, 0.5, 0], "focal_length_mm": 35},
        "lights": [{"type": "sun", "to_light": [0, 0, 1], "irradiance": [IRRADIANCE] * 3}],
        "billboards": [sprite],
    }


def baked_in(folder: Path, way: str, setting: Setting) -> Path:
    """Bake the scene and return its folder."""
    source = placed(setting, "lantern.glb", folder / "assets/meshes", 1.0)
    path = folder / f"assets/scenes/{way}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(described(way, source.name)), encoding="utf-8")
    return bake_scene(path, build_folder=folder / "build", store=stages.store()).folder
