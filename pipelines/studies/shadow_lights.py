"""What does a frame with soft shadows cost as lights are added?

A mesh hangs over a floor and turns: 1 to 1,000 balls or discs light both. Measured are the shadow
pass by itself, on numbers made before; the projection of the lights at both ends of the mesh, which
the CPU does every frame; and the whole frame, everything drawn anew, over a floor lit by transfer
(the same few numbers for any lights) or over the ground (a sum over all lights in every pixel,
where the card takes so many). The best of a few rounds counts: other work can only slow one down.
"""

from __future__ import annotations

import json
import shutil
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

from formats import scene as scenes
from maths.sampling import fibonacci_sphere
from pipelines.bake_scene import bake_scene
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.interval import fastest
from pipelines.studies.subjects import MESHES, Setting
from runtime.player import Player
from runtime.shader import ShaderError

TAKES = ("mesh",)
COUNTS = (1, 10, 100, 1000)
KINDS = {"balls": "sphere", "discs": "disc"}
WAYS = {
    "transfer": "floor lit by transfer",
    "receiver_normal": "floor whose normal counts in the shadow",
    "ground": "ground lit directly",
}
"""What lies below."""
FIRST = "transfer"
FLUX = 60.0  # radiance x area of all lights together, W/sr


def measure(setting: Setting) -> Answer:
    """Play a small scene under more and more lights."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    with TemporaryDirectory() as folder:
        for way in WAYS if not setting.quick else (FIRST, "ground"):
            rows += _rows(Path(folder), way, setting, shots)
    figures = {
        f"{name}_{kind}_{count}": float(row[name])
        for row in rows
        if row["floor"] == FIRST
        for name, kind, count in [("pass_ms", row["lights"], row["count"])]
    }
    figures |= {
        f"projection_ms_{row['lights']}": float(row["projection_ms"])
        for row in rows
        if row["floor"] == FIRST and row["count"] == COUNTS[-1]
    }
    passes = [figures[f"pass_ms_balls_{count}"] for count in (COUNTS[0], COUNTS[-1])]
    return Answer(
        question="shadow_lights",
        title=f"The shadow pass takes {passes[0]:.2g} ms with 1 light and {passes[1]:.2g} with "
        f"1,000; projecting those takes {figures['projection_ms_balls']:.1f} ms (balls) and "
        f"{figures['projection_ms_discs']:.1f} (discs)",
        truth="none: times, the best of several rounds",
        rows=rows,
        unit="milliseconds of the whole frame",
        measure="frame_ms",
        axes={"count": "lights"},
        shots=shots,
        panels=(Panel("lights", "milliseconds", _parts(rows), None, ("log", "log")),),
        figures=figures,
    )


def _rows(
    folder: Path, way: str, setting: Setting, shots: dict[tuple[str, str], Shot]
) -> list[Row]:
    """Measure all numbers of lights over one floor, in turn where one player can show them all."""
    counts = (COUNTS[0], *COUNTS[setting.pick(2, 1) :])
    baked, cases = baked_in(folder, way, setting), [(k, n) for k in KINDS for n in counts]
    size = (160, 90) if setting.quick else (640, 360)
    rounds = setting.pick(3, 15)
    subject = WAYS[way]
    rows: list[Row] = []
    for some in [[case] for case in cases] if way == "ground" else [cases]:
        spent: dict[tuple[str, int], list[dict[str, float]]] = {}
        # Shaders of real cards take a few hundred lights at most
        with suppress(ShaderError), LitPlayer(baked, size, lamps(*some[0])) as player:
            player.reuse = False
            for number in range(rounds + 1):
                for case in some:
                    player.scene = replace(player.scene, lights=lamps(*case))
                    found = once(player, float(number))
                    # The first round compiles and allocates
                    spent[case] = [*spent.get(case, []), found] if number > 1 else [found]
                    if number == rounds:
                        shots[subject, told(*case)] = Shot(player.frame(1.0))
        for (kind, count), times in spent.items():
            best = {name: min(time[name] for time in times) for name in times[0]}
            row = point(
                subject,
                told(kind, count),
                None,
                series=kind,
                frame_ms=fastest([time["frame_ms"] for time in times]),
            )
            rows.append(row | {"lights": kind, "count": count, "floor": way, **best})
    return rows


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
    """Milliseconds of a frame, of looking lights up, of projecting them, and of the pass alone."""
    started = perf_counter()
    player.draw(time)
    player.ctx.finish()
    drawn = perf_counter()
    player.look(time)
    looked = perf_counter()
    occlusion = player.passes["occlusion"]
    light = occlusion.light(time)
    projected = perf_counter()
    occlusion.light = lambda _: light
    player.draw(time)
    del occlusion.light
    return {
        "pass_ms": float(player.profile["milliseconds"]["occlusion"]),
        "projection_ms": 1e3 * (projected - looked),
        "look_ms": 1e3 * (looked - drawn),
        "frame_ms": 1e3 * (drawn - started),
    }


def baked_in(folder: Path, way: str, setting: Setting) -> Path:
    """Bake the scene and return its folder; what stands in it is baked once."""
    meshes = folder / "assets/meshes"
    meshes.mkdir(parents=True, exist_ok=True)
    caster = setting.source or MESHES / "bust.glb"
    for source in (caster, MESHES / "gallery_wall.glb"):
        shutil.copy(source, meshes / source.name)
    path = folder / f"assets/scenes/{way}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(described(way, caster.name)), encoding="utf-8")
    return bake_scene(path, build_folder=folder / "build").folder


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
    floor = {"name": "floor", "source": "meshes/gallery_wall.glb", "rotation": [-90, 0, 0]}
    turning = {"times": [0, 10], "values": [[0, 0, 0], [0, 360, 0]], "interpolation": "linear"}
    scene: dict[str, Any] = {
        "format": 1,
        "time": {"duration": 10.0},
        "force": {"lights": True},
        "camera": {"position": [0, 1.6, 3.2], "target": [0, 0.4, 0], "focal_length_mm": 35},
        "lights": lights("balls", 1),
        "meshes": [
            {
                "name": "caster",
                "source": f"meshes/{caster}",
                "position": [0, 0.4, 0],
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
    """Return lights spread over the sky of the floor, 2 to 6 m away, dimmer the more they are."""
    rng = np.random.default_rng(count)
    towards = fibonacci_sphere(2 * count)
    towards = towards[np.argsort(-towards[:, 2])[:count]][:, [0, 2, 1]]
    towards[:, 1] = np.abs(towards[:, 1]) + 0.1
    found = []
    for way in towards:
        radius = rng.uniform(0.05, 0.25)
        at = way * rng.uniform(2.0, 6.0)
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
