"""Does a pass of a gather cost the same for 1 glowing cell and for 10,000?

Cells of the courtyard that show are made to glow at random, 1 to 10,000 of them, all together as
bright; nothing else changes. Measured are processor milliseconds of a pass by the talk's way and
by exact rays, the cells that such a ray looks at, and the error of light without bounces, gathered
and baked; each is held to the other's way. The best of a few rounds in turn counts: other work can
only slow one down. From a single glowing cell whole walls face away and their rays end at once, so
ratios are told from 10 on, too. Errors are the sum of |error| over the sum of light.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bake import lightmap, voxel_faces
from formats.lightmap import Faces
from formats.voxels import Voxels
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.cube_gathers import Card
from pipelines.studies.interval import Interval, ratio
from pipelines.studies.stages import processor_seconds
from pipelines.studies.subjects import Setting

TAKES = ("voxels",)
COUNTS = (1, 10, 100, 1_000, 10_000)
MODES = ("talk", "exact")
WAYS = {"aimed": True, "free": False}
BAKED_RAYS = 64
MOST = 1.25  # longest over shortest pass that counts as the same: clocks of shared machines scatter
POWER = 1e4
"""Radiance of all glowing cells together, W/(m2 sr)."""
LINES = {
    "talk_ms": "talk",
    "exact_ms": "exact",
    "exact_ns_a_cell": "exact, a cell visited",
}


def measure(setting: Setting) -> Answer:
    """Time passes with more and more glowing cells; compare their light with traced light."""
    rounds, passes = setting.pick(2, 30), setting.pick(32, 128)
    rays, more = setting.pick(64, 1024), setting.pick(0, 1024)
    world, _ = cube_gathers.worlds(setting.source)
    shots: dict[tuple[str, str], Shot] = {}
    counts = counts_of(world)[:: setting.pick(2, 1)]
    rows = measured(world, counts, rounds, passes, rays, shots, more)
    ratios = {name: spread_of([float(row[name]) for row in rows]) for name in LINES}
    later = {name: spread_of([float(row[name]) for row in rows[1:] or rows]) for name in LINES}
    found = [float(row["error"]) for row in rows]
    return Answer(
        question="gather_lights",
        title=f"Yes: a pass takes at most {ratios['talk_ms']:.2f} times as long with "
        f"{rows[-1]['glowing']:,} glowing cells as with 1 (`talk`; `exact` "
        f"{ratios['exact_ms']:.2f}); light errs by {min(found):.2%} to {max(found):.1%} after "
        f"{passes} passes, whatever glows"
        if ratios["talk_ms"] < MOST
        else f"Not quite: a pass takes {ratios['talk_ms']:.2f} times as long with some number of "
        f"glowing cells as with another (`talk`; `exact` {ratios['exact_ms']:.2f})",
        truth=f"{rays} rays of Embree a texel, no bounces; of the baked lightmap, {more:,} passes",
        rows=[*rows, *points(rows)],
        unit="mean error of light, share of its mean",
        axes={"glowing": "glowing cells"},
        titles={"glowing": f"Light errs by {min(found):.2%} to {max(found):.1%}"},
        shots=shots,
        table=rows,
        panels=panels(rows),
        figures={"ratios": ratios, "ratios_without_1": later, "errors": found},
    )


def counts_of(world: Voxels) -> tuple[int, ...]:
    """Return those of COUNTS that a world has cells for which show."""
    faces = voxel_faces.layout(world.cells, texels=1)
    most = len(np.unique(faces.cell())) - 1
    return tuple(count for count in COUNTS if count <= most)


def points(rows: list[Row]) -> list[Row]:
    """Return each technique of each row in the common form."""
    found = [
        point(
            "courtyard",
            told("gathered", int(row["glowing"])),
            Interval(*(float(row[f"error{end}"]) for end in ("", "_low", "_high"))),
            series="gathered",
            frame_ms=float(row["exact_ms"]),
            default=True,
            glowing=row["glowing"],
        )
        for row in rows
    ]
    return found + [
        point(
            "courtyard",
            told("baked lightmap", int(row["glowing"])),
            Interval(*(float(row[f"baked{end}"]) for end in ("", "_low", "_high"))),
            series="baked lightmap",
            bake_seconds=float(row["baked_seconds"]),
            glowing=row["glowing"],
        )
        for row in rows
        if "baked" in row
    ]


def told(kind: str, count: int) -> str:
    """Return how a setting is told."""
    return f"{kind}, {count:,} glowing"


def measured(
    world: Voxels,
    counts: tuple[int, ...],
    rounds: int,
    passes: int,
    rays: int,
    shots: dict[tuple[str, str], Shot] | None = None,
    more: int = 0,
) -> list[Row]:
    """Return one row for each number of glowing cells.

    more : passes that a baked lightmap is held to; 0 leaves it out.
    """
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
            rows.append(row | errors(card, worlds[count], faces, (passes, rays, more), shots))
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
    efforts: tuple[int, int, int],
    shots: dict[tuple[str, str], Shot] | None = None,
) -> Row:
    """Return the error of gathered light against traced, and of a baked lightmap against gathered.

    efforts : passes, rays of the truth, and passes that the lightmap is held to.
    """
    passes, rays, more = efforts
    used = faces.cell() >= 0
    truth = cube_gathers.traced(world, faces, rays, bounces=0).irradiance
    gather = card.gather(world, faces, bounces=0, seed=1)
    gather.step(passes)
    pairs = {"error": ("gathered", gather.read(), truth)}
    row: Row = {}
    if more:
        params = lightmap.Params(texels=1, rays=BAKED_RAYS, bounces=0, target=0.0)
        made, row["baked_seconds"] = processor_seconds(lightmap.gather, world, faces, params=params)
        gather.step(more - passes)
        pairs["baked"] = ("baked lightmap", made.irradiance, gather.read())
    view = cube_views.shown(
        cube_views.chosen(world, faces, cube_views.of_light(truth)), world, faces
    )
    count = int(np.count_nonzero(world.emission[world.cells].any(axis=-1)))
    for name, (kind, found, right) in pairs.items():
        mean = ratio(*cube_gathers.blocks_of(np.abs(found - right), right, used))
        row |= {name: mean.value, f"{name}_low": mean.low, f"{name}_high": mean.high}
        if shots is not None:
            shots["courtyard", told(kind, count)] = view.shot(found, right)
    return row


def spread_of(values: list[float]) -> float:
    """Return the largest over the smallest."""
    return max(values) / min(values)


def mean_of(rows: list[Row], name: str) -> float:
    """Return the mean of a column."""
    return float(np.mean([float(row[name]) for row in rows]))


def panels(rows: list[Row]) -> tuple[Panel, ...]:
    """Plot times and path lengths."""

    def line(name: str, scale: float = 1.0) -> list[tuple[float, float]]:
        return [(float(row["glowing"]), scale * float(row[name])) for row in rows]

    x = "glowing cells"
    times = {label: line(name) for name, label in list(LINES.items())[:2]}
    return (
        Panel(
            x, "processor milliseconds of a pass", times, None, ("log", "linear"),
            title=f"Longest over shortest pass: {spread_of([t for _, t in times['talk']]):.2f} "
            f"(talk), {spread_of([t for _, t in times['exact']]):.2f} (exact)",
        ),
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
            title=f"A ray looks at {mean_of(rows, 'free_visits'):.1f} cells, half aimed "
            f"{min(v for _, v in line('aimed_visits')):.1f} to "
            f"{max(v for _, v in line('aimed_visits')):.1f}",
        ),
    )  # fmt: skip
