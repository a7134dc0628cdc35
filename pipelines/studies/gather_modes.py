"""Which rays, how many texels a face, and how many bounces give the least error for the time?

Errors are RMS over texels, over the RMS of light traced by Embree through the very cubes; times are
those of the processor. `ways`: light of the courtyard by rays of every kind after more and more
passes. `texels`: lightmaps of a nook of it, looked up as the player does between their texels, at
5 x 5 places a face. `bounces`: what light lacks that was handed on only so often. `rays`: how
errors fall with passes, by evenly spread directions and by independent ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import voxel_faces
from formats.lightmap import Faces
from formats.voxels import Voxels
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.cube_gathers import Card, Float, error_of, interval_of
from pipelines.studies.subjects import Setting

TAKES = ("voxels",)
STEPS = (5, 10, 20, 40)
WAYS: dict[str, dict[str, Any]] = {
    **{f"march {n}": {"mode": "march", "samples": n} for n in STEPS},
    "exact": {"mode": "exact"},
    "sphere": {"mode": "sphere"},
}
TEXELS, PLACES = (1, 2, 4), 5
BOUNCES = (0, 1, 2, 4, 8, -1)
KINDS = {"evenly spread": True, "independent": False}


def measure(setting: Setting) -> Answer:
    """Measure all knobs, one part after another."""
    courtyard, nook = cube_gathers.worlds(setting.source)
    shots: dict[tuple[str, str], Shot] = {}
    marks = [1 << k for k in range(3, setting.pick(7, 10))]
    with cube_gathers.card() as card:
        rows = ways(card, courtyard, marks, setting.pick(128, 2048), shots)
        rows += texels(card, nook, marks, setting.pick(64, 1024), shots)
        counts = (0, 1, 4, -1) if setting.quick else BOUNCES
        rows += bounces(card, nook, setting.pick(256, 2048), setting.pick(512, 8192), shots, counts)
        most = setting.pick(10, 12)
        rows += rays(card, nook, most, setting.pick(1024, 16384), setting.pick(1, 2))
    last = {
        str(row["way"]): float(row["error"])
        for row in rows
        if row["part"] == "ways" and row["passes"] == marks[-1]
    }
    slopes = {
        f"{row['way']}, bounces {row['bounces']}": row["slope"] for row in rows if "slope" in row
    }
    even, independent = (float(slopes[f"{kind}, bounces 0"]) for kind in KINDS)
    return Answer(
        question="gather_modes",
        title=f"After {marks[-1]} passes exact rays err by {last['exact']:.1%}, 20 steps by "
        f"{last['march 20']:.1%}; errors fall as passes^{even:.2f}, by independent directions as "
        f"passes^{independent:.2f}",
        truth="Embree on the very cubes; its own relative error stands in each row",
        rows=rows,
        unit="RMS error of light, share of its RMS",
        axes={"bake_seconds": "processor seconds of gathering"},
        shots=shots,
        panels=panels(rows),
        table=[row for row in rows if row["part"] != "rays" or "slope" in row],
        figures={"errors": last, "slopes": slopes},
    )


def ways(
    card: Card,
    world: Voxels,
    marks: list[int],
    truth_rays: int,
    shots: dict[tuple[str, str], Shot],
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
            told: Row = {"part": "ways", "way": way, **row, "truth_error": stated}
            row = pointed(told, "courtyard", light, truth.irradiance, faces.cell() >= 0)
            row["default"] = int(way == "exact" and row["passes"] == marks[-1])
            shots["courtyard", str(row["setting"])] = look.shot(light, truth.irradiance)
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


def texels(
    card: Card,
    world: Voxels,
    marks: list[int],
    truth_rays: int,
    shots: dict[tuple[str, str], Shot],
) -> list[Row]:
    """Gather on fewer and more texels; compare between them."""
    fine = laid_out(world, PLACES)
    truth = cube_gathers.traced(world, fine, truth_rays)
    x, y = fine.interior[3:]
    view = cube_views.chosen(world, fine, cube_views.of_light(truth.irradiance))
    look = cube_views.shown(view, world, fine)
    used = fine.cell() >= 0
    rows: list[Row] = []
    for n in TEXELS:
        faces = laid_out(world, n)
        gather = card.gather(world, faces)
        gather.step(2)
        spent = 0.0
        for mark in marks:
            spent += 1e3 * card.seconds(gather, mark - gather.since)
            found = np.zeros_like(truth.irradiance)
            found[y, x] = looked_up(faces, gather.read(), fine)
            row: Row = {"part": "texels", "way": f"{n} x {n} a face", "passes": mark, "ms": spent}
            row |= {"truth_error": float(truth.quality["relative_error"])}
            row = pointed(row, "nook", found, truth.irradiance, used)
            row["default"] = int(n == 2 and mark == marks[-1])
            shots["nook", str(row["setting"])] = look.shot(found, truth.irradiance)
            rows.append(row)
    return rows


def looked_up(faces: Faces, image: Float, places: Faces) -> Float:
    """Return an image (h, w, 3) of one layout, bilinear, at the texels (T, 3) of another layout of
    the same cells, in the order of its `interior`."""
    keys = ["axis", "sign", "plane", "u", "v", "width", "height"]
    both = [each.rectangles[keys] for each in (faces, places)]
    orders = [np.argsort(each, order=keys) for each in both]
    if not np.array_equal(both[0][orders[0]], both[1][orders[1]]):
        raise ValueError("the layouts are of other cells: their rectangles differ.")
    same = np.empty(len(orders[0]), np.int64)
    same[orders[1]] = orders[0]
    rows, tu, tv, _, _ = places.interior
    r = faces.rectangles[same[rows]]
    ratio = faces.texels / places.texels
    at = [r["x"] + (tu + 0.5) * ratio - 0.5, r["y"] + (tv + 0.5) * ratio - 0.5]
    low = [np.floor(value).astype(np.int64) for value in at]
    part = [value - first for value, first in zip(at, low, strict=True)]
    total = np.zeros((len(tu), 3))
    for dx in (0, 1):
        for dy in (0, 1):
            share = (part[0] if dx else 1 - part[0]) * (part[1] if dy else 1 - part[1])
            total += share[:, None] * image[low[1] + dy, low[0] + dx]
    return total.astype(np.float32)


def bounces(
    card: Card,
    world: Voxels,
    passes: int,
    truth_rays: int,
    shots: dict[tuple[str, str], Shot],
    counts: tuple[int, ...] = BOUNCES,
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
        row: Row = {"part": "bounces", "way": named(count), "passes": passes, "ms": spent}
        row |= {"truth_error": float(truth.quality["relative_error"])}
        row |= {"light": float(light[used].mean() / truth.irradiance[used].mean())}
        found = pointed(row | {"way": told(count)}, "nook", light, truth.irradiance, used)
        found |= {"bounces": named(count), "default": int(count == 4)}
        shots["nook", str(found["setting"])] = look.shot(light, truth.irradiance)
        rows.append(found)
    return rows


def rays(card: Card, world: Voxels, most: int, truth_rays: int, kinds: int = 2) -> list[Row]:
    """Double passes; fit the exponent of the error once bounces have settled."""
    faces = laid_out(world, 1)
    rows: list[Row] = []
    # Without bounces; and with all, which settle first
    for count, first in ((0, 4), (-1, 8))[:kinds]:
        marks = [1 << k for k in range(first, most + 1)]
        truth = cube_gathers.traced(world, faces, truth_rays, bounces=count)
        stated = float(truth.quality["relative_error"])
        for kind, spread in KINDS.items():
            gather = card.gather(world, faces, bounces=count, spread=spread)
            found = followed(card, gather, marks, faces, truth.irradiance)
            # The truth errs too, by as much as it says
            own = [net(float(row["error"]), stated) for row in found]
            told: Row = {"part": "rays", "way": kind, "bounces": count}
            rows += [
                {**told, **row, "truth_error": stated, "net_error": e}
                for row, e in zip(found, own, strict=True)
            ]
            rows[-1]["slope"] = cube_gathers.slope(marks, own)
    return rows


def net(error: float, of_truth: float) -> float:
    """Return an error without that of the truth, which is independent of it; at least a quarter."""
    return float(np.sqrt(max(error**2 - of_truth**2, (error / 4) ** 2)))


def laid_out(world: Voxels, texels: int) -> Faces:
    """Return the layout of a world."""
    return voxel_faces.layout(
        world.cells, texels=texels, cell_size=world.cell_size, origin=world.origin
    )


def told(count: int) -> str:
    """Return how a number of bounces is told among other settings."""
    return "no bounces" if count == 0 else f"{named(count)} bounce{'s' if count != 1 else ''}"


def named(count: int) -> str:
    """Return how a number of bounces is told."""
    return "all" if count < 0 else str(count)


def panels(rows: list[Row]) -> tuple[Panel, ...]:
    """Plot errors against time and against passes."""

    def lines(part: str, x: str, y: str) -> dict[str, list[tuple[float, float]]]:
        found: dict[str, list[tuple[float, float]]] = {}
        for row in rows:
            if row["part"] == part:
                more = f", bounces {named(int(row['bounces']))}" if part == "rays" else ""
                points = found.setdefault(f"{row['way']}{more}", [])
                points.append((float(row[x]), float(row[y])))
        return found

    log: tuple[str, str] = ("log", "log")
    time = "processor milliseconds"
    some = [row for row in rows if row["part"] == "bounces"]
    points = {"error": [(float(k), float(row["error"])) for k, row in enumerate(some)]}
    ticks = [str(row["bounces"]) for row in some]
    return (
        Panel(time, "error, kinds of rays", lines("ways", "ms", "error"), None, log),
        Panel(time, "error, texels a face", lines("texels", "ms", "error"), None, log),
        Panel("bounces", "error", points, None, ("linear", "log"), ticks),
        Panel("passes", "error", lines("rays", "passes", "net_error"), None, log, slopes=True),
    )
