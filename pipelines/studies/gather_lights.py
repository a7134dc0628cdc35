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
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.cube_gathers import Card
from pipelines.studies.interval import Interval, ratio
from pipelines.studies.subjects import Setting

TAKES = ("voxels",)
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
    rounds, passes = setting.pick(3, 30), setting.pick(48, 128)
    rays = setting.pick(256, 1024)
    world, _ = cube_gathers.worlds(setting.source)
    shots: dict[tuple[str, str], Shot] = {}
    counts = counts_of(world)[:: setting.pick(2, 1)]
    rows = measured(world, counts, rounds, passes, rays, shots)
    ratios = {name: spread_of([float(row[name]) for row in rows]) for name in LINES}
    later = {name: spread_of([float(row[name]) for row in rows[1:] or rows]) for name in LINES}
    gain = [float(row["free_mean"]) / float(row["aimed_mean"]) for row in rows]
    return Answer(
        question="gather_lights",
        title=f"A pass takes at most {ratios['talk_ms']:.2f} times as long with "
        f"{rows[-1]['glowing']:,} glowing cells as with 1 (`talk`; `exact` "
        f"{ratios['exact_ms']:.2f}); aiming rays divides the error by "
        + ", ".join(
            f"{each:.3g} with {row['glowing']:,}" for each, row in zip(gain, rows, strict=True)
        ),
        truth=f"{rays} rays of Embree a texel, no bounces; times are the processor's",
        rows=[*rows, *points(rows)],
        unit="mean error of light after as much time, share of its mean",
        axes={"glowing": "glowing cells"},
        shots=shots,
        table=rows,
        panels=panels(rows),
        figures={"ratios": ratios, "ratios_without_1": later, "gain": gain},
    )


def counts_of(world: Voxels) -> tuple[int, ...]:
    """Return those of COUNTS that a world has cells for which show."""
    faces = voxel_faces.layout(world.cells, texels=1)
    most = len(np.unique(faces.cell())) - 1
    return tuple(count for count in COUNTS if count <= most)


def points(rows: list[Row]) -> list[Row]:
    """Return each way of each row in the common form."""
    return [
        point(
            "courtyard",
            f"{row['glowing']:,} glowing, {'half of the rays aimed' if aim else 'none aimed'}",
            Interval(*(float(row[f"{name}_mean{end}"]) for end in ("", "_low", "_high"))),
            series="half of the rays aimed" if aim else "none aimed",
            frame_ms=float(row["exact_ms"]) if aim else float(row["free_ms"]),
            default=aim,
            glowing=row["glowing"],
        )
        for row in rows
        for name, aim in WAYS.items()
    ]


def measured(
    world: Voxels,
    counts: tuple[int, ...],
    rounds: int,
    passes: int,
    rays: int,
    shots: dict[tuple[str, str], Shot] | None = None,
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
            rows.append(row | errors(card, worlds[count], faces, passes, rays, shots))
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


def errors(
    card: Card,
    world: Voxels,
    faces: Faces,
    passes: int,
    rays: int,
    shots: dict[tuple[str, str], Shot] | None = None,
) -> Row:
    """Return the errors after as much time with and without aiming, and that of the truth."""
    used = faces.cell() >= 0
    truth = cube_gathers.traced(world, faces, rays, bounces=0)
    gathers = {name: card.gather(world, faces, bounces=0, aim=aim) for name, aim in WAYS.items()}
    spent = card.best(gathers, 4, 3)
    row: Row = {"free_ms": spent["free"]}
    view = cube_views.shown(
        cube_views.chosen(world, faces, cube_views.of_light(truth.irradiance)), world, faces
    )
    for name, aim in WAYS.items():
        # A pair of passes is the least
        count = max(2, 2 * round(passes * spent["aimed"] / spent[name] / 2))
        gather = card.gather(world, faces, bounces=0, aim=aim, seed=1)
        gather.step(count)
        found = gather.read()
        row[f"{name}_passes"] = count
        row[f"{name}_rms"] = cube_gathers.error_of(found, truth.irradiance, used)
        apart = np.abs(found - truth.irradiance)
        mean = ratio(*cube_gathers.blocks_of(apart, truth.irradiance, used))
        row |= {f"{name}_mean": mean.value}
        row |= {f"{name}_mean_low": mean.low, f"{name}_mean_high": mean.high}
        if shots is not None:
            count = int(np.count_nonzero(world.emission[world.cells].any(axis=-1)))
            way = "half of the rays aimed" if aim else "none aimed"
            shots["courtyard", f"{count:,} glowing, {way}"] = view.shot(found, truth.irradiance)
    return row | {"truth_rms": float(truth.quality["relative_error"])}


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
