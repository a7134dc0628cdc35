"""Does a pass of a gather cost the same for 1 glowing cell and for 10,000?

Cells of the courtyard that show are made to glow at random, 1 to 10,000 of them, all together as
bright; nothing else changes. Measured are processor milliseconds of a pass by the talk's way and
by exact rays, the cells that such a ray looks at, and the error of light without bounces after as
much time, with half of the rays aimed at what glows and with none. The best of a few rounds in
turn counts: other work can only slow one down. From a single glowing cell whole walls face away
and their rays end at once, so ratios are told from 10 on, too.

RMS errors tell of the few texels beside a glowing cell; mean errors, the sum of |error| over the
sum of light, of all others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bake import voxel_faces
from formats.lightmap import Faces
from formats.voxels import Voxels
from pipelines.studies import cube_gathers
from pipelines.studies.answer import Answer, Panel, Row
from pipelines.studies.cube_gathers import Card
from pipelines.studies.subjects import Setting

COUNTS = (1, 10, 100, 1_000, 10_000)
MODES = ("talk", "exact")
WAYS = {"aimed": True, "free": False}
POWER = 1e4
"""Radiance of all glowing cells together, W/(m2 sr)."""
LINES = {
    "talk_ms": "talk",
    "exact_ms": "exact",
    "exact_ns_a_cell": "exact, a cell visited",
}


def measure(setting: Setting) -> Answer:
    """Time passes with more and more glowing cells; compare their light with traced light."""
    rounds, passes = setting.pick(8, 30), setting.pick(64, 128)
    rays = setting.pick(256, 1024)
    rows = measured(cube_gathers.courtyard(), COUNTS, rounds, passes, rays)
    ratios = {name: spread_of([float(row[name]) for row in rows]) for name in LINES}
    later = {name: spread_of([float(row[name]) for row in rows[1:]]) for name in LINES}
    gain = [float(row["free_mean"]) / float(row["aimed_mean"]) for row in rows]
    return Answer(
        question="gather_lights",
        title=f"from {COUNTS[0]} (from {COUNTS[1]}) to {COUNTS[-1]:,} glowing cells, longest over "
        f"shortest: a pass of `talk` {told(ratios, later, 'talk_ms')}, of `exact` "
        f"{told(ratios, later, 'exact_ms')}, a cell that its rays visit "
        f"{told(ratios, later, 'exact_ns_a_cell')}; aiming divides the mean error of as much time "
        f"by " + ", ".join(f"{each:.3g}" for each in gain),
        truth=f"{rays} rays of Embree a texel, no bounces; times are the processor's",
        rows=rows,
        panels=panels(rows),
        figures={"ratios": ratios, "ratios_from_10": later, "gain": gain},
    )


def measured(
    world: Voxels, counts: tuple[int, ...], rounds: int, passes: int, rays: int
) -> list[Row]:
    """Return one row for each number of glowing cells."""
    faces = voxel_faces.layout(
        world.cells, texels=1, cell_size=world.cell_size, origin=world.origin
    )
    worlds = {count: glowing(world, faces, count) for count in counts}
    with cube_gathers.card() as card:
        gathers = {
            (mode, count): card.gather(worlds[count], faces, mode=mode, bounces=0)
            for count in counts
            for mode in MODES
        }
        spent = card.best(gathers, 8, rounds)
        rows: list[Row] = []
        for count in counts:
            lengths = {name: visits(card, worlds[count], faces, aim) for name, aim in WAYS.items()}
            exact = spent["exact", count]
            texels = int(np.count_nonzero(faces.cell() >= 0))
            row: Row = {"glowing": count}
            row |= {f"{mode}_ms": spent[mode, count] for mode in MODES}
            row |= {f"{name}_visits": length for name, length in lengths.items()}
            row["exact_ns_a_cell"] = 1e6 * exact / texels / lengths["aimed"]
            rows.append(row | errors(card, worlds[count], faces, passes, rays))
    return rows


def glowing(world: Voxels, faces: Faces, count: int) -> Voxels:
    """Let so many cells that show glow, and no others, each its share of POWER; the more hold the
    fewer."""
    shown = np.unique(faces.cell()[faces.cell() >= 0])
    chosen = np.random.default_rng(0).permutation(shown)[:count]
    if len(chosen) < count:
        raise ValueError(f"only {len(shown)} cells show: {count} of them cannot glow.")
    cells, rows = world.cells.copy(), len(world.albedo)
    cells.reshape(-1)[chosen] += np.uint16(rows)
    emission = np.zeros((2 * rows, 3), np.float32)
    emission[rows:] = POWER / count
    return replace(world, cells=cells, albedo=np.tile(world.albedo, (2, 1)), emission=emission)


def visits(card: Card, world: Voxels, faces: Faces, aim: bool) -> float:
    """Return the cells that a ray looks at, on the mean."""
    gather = card.gather(world, faces, visits=True, aim=aim, bounces=0)
    gather.step(32)
    return float(gather.read()[..., 0][faces.cell() >= 0].mean())


def errors(card: Card, world: Voxels, faces: Faces, passes: int, rays: int) -> Row:
    """Return the errors after as much time with and without aiming, and that of the truth."""
    used = faces.cell() >= 0
    truth = cube_gathers.traced(world, faces, rays, bounces=0)
    gathers = {name: card.gather(world, faces, bounces=0, aim=aim) for name, aim in WAYS.items()}
    spent = card.best(gathers, 4, 3)
    row: Row = {}
    for name, aim in WAYS.items():
        # A pair of passes is the least
        count = max(2, 2 * round(passes * spent["aimed"] / spent[name] / 2))
        gather = card.gather(world, faces, bounces=0, aim=aim, seed=1)
        gather.step(count)
        found = gather.read()
        row[f"{name}_passes"] = count
        row[f"{name}_rms"] = cube_gathers.error_of(found, truth.irradiance, used)
        apart = np.abs(found[used] - truth.irradiance[used])
        row[f"{name}_mean"] = float(apart.mean() / truth.irradiance[used].mean())
    return row | {"truth_rms": float(truth.quality["relative_error"])}


def told(ratios: dict[str, float], later: dict[str, float], name: str) -> str:
    """Return a ratio from 1 glowing cell on, and from 10 on."""
    return f"{ratios[name]:.2f} ({later[name]:.2f})"


def spread_of(values: list[float]) -> float:
    """Return the largest over the smallest."""
    return max(values) / min(values)


def panels(rows: list[Row]) -> tuple[Panel, ...]:
    """Plot times, path lengths and errors."""

    def line(name: str, scale: float = 1.0) -> list[tuple[float, float]]:
        return [(float(row["glowing"]), scale * float(row[name])) for row in rows]

    scales, x = ("log", "log"), "glowing cells"
    times = {label: line(name) for name, label in list(LINES.items())[:2]}
    return (
        Panel(x, "processor milliseconds of a pass", times, None, ("log", "linear")),
        Panel(
            x,
            "cells that a ray visits; ns for each",
            {
                "visited, half of the rays aimed": line("aimed_visits"),
                "visited, none aimed": line("free_visits"),
                "ns a visited cell": line("exact_ns_a_cell"),
            },
            None,
            ("log", "linear"),
        ),
        Panel(
            x,
            "error after as much time",
            {
                f"{label}, {kind}": line(f"{name}_{kind}")
                for name, label in (("aimed", "half aimed"), ("free", "none aimed"))
                for kind in ("mean", "rms")
            },
            None,
            scales,
        ),
    )
