"""By which rays is light among cubes gathered best: marched in so many steps, exact, or in leaps?

Errors are RMS over texels of the courtyard, over the RMS of light traced by Embree through the very
cubes; times are those of the processor. Marches of few steps are quick and miss thin walls, which
no number of passes mends.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import voxel_faces
from formats.lightmap import Faces
from formats.voxels import Voxels
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import Answer, Panel, Row, Shot, lines_of, point
from pipelines.studies.cube_gathers import Card, Float, error_of, interval_of
from pipelines.studies.subjects import Setting

TAKES = ("voxels",)
STEPS = (5, 10, 20, 40)
WAYS: dict[str, dict[str, Any]] = {
    **{f"march {n}": {"mode": "march", "samples": n} for n in STEPS},
    "exact": {"mode": "exact"},
    "sphere": {"mode": "sphere"},
}
CITED = "march 20"


def measure(setting: Setting) -> Answer:
    """Follow rays in every way, after more and more passes."""
    # A part of the world settles further in the time of a quick run
    world = cube_gathers.worlds(setting.source)[setting.pick(1, 0)]
    subject = "nook" if setting.quick else "courtyard"
    shots: dict[tuple[str, str], Shot] = {}
    marks = [1 << k for k in range(3, setting.pick(9, 10))]
    with cube_gathers.card() as card:
        rows = ways(card, world, marks, setting.pick(512, 2048), shots, subject)
    last = {str(r["way"]): r for r in rows if r["passes"] == marks[-1]}
    errors = {way: float(r["error"]) for way, r in last.items()}
    times = {way: float(r["ms"]) / float(last["exact"]["ms"]) for way, r in last.items()}
    few = f"march {STEPS[0]}"
    return Answer(
        question="gather_modes",
        title=f"Exact rays: after {marks[-1]} passes they err by {errors['exact']:.1%}, "
        f"{STEPS[2]} steps by {errors[CITED]:.1%} in {times[CITED]:.2f} of the time, {STEPS[0]} "
        f"steps by {errors[few]:.1%} in {times[few]:.2f}; leaps by {errors['sphere']:.1%} in "
        f"{times['sphere']:.2f}",
        truth="Embree on the very cubes; its own relative error stands in each row",
        rows=rows,
        unit="RMS error of light, share of its RMS",
        axes={"bake_seconds": "processor seconds of gathering"},
        titles={
            "bake_seconds": f"At {marks[-1]} passes {STEPS[0]} steps have {errors[few]:.0%} of "
            f"error, exact rays {errors['exact']:.1%}"
        },
        shots=shots,
        panels=(
            Panel(
                "passes",
                "RMS error of light",
                lines_of(rows, "passes", "error", "way"),
                None,
                ("log", "log"),
                slopes=True,
                title=f"From {marks[0]} to {marks[-1]} passes the error of exact rays falls "
                f"{gain(rows, 'exact'):.1f} times, of {STEPS[0]} steps {gain(rows, few):.1f} times",
            ),
        ),
        figures={"errors": errors, "time_over_exact": times},
    )


def gain(rows: list[Row], way: str) -> float:
    """Return the first error of a way over its last."""
    own = [float(r["error"]) for r in rows if r["way"] == way]
    return own[0] / own[-1]


def ways(
    card: Card,
    world: Voxels,
    marks: list[int],
    truth_rays: int,
    shots: dict[tuple[str, str], Shot],
    subject: str,
) -> list[Row]:
    """Follow rays in every way, one texel a face."""
    faces = laid_out(world, 1)
    truth = cube_gathers.traced(world, faces, truth_rays)
    stated = float(truth.quality["relative_error"])
    view = cube_views.chosen(world, faces, cube_views.of_light(truth.irradiance))
    look = cube_views.shown(view, world, faces)
    rows: list[Row] = []
    for way, knobs in WAYS.items():
        gather = card.gather(world, faces, **knobs)
        lights: list[Float] = []
        found = followed(card, gather, marks, faces, truth.irradiance, lights)
        for row, light in zip(found, lights, strict=True):
            told: Row = {"way": way, **row, "truth_error": stated}
            row = pointed(told, subject, light, truth.irradiance, faces.cell() >= 0)
            row["default"] = int(way == "exact" and row["passes"] == marks[-1])
            shots[subject, str(row["setting"])] = look.shot(light, truth.irradiance)
            rows.append(row)
    return rows


def pointed(row: Row, subject: str, found: Float, truth: Float, used: NDArray[np.bool_]) -> Row:
    """Return a row in the common form."""
    what = f"{row['way']}, {row['passes']} passes"
    error, seconds = interval_of(found, truth, used), float(row["ms"]) / 1e3
    more = {name: value for name, value in row.items() if name != "error"}
    return point(subject, what, error, series=str(row["way"]), bake_seconds=seconds) | more


def followed(
    card: Card,
    gather: Any,
    marks: list[int],
    faces: Faces,
    truth: Float,
    lights: list[Float] | None = None,
) -> list[Row]:
    """Return passes, processor milliseconds and error at each mark; add the light of each."""
    used = faces.cell() >= 0
    # What compiles is not counted, nor are its two passes
    gather.step(2)
    rows: list[Row] = []
    spent = 0.0
    for mark in marks:
        spent += 1e3 * card.seconds(gather, mark - gather.since)
        found = gather.read()
        rows.append({"passes": mark, "ms": spent, "error": error_of(found, truth, used)})
        if lights is not None:
            lights.append(found)
    return rows


def laid_out(world: Voxels, texels: int) -> Faces:
    """Return the layout of a world."""
    return voxel_faces.layout(
        world.cells, texels=texels, cell_size=world.cell_size, origin=world.origin
    )
