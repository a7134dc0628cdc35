"""What does a mesh cost and lack as lamps are added, lit directly and by transfer?

A mesh stands under 1 to 10,000 balls. Lit directly, each of its pixels sums all of them in closed
form, without shadows; a scene may have 16 for that, and what more of them would take is measured up
to what the card's shader holds. By transfer its vertices know what the mesh hides from them and how
light from all around falls on them, and lamps are projected on to that at six points.

Errors are those of the picture over its mean: against rays from the middle of each pixel to every
lamp, which the mesh itself may stop; and, lit directly, against sums over all lamps in double
precision: the middle one of all lit pixels, as some show several faces at once.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from bake import sources
from formats import scene as scenes
from formats.effects import MOST_LIGHTS
from maths import area_lights
from maths.colour import srgb_encode
from pipelines.bake_scene import bake_scene
from pipelines.studies import lamp_truth, stages
from pipelines.studies.answer import PRICES, Answer, Panel, Row, Shot, lines_of, point
from pipelines.studies.interval import Interval, blocks, fastest, ratio
from pipelines.studies.shadow_lights import KEY, SAMPLES, LitPlayer, lamps, lights, told
from pipelines.studies.subjects import Setting, placed
from runtime.shader import ShaderError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TAKES = ("mesh",)
COUNTS = (1, 4, MOST_LIGHTS, 100, 1_000, 10_000)
QUICK = (1, MOST_LIGHTS, 100, 10_000)
WAYS = {"direct": "surface", "transfer": "transfer"}
"""How the mesh is lit, and the pass that draws it."""
MOMENT = 2.0  # seconds, at which pictures are compared
SMOOTH = 0.98  # cosine between normals of neighbouring pixels: 11 degrees
DARK = 0.01  # of the mean: pixels below are not lit
BLOCK = 6  # pixels a side whose errors count as one
EACH = 1 << 20  # points times lamps at once


def measure(setting: Setting) -> Answer:
    """Draw one mesh under more and more lamps."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    with TemporaryDirectory() as folder:
        for way in WAYS:
            rows += _rows(Path(folder), way, setting, shots)
    return answered(rows, shots, setting)


def answered(rows: list[Row], shots: dict[tuple[str, str], Shot], setting: Setting) -> Answer:
    """Say what the rows tell."""
    direct, other = (
        {int(row["lamps"]): row for row in rows if row["series"] == way} for way in WAYS
    )
    each, largest, most = _each(direct), max(other), max(direct)
    # How many lamps lit directly cost as much as the mesh by transfer does with one
    equal = 1 + (float(other[1]["pass_ms"]) - float(direct[1]["pass_ms"])) / max(each, 1e-12)
    exact = max(float(row["formula_error"]) for row in direct.values())
    lacking = {
        way: f"{float(one[MOST_LIGHTS]['error']):.0%}"
        for way, one in (("direct", direct), ("transfer", other))
    }
    size = " x ".join(map(str, _sizes(setting)[0]))
    few, many = (float(other[n]["frame_ms"]) for n in (1, largest))
    beyond = [n for n in other if n > most]
    held = f"{most:,} compile here" + (f", {min(beyond):,} do not" if beyond else "")
    return Answer(
        question="mesh_lights",
        title=f"Lit directly, a lamp adds {each:.2g} ms to a frame of {size}, and {MOST_LIGHTS} "
        f"are the most that a scene may have; by transfer a frame takes {few:.0f} ms under 1 and "
        f"{many:,.0f} under {largest:,}. Under {MOST_LIGHTS} the picture errs by "
        f"{lacking['direct']} for want of shadows, by transfer {lacking['transfer']}",
        truth="rays from the middle of each pixel to every lamp; sums in double precision",
        rows=rows,
        unit="RMS error of the picture, share of its mean",
        axes={"lamps": "lamps", "frame_ms": PRICES["frame_ms"]},
        titles={
            "lamps": f"Under {most:,} lamps the picture errs by {float(direct[most]['error']):.0%} "
            f"without shadows, by transfer {float(other[most]['error']):.0%}",
            "frame_ms": f"A frame under {most:,} lamps takes "
            f"{float(direct[most]['frame_ms']):,.0f} ms directly, by transfer "
            f"{float(other[most]['frame_ms']):,.0f}",
        },
        shots=shots,
        panels=(
            Panel(
                "lamps",
                "processor milliseconds of the pass",
                lines_of(rows, "lamps", "pass_ms", "series"),
                None,
                ("log", "log"),
                title=f"Transfer costs less from {max(2, int(np.ceil(equal)))} lamps on; of those "
                f"lit directly {held}",
            ),
            Panel(
                "lamps",
                "error of the middle pixel against exact sums",
                lines_of(rows, "lamps", "formula_error", "series"),
                None,
                ("log", "log"),
                title=f"But for shadows half of all pixels are within {exact:.2%} of the exact sum",
            ),
        ),
        figures={"ms_a_lamp": each, "equal_lamps": equal, "formula_error": exact},
    )


def _each(direct: Mapping[int, Row]) -> float:
    """Return the pass's milliseconds a lamp, from the fewest to the most."""
    fewest, most = min(direct), max(direct)
    grown = float(direct[most]["pass_ms"]) - float(direct[fewest]["pass_ms"])
    return grown / max(most - fewest, 1)


def _sizes(setting: Setting) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the sizes of frames that are timed, and of those that are compared."""
    return ((160, 90), (64, 64)) if setting.quick else ((320, 180), (128, 128))


def _rows(
    folder: Path, way: str, setting: Setting, shots: dict[tuple[str, str], Shot]
) -> list[Row]:
    """Measure all numbers of lamps, those directly lit by one player each: its shader counts."""
    baked, path = baked_in(folder, way, setting)
    scene = scenes.load(path)
    size, small = _sizes(setting)
    rounds = setting.pick(3, 5)
    rows: list[Row] = []
    for count in QUICK if setting.quick else COUNTS:
        own = lamps("balls", count)
        # Shaders take a few thousand lamps at most
        with suppress(ShaderError), LitPlayer(baked, size, own) as player:
            player.reuse = False
            # The first frame compiles and allocates
            times = [once(player, way, float(k)) for k in range(rounds + 1)][1:]
            with LitPlayer(baked, small, own) as other:
                error, own_error, shot = compared(other, scene, count)
            what = told("balls", count)
            beyond = way == "direct" and count > MOST_LIGHTS
            named = f"{way}, {what}" + (", more than a scene may have" if beyond else "")
            row = point(
                setting.source.stem if setting.source else "bust",
                named,
                error,
                series=way,
                frame_ms=fastest([frame for frame, _ in times]),
                default=way == "direct" and not beyond,
                lamps=count,
                pass_ms=min(spent for _, spent in times),
            )
            if own_error is not None:
                row["formula_error"] = own_error
            rows.append(row)
            shots[str(row["subject"]), named] = shot
    return rows


def once(player: LitPlayer, way: str, time: float) -> tuple[float, float]:
    """Milliseconds of the processor, all threads together: of a frame, and of the pass in it."""
    drawn, spent = player.passes[WAYS[way]], list[float]()
    plain = drawn.draw

    def timed(time: float) -> None:
        player.ctx.finish()
        before = process_time()
        plain(time)
        player.ctx.finish()
        spent.append(1e3 * (process_time() - before))

    drawn.draw = timed
    started = process_time()
    player.draw(time)
    player.ctx.finish()
    whole = 1e3 * (process_time() - started)
    del drawn.draw
    return whole, sum(spent)


def compared(
    player: LitPlayer, scene: scenes.Scene, count: int
) -> tuple[Interval, float | None, Shot]:
    """Return the error of a played picture under some lamps, that against sums where it is lit by
    them, and what it looks like.

    scene : the same, with the sources that it was baked from.
    """
    own = lamps("balls", count)
    played = np.asarray(player.linear(MOMENT)[..., :3], np.float64)
    size = (played.shape[1], played.shape[0])
    world, surface, seen = lamp_truth.surfaces(scene, MOMENT, size)
    at, samples = (surface.front, surface.normal), max(1, SAMPLES // count)
    found = {"traced": lamp_truth.irradiance(world, *at, MOMENT, own, samples)}
    if player.scene.meshes[0].lighting == "direct":
        found["summed"] = sums(*at, own)
    truths = {name: lamp_truth.pictured(surface, light, seen) for name, light in found.items()}
    inner, traced = smooth(surface.normal, seen), truths["traced"]
    error = error_of(played, traced, inner)
    own_error = middle_error(played, truths["summed"], inner) if "summed" in truths else None
    scale = KEY / max(float(traced[inner].mean()), 1e-30)
    made, truth = (
        np.asarray(np.rint(255 * srgb_encode(np.clip(scale * p, 0, 1))), np.uint8)
        for p in (played, traced)
    )
    return error, own_error, Shot(made, truth)


def smooth(normals: Array, seen: Mask) -> Mask:
    """Say which pixels (h, w) show one smooth piece of the mesh, as do those around them: others
    are played as a mean of pieces, and rays go through their middles.

    normals : (n, 3) where `seen`.
    """
    whole = np.zeros((*seen.shape, 3))
    whole[seen] = normals
    found = minimum_filter(seen, 3)
    for axis in (0, 1):
        for step in (-1, 1):
            beside = np.einsum("hwi,hwi->hw", whole, np.roll(whole, step, axis))
            found &= beside > SMOOTH
    return np.asarray(found)


def error_of(played: Array, truth: Array, inner: Mask) -> Interval:
    """Return the RMS difference of pictures (h, w, 3) over the mean of the true one, where `inner`
    (h, w); its spread is that between blocks."""
    apart = np.where(inner, np.square(played - truth).mean(axis=-1), 0.0)
    parts, wholes = (blocks(v, BLOCK) for v in (apart, np.where(inner, 1.0, 0.0)))
    mean = max(float(truth[inner].mean()), 1e-30)
    square = ratio(parts[wholes > 0], wholes[wholes > 0] * mean**2)
    return Interval(*(float(np.sqrt(v)) for v in (square.value, square.low, square.high)))


def middle_error(played: Array, truth: Array, inner: Mask) -> float:
    """Return the median difference of pictures (h, w, 3) over the mean of the true one, where
    `inner` (h, w) and where it is lit."""
    mean = float(truth[inner].mean())
    lit = inner & (truth.mean(axis=-1) > DARK * mean)
    return float(np.median(np.abs(played - truth).mean(axis=-1)[lit])) / max(mean, 1e-30)


def sums(points: Array, normals: Array, own: Sequence[Any]) -> Array:
    """Return the irradiance (n, 3) of balls that nothing hides at points (n, 3) of unit normals."""
    total = np.zeros((len(points), 3))
    step = max(1, EACH // max(len(points), 1))
    for first in range(0, len(own), step):
        some = own[first : first + step]
        total += area_lights.sphere_irradiance(
            points[:, None],
            normals[:, None],
            np.array([lamp.position.at(MOMENT) for lamp in some]),
            np.array([lamp.radius for lamp in some]),
            np.array([lamp.radiance.at(MOMENT) for lamp in some]),
        ).sum(axis=1)
    return total


def baked_in(folder: Path, way: str, setting: Setting) -> tuple[Path, Path]:
    """Bake the scene; return its folder and its file."""
    source = placed(setting, "bust.glb", folder / "assets/meshes", 1.0)
    path = folder / f"assets/scenes/{way}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    data = described(way, source, quick=setting.quick)
    path.write_text(json.dumps(data), encoding="utf-8")
    return bake_scene(path, build_folder=folder / "build", store=stages.store()).folder, path


def described(way: str, source: Path, *, quick: bool) -> dict[str, Any]:
    """Return the scene as data: one mesh, its ball of radius 1 in the middle, under one lamp."""
    vertices = sources.load(source).vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    scale = 2.0 / max(float(np.linalg.norm(high - low)), 1e-30)
    knobs = {"bounces": 0} | ({"rays": 64, "edge": 0.1} if quick else {})
    mesh: dict[str, Any] = {
        "name": "mesh",
        "source": f"meshes/{source.name}",
        "scale": scale,
        "position": (-scale * (low + high) / 2).tolist(),
        "lighting": way,
    }
    if way == "transfer":
        mesh["transfer"] = knobs
    return {
        "format": 1,
        "time": {"duration": 10.0},
        "force": {"lights": True},
        "camera": {"position": [0, 0.6, 5], "target": [0, 0, 0], "focal_length_mm": 58},
        "lights": lights("balls", 1),
        "meshes": [mesh],
    }
