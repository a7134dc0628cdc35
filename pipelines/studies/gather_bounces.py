"""How often must light among cubes be handed on?

The nook's light with 0, 1, 2 ... bounces and with all, gathered on the card, against light traced
by Embree with all of them.
"""

from __future__ import annotations

from formats.voxels import Voxels
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import Answer, Panel, Row, Shot
from pipelines.studies.cube_gathers import Card
from pipelines.studies.gather_modes import laid_out, pointed
from pipelines.studies.subjects import Setting

TAKES = ("voxels",)
BOUNCES = (0, 1, 2, 3, 4, 6, 8, -1)
QUICK = (0, 1, 2, 4, -1)
DEFAULT = 4
SEEN = 0.01  # of the light: what is less is not


def measure(setting: Setting) -> Answer:
    """Hand light on fewer and more often."""
    _, nook = cube_gathers.worlds(setting.source)
    shots: dict[tuple[str, str], Shot] = {}
    counts = QUICK if setting.quick else BOUNCES
    with cube_gathers.card() as card:
        rows = bounces(card, nook, setting.pick(256, 2048), setting.pick(512, 8192), shots, counts)
    light = {int(r["times"]): float(r["light"]) for r in rows}
    errors = {int(r["times"]): float(r["error"]) for r in rows}
    whole = light[-1]
    enough = next((n for n in counts if abs(light[n] / whole - 1) < SEEN), -1)
    told_light = ", ".join(f"{light[n] / whole:.1%} after {named(n)}" for n in counts[:-1])
    return Answer(
        question="gather_bounces",
        title=f"{named(enough)} bounces are enough: {told_light} of all light; they err by "
        f"{errors[enough]:.1%}, all of them by {errors[-1]:.1%}",
        truth="Embree on the very cubes, all bounces; its own relative error stands in each row",
        rows=rows,
        unit="RMS error of light, share of its RMS",
        axes={"bake_seconds": "processor seconds of gathering"},
        shots=shots,
        panels=(
            Panel(
                "bounces",
                "RMS error of light",
                {"nook": [(float(k), float(row["error"])) for k, row in enumerate(rows)]},
                float(counts.index(DEFAULT)),
                ("linear", "log"),
                [str(row["bounces"]) for row in rows],
                title=f"From {named(enough)} bounces on noise is what is left",
            ),
        ),
        figures={"light": {named(n): share / whole for n, share in light.items()}},
    )


def bounces(
    card: Card,
    world: Voxels,
    passes: int,
    truth_rays: int,
    shots: dict[tuple[str, str], Shot],
    counts: tuple[int, ...],
) -> list[Row]:
    """Hand light on a few times only; the truth does so as often as it counts."""
    faces = laid_out(world, 1)
    used = faces.cell() >= 0
    truth = cube_gathers.traced(world, faces, truth_rays)
    view = cube_views.chosen(world, faces, cube_views.of_light(truth.irradiance))
    look = cube_views.shown(view, world, faces)
    rows: list[Row] = []
    for count in counts:
        gather = card.gather(world, faces, bounces=count)
        gather.step(2)
        spent = 1e3 * card.seconds(gather, passes - 2)
        light = gather.read()
        row: Row = {"passes": passes, "ms": spent}
        row |= {"truth_error": float(truth.quality["relative_error"])}
        row |= {"light": float(light[used].mean() / truth.irradiance[used].mean())}
        found = pointed(row | {"way": told(count)}, "nook", light, truth.irradiance, used)
        found |= {"bounces": named(count), "times": count, "default": int(count == DEFAULT)}
        shots["nook", str(found["setting"])] = look.shot(light, truth.irradiance)
        rows.append(found)
    return rows


def told(count: int) -> str:
    """Return how a number of bounces is told among other settings."""
    return "no bounces" if count == 0 else f"{named(count)} bounce{'s' if count != 1 else ''}"


def named(count: int) -> str:
    """Return how a number of bounces is told."""
    return "all" if count < 0 else str(count)
