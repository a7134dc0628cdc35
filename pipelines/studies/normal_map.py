"""When is baked light better than a normal map?

Sprites are shown under 32 suns over the hemisphere that nothing was fitted to, half of them under
30 degrees. The truth is traced with 64 rays a texel; errors are taken on values as a screen shows
them, weighed by coverage, a mean of the PSNR of each light. The normal map also stands at 1.5 and
2 times the texels, as many bytes as ring and dome, shown at the common size by an area filter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import billboard, dome_renders
from bake.photographs import Photographs
from formats.mesh import Mesh
from maths.colour import srgb_encode
from maths.image_error import rmse
from maths.sampling import GOLDEN_ANGLE
from pipelines.studies import normal_mapped, sprite_methods
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.interval import rms
from pipelines.studies.sprite_methods import Relit
from pipelines.studies.stages import processor_seconds
from pipelines.studies.subjects import Setting

Array = NDArray[np.float64]
Float = NDArray[np.float32]

TAKES = ("mesh",)
SUBJECTS = ("knot", "lantern", "oak", "bush")
CONVEX = "ball"
LIGHTS = 32
LOW = 30.0  # degrees: as many lights stand under it as above
LOWEST = 0.3  # sine of the elevation of the light that pictures stand in
LEAST = 1e-10  # error, 200 dB
RING, NEAR = 30.0, 10.0  # degrees: the ring's elevation, and how far its neighbours are
# Bytes a pixel, of the common size. Coverage is in all but the polynomials', which need one more
BYTES = {
    "normal": 8, "normal_12": 12, "normal_16": 16, "ptm": 18, "ptm_stored": 18,
    "ring": 12, "dome": 16, "dome_stored": 16,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Subject:
    """A mesh at one size. truth : under unseen lights. methods : name -> premultiplied linear
    radiance (h, w, 3) under a sun of irradiance pi. strengths : the normal map's sun, ambient.
    seconds : of the processor, to make each method's numbers."""

    truth: Photographs
    methods: dict[str, Relit]
    strengths: tuple[float, float]
    seconds: dict[str, float]


def measure(setting: Setting) -> Answer:
    """Fit everything to each mesh and compare under lights that none has seen."""
    rows: list[Row] = []
    table: list[Row] = []
    strengths: dict[str, tuple[float, float]] = {}
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in meshes(setting).items():
        one = subject(mesh, setting)
        strengths[name] = one.strengths
        found = errors(one)
        rows += rows_of(name, one, found)
        shots |= {(name, method): shot(one, method) for method in one.methods}
        means = {k: float(np.mean(-20 * np.log10(v))) for k, v in found.items()}
        table.append({"subject": name} | means)
    worth = {str(r["subject"]): gain(r, "dome", "normal_16") for r in table}
    wins = [name for name, decibels in worth.items() if decibels < 0]
    better = [decibels for decibels in worth.values() if decibels >= 0]
    title = f"The normal map wins on {', '.join(wins) or 'nothing here'}"
    if better:
        least, most = f"{min(better):.1f}", f"{max(better):.1f}"
        much = most if least == most else f"{least} to {most}"
        title = f"At equal bytes a dome is {much} dB better "
        title += f"than a normal map; the normal map wins on {', '.join(wins) or 'nothing here'}"
    return Answer(
        question="normal_map",
        title=title,
        truth=f"renders of 64 rays a texel under {LIGHTS} suns that no fit saw",
        rows=rows,
        unit="RMS error under unseen suns, share of white as a screen shows it",
        decibels=True,
        shots=shots,
        panels=[_panel(rows, part) for part in ("all", "near_ring")],
        table=table,
        figures={"dome_over_normal_map_db": worth, "sun_and_ambient": strengths},
    )


def meshes(setting: Setting) -> dict[str, Mesh]:
    """Return the meshes that shadow themselves, and a ball that does not; or the user's own."""
    found = setting.meshes(*SUBJECTS)
    return found if setting.source is not None else {**found, CONVEX: normal_mapped.ball()}


def gain(row: Row, method: str, other: str) -> float:
    """Return by how much one method's error is below another's, dB."""
    return float(row[method]) - float(row[other])


def unseen(count: int = LIGHTS) -> Array:
    """Return directions (count, 3) on a golden spiral, z even in .1 to .5 and in .5 to 1."""
    half = (np.arange(count // 2) + 0.5) / (count // 2)
    edge = np.sin(np.radians(LOW))
    z = np.concatenate([0.1 + (edge - 0.1) * half, edge + (1 - edge) * half])
    # A turn of its own, so that no light falls on one of the training spiral's
    turn, r = 1.0 + GOLDEN_ANGLE * np.arange(count), np.sqrt(1 - z * z)
    return np.asarray(np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1))


def subject(
    mesh: Mesh, setting: Setting, *, resolution: int = 0, lights: Array | None = None
) -> Subject:
    """Render a mesh under unseen lights and under a dome's, and fit every method to the second.

    resolution, lights : others than the study's.
    """
    resolution, samples = resolution or setting.pick(32, 192), setting.pick(4, 16)
    lights = unseen(setting.pick(8, LIGHTS)) if lights is None else lights
    directions = tuple((float(x), float(y), float(z)) for x, y, z in lights)
    truth = dome_renders.render(
        mesh,
        params=dome_renders.Params(
            resolution=resolution, samples=setting.pick(16, 64), directions=directions
        ),
    )
    training, lit = processor_seconds(
        dome_renders.render,
        mesh,
        params=dome_renders.Params(
            resolution=resolution, samples=samples, lights=setting.pick(24, 64)
        ),
    )
    knobs = billboard.Params(
        resolution=resolution, samples=samples, elevation=float(np.radians(RING))
    )
    plain, drawn = processor_seconds(normal_mapped.trace, mesh, knobs)
    sprite = normal_mapped.fitted(plain, training)
    methods: dict[str, Relit] = {"normal": sprite.relit}
    # The two strengths of a normal map's light could be guessed: renders are not its price
    seconds = {"normal": drawn}
    makers: dict[str, tuple[float, Callable[[], Relit]]] = {
        "normal_12": (0.0, lambda: sprite_methods.finer(mesh, knobs, sprite, 1.5)),
        "normal_16": (0.0, lambda: sprite_methods.finer(mesh, knobs, sprite, 2.0)),
        "ptm": (lit, lambda: sprite_methods.polynomials(training, "linear")),
        "ptm_stored": (lit, lambda: sprite_methods.polynomials(training, "stored")),
        "ring": (0.0, lambda: sprite_methods.ring(mesh, knobs)),
        "dome": (lit, lambda: sprite_methods.hemisphere(training, "linear")),
        "dome_stored": (lit, lambda: sprite_methods.hemisphere(training, "stored")),
    }
    for name, (before, make) in makers.items():
        methods[name], spent = processor_seconds(make)
        seconds[name] = before + spent
    return Subject(truth, methods, (sprite.sun, sprite.ambient), seconds)


def errors(one: Subject) -> dict[str, Array]:
    """Return the RMS error of each method under each light, as a screen shows it."""
    assert one.truth.coverage is not None
    weights = one.truth.coverage[..., None]
    found: dict[str, list[float]] = {name: [] for name in one.methods}
    for direction, picture in zip(one.truth.directions, one.truth.pictures, strict=True):
        truth = seen(picture)
        for name, relit in one.methods.items():
            found[name].append(max(rmse(seen(relit(direction)), truth, weights), LEAST))
    return {name: np.array(values) for name, values in found.items()}


def shot(one: Subject, method: str) -> Shot:
    """Return a subject under its lowest light by one method, and traced."""
    lowest = int(np.argmin(np.abs(one.truth.directions[:, 2] - LOWEST)))
    pictures = (one.methods[method](one.truth.directions[lowest]), one.truth.pictures[lowest])
    made, truth = (np.asarray(np.rint(255 * seen(p)), np.uint8) for p in pictures)
    return Shot(made, truth)


def seen(radiance: Float) -> Array:
    """Return linear values as a screen shows them, 0..1."""
    return np.asarray(srgb_encode(np.clip(radiance, 0, 1)), np.float64)


def rows_of(name: str, one: Subject, found: dict[str, Array]) -> list[Row]:
    """Return a row a method: its bytes, and its PSNR under all lights, low and high ones, and those
    near the ring's own elevation."""
    elevation = np.degrees(np.arcsin(one.truth.directions[:, 2]))
    low, near = elevation < LOW, np.abs(elevation - RING) < NEAR
    assert one.truth.coverage is not None
    texels = one.truth.coverage.size
    rows = []
    for method, errors in found.items():
        values = -20 * np.log10(errors)
        row = point(
            name,
            method,
            rms(np.square(errors)),
            series=method,
            bake_seconds=one.seconds.get(method),
            bytes=BYTES[method] * texels,
            default=method == "dome",
            method=method,
            bytes_a_pixel=BYTES[method],
        )
        row |= {"all": float(values.mean()), "low": float(values[low].mean())}
        row |= {"high": float(values[~low].mean()), "near_ring": float(values[near].mean())}
        rows.append(row | {"worst": float(values.min())})
    return rows


def _panel(rows: list[Row], part: str) -> Panel:
    names = list(dict.fromkeys(str(r["subject"]) for r in rows))
    lines = {
        name: [
            (float(i), float(r[part]))
            for i, r in enumerate(r for r in rows if r["subject"] == name)
        ]
        for name in names
    }
    ticks = [method.replace("_", "\n") for method in BYTES]
    title = {"all": "all lights", "near_ring": f"within {NEAR:g} degrees of the ring"}
    means = {
        method: float(np.mean([float(r[part]) for r in rows if r["method"] == method]))
        for method in ("normal_16", "ring", "dome")
    }
    return Panel(
        "",
        f"PSNR, dB ({title[part]})",
        lines,
        scales=("linear", "linear"),
        ticks=ticks,
        title=f"{title[part].capitalize()}: dome {means['dome']:.1f} dB, ring {means['ring']:.1f}, "
        f"normal map of as many bytes as the dome {means['normal_16']:.1f}, on the mean",
    )
