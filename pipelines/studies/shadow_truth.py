"""How near do the soft shadows of a moving mesh come to traced ones?

The scene `bust` with other volumes, played, against the traced scene: PSNR, and LDR-FLIP (Andersson
et al. 2020, 67 pixels a degree) where its package is installed. Once with light that bounces, and
once with direct light alone, which is all that the player gives walls and ground; pictures are
those of direct light, but among cubes, which hand light on. What the traced
picture's own noise costs is its error against another trace. Where the error comes from is
`shadow_steps`. Another scene may be given that has a mesh with a shadow; its first one is taken
apart so.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bake import reference, reference_film, sources
from formats import scene as scenes
from formats.errors import InputError
from formats.meshes import Shadow
from formats.occlusion import Occlusion
from maths.image_error import psnr
from pipelines.bake_scene import bake_scene
from pipelines.studies import interval, shadow_steps, stages
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.subjects import Setting
from runtime.player import Player

Picture = NDArray[np.uint8]
TAKES = ("scene",)
# The table `shadow` of every caster, none at all, or as the scene has them
Volume = Mapping[str, Any] | Literal["none", "as it is"]

SCENE = Path(__file__).resolve().parents[2] / "assets" / "scenes" / "bust.toml"
TIMES = (0.0, 9.0, 18.0)
TALK, OWN, AGAIN = "L4, 16 of 25", "the scene's", "traced again"
NOISY = 3.0  # dB: a trace no nearer to another than this is what is measured
TALKS: dict[str, Any] = {"l_max": 4, "components": 16}
VOLUMES: dict[str, Volume] = {
    "no shadows": "none",
    "L2": {"l_max": 2, "components": 9},
    TALK: TALKS,
    "L4": {"l_max": 4, "components": 25},
    "L6, 48 of 49": {"l_max": 6, "components": 48},
    "L8, 16 of 81": {"l_max": 8, "components": 16},
    "L8, 48 of 81": {"l_max": 8, "components": 48},
    "bands L3, 32 KiB": {"encoding": "bands", "size": 32, "l_max": 3},
    "bands L5, 128 KiB": {"encoding": "bands", "size": 128, "l_max": 5},
    "bands L7, 512 KiB": {"encoding": "bands", "size": 512, "l_max": 7},
    OWN: "as it is",
}
QUICK = ("no shadows", TALK, "bands L5, 128 KiB", OWN)
AMPLIFIED = 4
PIXELS = (40, 22), shadow_steps.PIXELS  # whose shares are taken apart, quick and full


@dataclass(frozen=True, eq=False)
class Played:
    """pictures : finished, (h, w, 3), by time. bytes, lookups : of all casters' volumes together,
    lookups a pixel near them all. bake_seconds : of the volumes. frames : processor milliseconds of
    frames."""

    pictures: Mapping[float, Picture]
    bytes: int
    lookups: int
    bake_seconds: float = 0.0
    frames: tuple[float, ...] = (0.0,)

    @property
    def costs(self) -> Row:
        """What rows tell of it."""
        return {"kib": self.bytes / 1024, "lookups": self.lookups}


def measure(setting: Setting) -> Answer:
    """Play every volume at a few moments, trace the moments, and compare."""
    path = setting.source or SCENE
    scene = scenes.load(path)
    if not any(mesh.shadow for mesh in scene.meshes):
        remedy = "give a scene in which one has the table `shadow`"
        raise InputError(path, "meshes", "none casts a shadow", remedy)
    every = TIMES if path == SCENE else tuple(scene.time.duration * k / 3 for k in range(3))
    times = every[: setting.pick(1, len(TIMES))]
    volumes = {name: VOLUMES[name] for name in QUICK} if setting.quick else VOLUMES
    size = (80, 45) if setting.quick else (240, 135)
    samples = setting.pick(12, 64)
    played = play(volumes, times, size, path=path)
    rows, sheets, shots = list[Row](), [], dict[tuple[str, str], Shot]()
    squares: dict[str, list[Any]] = {name: [] for name in played}
    for time in times:
        truth, direct, again = traced(scene, time, size, samples)
        found = {name: one.pictures[time] for name, one in played.items()}
        for name, picture in {**found, AGAIN: again}.items():
            costs = played[name].costs if name in played else {"kib": 0.0, "lookups": 0}
            row: Row = {"shadow": name, "time": time, **costs}
            row |= errors(picture, truth) | errors(picture, direct, "_direct")
            rows.append(row)
        for name, picture in found.items():
            near = direct if scene.voxels is None else truth
            apart = np.square((picture.astype(np.float64) - near) / 255).mean(axis=-1)
            squares[name].append(interval.blocks(apart))
            shots.setdefault((scene.name, name), Shot(picture, near))
        sheets.append(side_by_side(found[OWN], truth, direct))
    steps = explained(scene, times, setting)
    points = [
        point(
            scene.name,
            name,
            interval.rms(np.concatenate(squares[name])),
            series=family(name),
            bake_seconds=one.bake_seconds or None,
            frame_ms=interval.fastest(one.frames),
            bytes=one.bytes or None,
            default=name == OWN,
        )
        for name, one in played.items()
    ]
    table = [mean_of(rows, name) for name in dict.fromkeys(str(r["shadow"]) for r in rows)]
    best, talk, noise = (next(r for r in table if r["shadow"] == k) for k in (OWN, TALK, AGAIN))
    title = f"{best['psnr']:.1f} dB of the traced picture, {talk['psnr']:.1f} dB with the talk's "
    title += f"volume ({best['psnr_direct']:.1f} and {talk['psnr_direct']:.1f} without bounces)"
    if float(noise["psnr"]) < float(best["psnr"]) + NOISY:
        title += f"; the trace's own noise leaves {noise['psnr']:.1f} dB, so that this says little"
    panels = [_pictures(table, "psnr_direct" if scene.voxels is None else "psnr")]
    panels += [_steps(steps)] if steps else []
    where = " in direct light" if scene.voxels is None else ""
    return Answer(
        question="shadow_truth",
        title=title,
        truth=f"the scene traced with {samples} paths a pixel, 2 bounces or none",
        rows=[*points, *rows, *steps],
        unit="RMS error of the picture" + where + ", share of white",
        decibels=True,
        shots=shots,
        panels=panels,
        table=table,
        figures={"flip": find_spec("flip_evaluator") is not None},
        pictures={"differences": np.concatenate(sheets)},
    )


def with_volume(raw: Mapping[str, Any], volume: Volume) -> dict[str, Any]:
    """Return a scene as data, every caster's volume of these knobs, or without shadows."""
    data: dict[str, Any] = json.loads(json.dumps(raw))
    for mesh in data["meshes"] if volume != "as it is" else ():
        if mesh.pop("shadow", None) is not None and not isinstance(volume, str):
            mesh["shadow"] = dict(volume)
    return data


def play(
    volumes: Mapping[str, Volume],
    times: Sequence[float],
    size: tuple[int, int],
    change: Callable[[dict[str, Any]], None] = lambda data: None,
    *,
    path: Path = SCENE,
) -> dict[str, Played]:
    """Return by name what the player makes of the scene with volumes.

    change : what else to change of the scene, as data.
    """
    raw, found = scenes.load(path).raw, dict[str, Played]()
    root = path.resolve().parents[1]
    with TemporaryDirectory() as folder:
        for name, volume in volumes.items():
            changed = Path(folder, f"{path.stem}-{len(found)}.json")
            data = with_volume(raw, volume)
            change(data)
            changed.write_text(json.dumps(data), encoding="utf-8")
            baked = bake_scene(changed, root=root, build_folder=Path(folder), store=stages.store())
            with Player(baked.folder, size=size) as player:
                assets = [Occlusion.load(f) for f in player.folders("occlusion").values()]
                pictures = {
                    time: reference_film.develop(player.linear(time)[..., :3], player.scene, time)
                    for time in times
                }
                frames = tuple(_frame_ms(player, times[0]) for _ in range(3))
            found[name] = Played(
                pictures,
                bytes=sum(asset.nbytes for asset in assets),
                lookups=sum(len(grid) for asset in assets for grid in asset.grids),
                bake_seconds=sum(
                    entry.seconds
                    for key, entry in baked.entries.items()
                    if key.startswith("occlusion/")
                ),
                frames=frames,
            )
    return found


def _frame_ms(player: Player, time: float) -> float:
    """Return the processor milliseconds of a frame, everything drawn anew."""
    player.reuse = False
    player.ctx.finish()
    started = process_time()
    player.draw(time)
    player.ctx.finish()
    return 1e3 * (process_time() - started)


def family(name: str) -> str:
    """Return which kind of volume a name tells."""
    if name.startswith("bands"):
        return "bands"
    return name if name in (OWN, "no shadows") else "components"


def traced(
    scene: scenes.Scene, time: float, size: tuple[int, int], samples: int
) -> tuple[Picture, Picture, Picture]:
    """Trace with bounces, without, and with them and another seed."""

    def one(bounces: int, seed: int) -> Picture:
        params = reference.Params(
            width=size[0], height=size[1], time=time, samples=samples, bounces=bounces, seed=seed
        )
        return reference_film.develop(reference.render(scene, params=params).radiance, scene, time)

    return one(2, 0), one(0, 0), one(2, 1)


def errors(picture: Picture, truth: Picture, suffix: str = "") -> Row:
    """Return PSNR in dB, and the mean of FLIP, of pictures as a screen shows them."""
    a, b = (np.asarray(p, np.float32) / np.float32(255) for p in (picture, truth))
    row: Row = {f"psnr{suffix}": psnr(a, b)}
    if find_spec("flip_evaluator") is not None:
        evaluate = import_module("flip_evaluator").evaluate
        row[f"flip{suffix}"] = float(evaluate(b, a, "LDR", applyMagma=False)[1])
    return row


def side_by_side(played: Picture, truth: Picture, direct: Picture) -> Picture:
    """Put played and traced pictures, and their differences times AMPLIFIED about grey, in a row:
    with bounces, then direct light alone."""

    def off(other: Picture) -> Picture:
        difference = AMPLIFIED * (played.astype(np.int64) - other)
        return np.asarray(np.clip(128 + difference, 0, 255), np.uint8)

    return np.concatenate([played, truth, off(truth), direct, off(direct)], axis=1)


def explained(scene: scenes.Scene, times: Sequence[float], setting: Setting) -> list[Row]:
    """Return the RMS error of the share of light that the bust leaves, step by step.

    rms : against the truth.  change : against the step before.  bias : mean, below 0 too dark. All
    over points where the truth or any step takes 2 % of a channel; none where it takes less
    everywhere, or no lamp shines.
    """
    caster = next(mesh for mesh in scene.meshes if mesh.shadow is not None)
    assert caster.shadow is not None
    mesh, rows = sources.load(caster.source), list[Row]()
    shadows = {OWN: caster.shadow} if setting.quick else {TALK: Shadow(**TALKS), OWN: caster.shadow}
    samples = setting.pick(16, 256)
    for time in times:
        where = shadow_steps.receivers(scene, time, PIXELS[0] if setting.quick else PIXELS[1])
        for name, shadow in shadows.items():
            shares = shadow_steps.shares(
                scene, caster, mesh, time, shadow=shadow, samples=samples, where=where
            )
            darkest = np.minimum.reduce([share.min(axis=1) for share in shares.values()])
            taken, before = darkest < 0.98, shares["truth"]
            if not taken.any():
                continue
            for step in shadow_steps.STEPS:
                off = (shares[step] - shares["truth"])[taken]
                change = (shares[step] - before)[taken]
                before = shares[step]
                row: Row = {"shadow": name, "time": time, "step": step}
                row |= {"rms": _rms(off), "change": _rms(change), "bias": float(off.mean())}
                rows.append(row)
    return rows


def mean_of(rows: Sequence[Row], name: str) -> Row:
    """Return the mean over the times of one shadow's rows."""
    own = [row for row in rows if row["shadow"] == name]
    numbers = [key for key in own[0] if key not in ("shadow", "time")]
    return {"shadow": name} | {k: float(np.mean([float(r[k]) for r in own])) for k in numbers}


def _pictures(table: Sequence[Row], key: str) -> Panel:
    """Plot PSNR by volume; key : the one that the title tells."""
    volumes = [row for row in table if row["kib"]]
    lines = {
        name: [(float(i), float(row[column])) for i, row in enumerate(volumes)]
        for name, column in (("with bounces", "psnr"), ("direct light", "psnr_direct"))
    }
    ticks = [str(row["shadow"]) for row in volumes]
    label = "PSNR, dB, mean of the moments"
    best = max(volumes, key=lambda row: float(row[key]))
    light = "In direct light" if key == "psnr_direct" else "With light that bounces"
    title = f'{light} "{best["shadow"]}" comes nearest: {float(best[key]):.1f} dB'
    return Panel(
        "", label, lines, scales=("linear", "linear"), ticks=ticks, joined=False, title=title
    )


def _steps(rows: Sequence[Row]) -> Panel:
    lines: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        place = float(shadow_steps.STEPS.index(str(row["step"])))
        lines.setdefault(f"{row['shadow']}, {row['time']:g} s", []).append(
            (place, float(row["rms"]))
        )
    label = "RMS error of the share of light"
    costs = {
        step: float(np.mean([float(r["change"]) for r in rows if r["step"] == step]))
        for step in shadow_steps.STEPS
    }
    most = max(costs, key=lambda step: costs[step])
    title = f'Of the steps from traced to played "{most}" costs most, {costs[most]:.3f}'
    return Panel(
        "", label, lines, scales=("linear", "linear"), ticks=shadow_steps.STEPS, title=title
    )


def _rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
