"""How fast does light among cubes settle, by evenly spread rays and by independent ones?

Errors of a nook after more and more passes, one ray a texel each, against light traced by Embree,
whose own error is taken off in squares. Rays along the cosine alone ask a binary question of each
direction; with aimed ones and all bounces light also has to travel.
"""

from __future__ import annotations

import numpy as np

from formats.voxels import Voxels
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import Answer, Panel, Row, Shot, lines_of
from pipelines.studies.cube_gathers import Card, Float
from pipelines.studies.gather_modes import followed, laid_out, pointed
from pipelines.studies.subjects import Setting

TAKES = ("voxels",)
KINDS = {"evenly spread": True, "independent": False}


def measure(setting: Setting) -> Answer:
    """Double passes and fit exponents."""
    _, nook = cube_gathers.worlds(setting.source)
    shots: dict[tuple[str, str], Shot] = {}
    most = setting.pick(10, 12)
    with cube_gathers.card() as card:
        rows = rays(card, nook, most, setting.pick(1024, 16384), setting.pick(1, 2), shots)
    slopes = {str(row["series"]): float(row["slope"]) for row in rows if "slope" in row}
    errors = {str(row["series"]): float(row["net_error"]) for row in rows if "slope" in row}
    even, independent = (f"{kind}, no bounces" for kind in KINDS)
    return Answer(
        question="gather_rays",
        title=f"Evenly spread rays: errors fall as passes^{slopes[even]:.2f}, by independent ones "
        f"as passes^{slopes[independent]:.2f}; after {1 << most:,} passes they are "
        f"{errors[even]:.2%} and {errors[independent]:.2%}",
        truth="Embree on the very cubes, its own error taken off",
        rows=rows,
        unit="RMS error of light, share of its RMS",
        axes={"bake_seconds": "processor seconds of gathering"},
        titles={
            "bake_seconds": f"After {1 << most:,} passes evenly spread rays err "
            f"{errors[independent] / errors[even]:.1f} times less"
        },
        shots=shots,
        panels=(
            Panel(
                "passes",
                "RMS error of light",
                lines_of(rows, "passes", "net_error", "series"),
                None,
                ("log", "log"),
                slopes=True,
                title=f"Slopes without bounces: {slopes[even]:.2f} evenly spread, "
                f"{slopes[independent]:.2f} independent",
            ),
        ),
        table=[row for row in rows if "slope" in row],
        figures={"slopes": slopes},
    )


def rays(
    card: Card,
    world: Voxels,
    most: int,
    truth_rays: int,
    kinds: int,
    shots: dict[tuple[str, str], Shot],
) -> list[Row]:
    """Double passes; fit the exponent of the error once bounces have settled."""
    faces = laid_out(world, 1)
    used = faces.cell() >= 0
    rows: list[Row] = []
    # Without bounces; and with all, which settle first
    for count, first in ((0, 4), (-1, 8))[:kinds]:
        marks = [1 << k for k in range(first, most + 1)]
        truth = cube_gathers.traced(world, faces, truth_rays, bounces=count)
        stated = float(truth.quality["relative_error"])
        view = cube_views.chosen(world, faces, cube_views.of_light(truth.irradiance))
        look = cube_views.shown(view, world, faces)
        for kind, spread in KINDS.items():
            gather = card.gather(world, faces, bounces=count, spread=spread)
            lights: list[Float] = []
            found = followed(card, gather, marks, faces, truth.irradiance, lights)
            # The truth errs too, by as much as it says
            own = [net(float(row["error"]), stated) for row in found]
            way = f"{kind}, {'no bounces' if count == 0 else 'all bounces'}"
            for row, light, e in zip(found, lights, own, strict=True):
                told: Row = {"way": way, "bounces": count, **row, "truth_error": stated}
                one = pointed(told | {"net_error": e}, "nook", light, truth.irradiance, used)
                one["default"] = int(spread and count != 0 and row is found[-1])
                shots["nook", str(one["setting"])] = look.shot(light, truth.irradiance)
                rows.append(one)
            rows[-1]["slope"] = cube_gathers.slope(marks, own)
    return rows


def net(error: float, of_truth: float) -> float:
    """Return an error without that of the truth, which is independent of it; at least a quarter."""
    return float(np.sqrt(max(error**2 - of_truth**2, (error / 4) ** 2)))
