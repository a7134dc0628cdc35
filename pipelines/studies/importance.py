"""Is it worth aiming rays at what glows?

Light of the courtyard without bounces after as much time, with half of the rays aimed at glowing
cells by their power and the others along the cosine, joined by multiple importance sampling, and
with none aimed. Errors are the sum of |error| over the sum of light, against Embree; RMS errors,
which tell of the few texels beside a glowing cell, stand in the table.
"""

from __future__ import annotations

import numpy as np

from bake import voxel_faces
from formats.lightmap import Faces
from formats.voxels import Voxels
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.cube_gathers import Card
from pipelines.studies.gather_lights import counts_of, glowing
from pipelines.studies.interval import Interval, ratio
from pipelines.studies.subjects import Setting

TAKES = ("voxels",)
WAYS = {"aimed": True, "free": False}
NAMES = {"aimed": "half of the rays aimed", "free": "none aimed"}


def measure(setting: Setting) -> Answer:
    """Gather with and without aiming, for the same time, as more and more cells glow."""
    passes, rays = setting.pick(24, 128), setting.pick(64, 1024)
    world, _ = cube_gathers.worlds(setting.source)
    faces = voxel_faces.layout(
        world.cells, texels=1, cell_size=world.cell_size, origin=world.origin
    )
    shots: dict[tuple[str, str], Shot] = {}
    rows: list[Row] = []
    with cube_gathers.card() as card:
        for count in counts_of(world)[:: setting.pick(2, 1)]:
            lit = glowing(world, faces, count)
            rows.append({"glowing": count} | errors(card, lit, faces, passes, rays, shots))
    gain = {int(r["glowing"]): float(r["free_mean"]) / float(r["aimed_mean"]) for r in rows}
    told = ", ".join(f"{each:.3g} with {count:,}" for count, each in gain.items())
    lost = [count for count, each in gain.items() if each < 1]
    kept = max((count for count, each in gain.items() if each > 1), default=0)
    verdict = f"Yes, up to {kept:,} glowing cells" if lost and kept else "Yes" if kept else "No"
    return Answer(
        question="importance",
        title=f"{verdict}: in the same time it divides the error by {told}",
        truth=f"{rays} rays of Embree a texel, no bounces",
        rows=[*rows, *points(rows)],
        unit="mean error of light after as much time, share of its mean",
        axes={"glowing": "glowing cells"},
        titles={
            "glowing": "Aiming divides the error by "
            + " and ".join(f"{gain[n]:.3g} with {n:,}" for n in (min(gain), max(gain)))
        },
        shots=shots,
        panels=(
            Panel(
                "glowing cells",
                "error without aiming over error with it",
                {
                    kind: [
                        (float(r["glowing"]), float(r[f"free_{name}"]) / float(r[f"aimed_{name}"]))
                        for r in rows
                    ]
                    for name, kind in (("mean", "mean error"), ("rms", "RMS error"))
                },
                None,
                ("log", "log"),
                title=f"Aiming is worth {max(gain.values()):.0f} times at most, "
                f"{min(gain.values()):.2g} at least",
            ),
        ),
        table=rows,
        figures={"gain": {str(count): each for count, each in gain.items()}},
    )


def points(rows: list[Row]) -> list[Row]:
    """Return each way of each row in the common form."""
    return [
        point(
            "courtyard",
            f"{row['glowing']:,} glowing, {NAMES[name]}",
            Interval(*(float(row[f"{name}_mean{end}"]) for end in ("", "_low", "_high"))),
            series=NAMES[name],
            frame_ms=float(row[f"{name}_ms"]),
            default=aim,
            glowing=row["glowing"],
        )
        for row in rows
        for name, aim in WAYS.items()
    ]


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
    row: Row = {f"{name}_ms": spent[name] for name in WAYS}
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
            what = f"{count:,} glowing, {NAMES[name]}"
            shots["courtyard", what] = view.shot(found, truth.irradiance)
    return row | {"truth_rms": float(truth.quality["relative_error"])}
