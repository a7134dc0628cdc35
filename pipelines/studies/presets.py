"""Are the presets draft, balanced, fine and reference worth their price?

Each kind of asset is baked as each preset would, and with knobs beside it. A sprite is held against
renders of its mesh as it stands `SCREEN` pixels high on the screen, so that coarse texels count; a
shadow, light of a mesh from itself, photographs and cubes as asking by price does; a whole scene
against the picture of the preset `reference`, its own resolutions quartered. A preset is worth its
price where nothing of as few bytes gives an error as small, within a twentieth, for far fewer
seconds. Seconds are of the processor.
"""

from __future__ import annotations

from collections.abc import Iterator

from pipelines.studies import presets_of
from pipelines.studies.answer import PRICES, Answer, Panel, Row, lines_of, point
from pipelines.studies.interval import Interval
from pipelines.studies.presets_of import Tried
from pipelines.studies.subjects import Setting

TAKES = ("mesh",)
SLACK = 1.05  # errors that count as the same


def measure(setting: Setting) -> Answer:
    """Bake by every preset, and beside it."""
    rows = [row_of(found) for found in tried(setting)]
    for row in rows:
        if row["preset"]:
            row["of_cheapest"] = float(row["bake_seconds"]) / cheapest(row, rows)
    named = [row for row in rows if row["preset"]]
    # The last is for truth, whatever it costs
    own = [row for row in named if row["preset"] != "reference"]
    worst = max(own, key=lambda row: float(row["of_cheapest"]))
    return Answer(
        question="presets",
        title="Below reference no preset takes more than "
        f"{float(worst['of_cheapest']):.1f} times the seconds that its error and its bytes need",
        truth="renders, rays and lights of their own; of a scene, the preset reference",
        rows=rows,
        unit="relative error, each kind's own",
        axes={name: PRICES[name] for name in ("bake_seconds", "bytes")},
        panels=(
            Panel(
                PRICES["bake_seconds"],
                "relative error, each kind's own",
                lines_of(named, "bake_seconds", "error", "subject"),
                None,
                ("log", "log"),
                title="What the presets buy, kind by kind",
            ),
        ),
        table=named,
        figures={"presets": len(named), "worst_of_cheapest": float(worst["of_cheapest"])},
    )


def tried(setting: Setting) -> Iterator[Tried]:
    """List everything that is baked, presets with the knobs beside them."""
    if setting.source is not None:
        yield from presets_of.sprites(setting.source, setting)
        yield from presets_of.shadows(setting.source, setting)
        return
    for name in ("bust", "bell")[: setting.pick(1, 2)]:
        yield from presets_of.shadows(presets_of.mesh_file(name), setting)
    yield from presets_of.transfers(presets_of.mesh_file("bust"), setting)
    yield from presets_of.photographs(setting)
    yield from presets_of.lightmaps(setting)
    for name in ("bust", "oak")[: setting.pick(1, 2)]:
        yield from presets_of.sprites(presets_of.mesh_file(name), setting)
    if not setting.quick:
        yield from presets_of.scene(setting)


def row_of(found: Tried) -> Row:
    """Return a measurement in the common form."""
    error = found.error
    interval = Interval(error.value, error.low, error.high)
    return point(
        found.subject, found.knobs, interval, series=found.subject.split(",")[-1].strip(),
        bake_seconds=found.seconds, bytes=found.bytes,
        default=found.preset == "balanced", preset=found.preset,
    )  # fmt: skip


def cheapest(row: Row, rows: list[Row]) -> float:
    """Return the fewest seconds for an error as small in as few bytes."""
    return min(
        float(other["bake_seconds"])
        for other in rows
        if other["subject"] == row["subject"]
        and float(other["error"]) <= SLACK * float(row["error"])
        and int(other["bytes"]) <= int(row["bytes"])
    )
