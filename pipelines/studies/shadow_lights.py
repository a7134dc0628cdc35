"""What does a frame with soft shadows cost, and lack, as lights are added?

A mesh turns just above a floor: 1 to 10,000 balls or discs light both. Measured are the shadow
pass by itself, on numbers made before; the projection of the lights at both ends of the mesh, which
the CPU does every frame; and the whole frame, everything drawn anew, over a floor lit by transfer
(the same few numbers for any lights) or over the ground (a sum over all lights in every pixel,
where the card takes so many). The best of a few rounds counts: other work can only slow one down.

Errors are those of the picture, linear, over its mean: against rays from the middle of each pixel
to every one of the lamps.
"""

from __future__ import annotations

import json
import shutil
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from formats import scene as scenes
from maths.colour import srgb_encode
from maths.sampling import fibonacci_sphere
from pipelines.bake_scene import bake_scene
from pipelines.studies import lamp_truth, stages
from pipelines.studies.answer import PRICES, Answer, Panel, Row, Shot, lines_of, point
from pipelines.studies.interval import Interval, blocks, fastest, ratio
from pipelines.studies.subjects import MESHES, Setting, placed
from runtime.player import Player
from runtime.shader import ShaderError

TAKES = ("mesh",)
COUNTS = (1, 10, 100, 1_000, 10_000)
KINDS = {"balls": "sphere", "discs": "disc"}
WAYS = {
    "transfer": "floor lit by transfer",
    "receiver_normal": "floor whose normal counts in the shadow",
    "ground": "ground lit directly",
}
"""What lies below."""
FIRST = "transfer"
MOMENT = 2.0  # seconds, at which pictures are compared
SAMPLES = 64  # rays of a pixel to all lamps together, at least one each
STEEP = 3.0  # times as bright a neighbour: an outline
KEY = 0.3  # how bright pictures are on the mean, linear
SIZE = 0.7  # metres, of the user's own mesh along its longest side
FLUX = 60.0  # radiance x area of all lights together, W/sr


def measure(setting: Setting) -> Answer:
    """Play a small scene under more and more lights."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    with TemporaryDirectory() as folder:
        for way in WAYS if not setting.quick else (FIRST, "ground"):
            rows += _rows(Path(folder), way, setting, shots)
    most = max(int(row["count"]) for row in rows if row["floor"] == FIRST)
    figures = {
        f"{name}_{kind}_{count}": float(row[name])
        for row in rows
        if row["floor"] == FIRST
        for name, kind, count in [("pass_ms", row["lights"], row["count"])]
    }
    figures |= {
        f"projection_ms_{row['lights']}": float(row["projection_ms"])
        for row in rows
        if row["floor"] == FIRST and row["count"] == most
    }
    passes = [figures[f"pass_ms_balls_{count}"] for count in (COUNTS[0], most)]
    errors = {
        int(row["count"]): float(row["error"])
        for row in rows
        if row["floor"] == FIRST and row["lights"] == "balls"
    }
    frame = {
        int(row["count"]): float(row["frame_ms"])
        for row in rows
        if row["floor"] == FIRST and row["lights"] == "balls"
    }
    figures |= {f"error_balls_{count}": error for count, error in errors.items()}
    projection = figures["projection_ms_balls"]
    direct = [int(row["count"]) for row in rows if row["floor"] == "ground"]
    return Answer(
        question="shadow_lights",
        title=f"The shadow pass takes {passes[0]:.0f} ms with 1 light and {passes[1]:.0f} with "
        f"{most:,}, which take {projection:.0f} ms to project; the picture errs by "
        f"{errors[1]:.1%} with 1 and {errors[most]:.1%} with {most:,}",
        truth="rays from the middle of each pixel to every lamp",
        rows=rows,
        unit="RMS error of the picture, share of its mean",
        axes={"count": "lights", "frame_ms": PRICES["frame_ms"]},
        titles={
            "count": f"{errors[1]:.1%} of error with 1 lamp, {errors[most]:.1%} with {most:,}",
            "frame_ms": f"A frame takes {frame[1]:.0f} ms with 1 lamp and {frame[most]:.0f} with "
            f"{most:,}",
        },
        shots=shots,
        panels=(
            Panel(
                "lights",
                "processor milliseconds",
                _parts(rows),
                None,
                ("log", "log"),
                title=f"The pass takes {passes[0]:.0f} ms with 1 lamp and {passes[1]:.0f} with "
                f"{most:,}; projecting those takes {projection:.0f} ms",
            ),
            Panel(
                "lights",
                "processor milliseconds of the whole frame",
                lines_of(rows, "count", "frame_ms", "subject", "series"),
                None,
                ("log", "log"),
                title="The ground sums over all lamps in every pixel"
                + (f", and takes {max(direct):,} at most here" if direct else ""),
            ),
        ),
        figures=figures,
    )


def _rows(
    folder: Path, way: str, setting: Setting, shots: dict[tuple[str, str], Shot]
) -> list[Row]:
    """Measure all numbers of lights over one floor, in turn where one player can show them all."""
    counts = COUNTS[:: setting.pick(2, 1)]
    kinds = list(KINDS)[: setting.pick(1, 2)]
    baked, cases = baked_in(folder, way, setting), [(k, n) for k in kinds for n in counts]
    scene = scenes.load(folder / f"assets/scenes/{way}.json")
    size, small = ((96, 54), (32, 18)) if setting.quick else ((640, 360), (96, 54))
    rounds = setting.pick(2, 12)
    subject = WAYS[way]
    rows: list[Row] = []
    for some in [[case] for case in cases] if way == "ground" else [cases]:
        spent: dict[tuple[str, int], list[dict[str, float]]] = {}
        errors: dict[tuple[str, int], Interval] = {}
        # Shaders of real cards take a few hundred lights at most
        with suppress(ShaderError):
            with LitPlayer(baked, size, lamps(*some[0])) as player:
                player.reuse = False
                for number in range(rounds + 1):
                    for case in some:
                        player.scene = replace(player.scene, lights=lamps(*case))
                        found = once(player, float(number))
                        # The first round compiles and allocates
                        spent[case] = [*spent.get(case, []), found] if number else []
            with LitPlayer(baked, small, lamps(*some[0])) as player:
                player.reuse = False
                for case in some:
                    errors[case], shots[subject, told(*case)] = compared(player, scene, case)
        for (kind, count), times in spent.items():
            best = {name: min(time[name] for time in times) for name in times[0]}
            row = point(
                subject,
                told(kind, count),
                errors[kind, count],
                series=kind,
                frame_ms=fastest([time["frame_ms"] for time in times]),
            )
            rows.append(row | {"lights": kind, "count": count, "floor": way, **best})
    return rows


def compared(
    player: LitPlayer, scene: scenes.Scene, case: tuple[str, int]
) -> tuple[Interval, Shot]:
    """Return the error of a played picture under some lamps, and what it looks like.

    scene : the same, with the sources that it was baked from.
    """
    own = lamps(*case)
    player.scene = replace(player.scene, lights=own)
    played = np.asarray(player.linear(MOMENT)[..., :3], np.float64)
    size, samples = (played.shape[1], played.shape[0]), max(1, SAMPLES // case[1])
    traced, seen = lamp_truth.radiance(scene, MOMENT, size, own, samples)
    # Pixels at outlines are half of what is behind them, and rays go through their middles
    inner = minimum_filter(seen, 3) & flat(traced)
    apart = np.where(inner, np.square(played - traced).mean(axis=-1), 0.0)
    parts, wholes = (blocks(v, 6) for v in (apart, np.where(inner, 1.0, 0.0)))
    mean = float(traced[inner].mean())
    square = ratio(parts[wholes > 0], wholes[wholes > 0] * mean**2)
    error = Interval(*(float(np.sqrt(v)) for v in (square.value, square.low, square.high)))
    scale = KEY / mean
    made, truth = (
        np.asarray(np.rint(255 * srgb_encode(np.clip(scale * p, 0, 1))), np.uint8)
        for p in (played, traced)
    )
    return error, Shot(made, truth)


def flat(picture: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Say which pixels of (h, w, 3) are no part of an outline: their neighbours are alike."""
    value = picture.mean(axis=-1)
    return np.asarray(maximum_filter(value, 3) < STEEP * np.maximum(minimum_filter(value, 3), 1e-9))


def told(kind: str, count: int) -> str:
    """Return how many lights are told."""
    return f"{count:,} {kind if count > 1 else kind[:-1]}"


class LitPlayer(Player):  # type: ignore[misc]
    """Plays a scene under other lights than it was baked with: a file has 256 at most."""

    scene: Any

    def __init__(self, folder: Path, size: tuple[int, int], lamps: tuple[Any, ...]) -> None:
        self._lamps = lamps
        super().__init__(folder, size=size)

    def _take_lights(self, plans: list[dict[str, Any]]) -> None:
        self.scene = replace(self.scene, lights=self._lamps)


def once(player: Player, time: float) -> dict[str, float]:
    """Milliseconds of the processor, all threads together: of a frame, of looking lights up, of
    projecting them, and of the pass alone."""
    started = process_time()
    player.draw(time)
    player.ctx.finish()
    drawn = process_time()
    player.look(time)
    looked = process_time()
    occlusion = player.passes["occlusion"]
    light = occlusion.light(time)
    projected = process_time()
    spent: list[float] = []
    plain = occlusion.draw

    def timed(time: float) -> None:
        player.ctx.finish()
        before = process_time()
        plain(time)
        player.ctx.finish()
        spent.append(process_time() - before)

    occlusion.light, occlusion.draw = lambda _: light, timed
    player.draw(time)
    del occlusion.light, occlusion.draw
    return {
        "pass_ms": 1e3 * sum(spent),
        "projection_ms": 1e3 * (projected - looked),
        "look_ms": 1e3 * (looked - drawn),
        "frame_ms": 1e3 * (drawn - started),
    }


def baked_in(folder: Path, way: str, setting: Setting) -> Path:
    """Bake the scene and return its folder; what stands in it is baked once."""
    meshes = folder / "assets/meshes"
    caster = placed(setting, "bust.glb", meshes, SIZE)
    shutil.copy(MESHES / "gallery_wall.glb", meshes)
    path = folder / f"assets/scenes/{way}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(described(way, caster.name)), encoding="utf-8")
    return bake_scene(path, build_folder=folder / "build", store=stages.store()).folder


@cache
def lamps(kind: str, count: int) -> tuple[Any, ...]:
    """Return lights as the player takes them, read 256 at a time."""
    every = lights(kind, count)
    found: list[Any] = []
    for first in range(0, count, 256):
        data = described("ground", "bust.glb") | {"lights": every[first : first + 256]}
        found += scenes.from_dict(data, where="lights.json", root=None).lights
    return tuple(found)


def described(way: str, caster: str) -> dict[str, Any]:
    """Return the scene as data, under one light."""
    mesh = {"lighting": "transfer", "transfer": {"rays": 32, "bounces": 0, "edge": 0.1}}
    shadow = {"rays": 256, "receiver_normal": way == "receiver_normal"}
    floor = {
        "name": "floor",
        "source": "meshes/gallery_wall.glb",
        "rotation": [-90, 0, 0],
        "position": [0, 0, 2.5],
    }
    turning = {"times": [0, 10], "values": [[0, 0, 0], [0, 360, 0]], "interpolation": "linear"}
    scene: dict[str, Any] = {
        "format": 1,
        "time": {"duration": 10.0},
        "force": {"lights": True},
        "camera": {"position": [0.9, 1.3, 1.4], "target": [-0.1, 0.15, 0], "focal_length_mm": 35},
        "lights": lights("balls", 1),
        "meshes": [
            {
                "name": "caster",
                "source": f"meshes/{caster}",
                "position": [0, 0.03, 0],
                "rotation": turning,
                "shadow": shadow,
                **mesh,
            },
        ],
    }
    if way == "ground":
        return {**scene, "ground": {}}
    scene["meshes"].append({**floor, **mesh})
    return scene


def lights(kind: str, count: int) -> list[dict[str, Any]]:
    """Return lights spread over the sky of the floor from 30 degrees up, 3 to 8 m away, dimmer the
    more they are."""
    rng = np.random.default_rng(count)
    # Heights above a half are the last quarter of an even sphere
    towards = fibonacci_sphere(4 * count)
    towards = towards[np.argsort(-towards[:, 2])[:count]][:, [0, 2, 1]]
    found = []
    for way in towards:
        radius = rng.uniform(0.1, 0.5)
        at = way * rng.uniform(3.0, 8.0)
        emitted = FLUX / count / (np.pi * radius**2) * rng.uniform(0.5, 1.5, 3)
        light = {"type": KINDS[kind], "position": at.tolist(), "radius": radius}
        if kind == "discs":
            light["facing"] = (-way).tolist()
        found.append({**light, "radiance": emitted.tolist()})
    return found


def _parts(rows: list[Row]) -> dict[str, list[tuple[float, float]]]:
    lines: dict[str, list[tuple[float, float]]] = {}
    names = {"transfer": "shadow pass", "receiver_normal": "shadow pass, receiver's normal"}
    for row in rows:
        at, kind = float(row["count"]), row["lights"]
        if row["floor"] in names:
            name = f"{names[str(row['floor'])]}, {kind}"
            lines.setdefault(name, []).append((at, float(row["pass_ms"])))
        if row["floor"] == "transfer":
            lines.setdefault(f"projection, {kind}", []).append((at, float(row["projection_ms"])))
    return lines
