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
from pipelines.studies import cube_gathers
from pipelines.studies.answer import Answer, Panel, Row
from pipelines.studies.cube_gathers import Card, Float, error_of
from pipelines.studies.subjects import Setting

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
    courtyard, nook = cube_gathers.courtyard(), cube_gathers.nook()
    marks = [1 << k for k in range(3, setting.pick(8, 10))]
    with cube_gathers.card() as card:
        rows = ways(card, courtyard, marks, setting.pick(256, 2048))
        rows += texels(card, nook, marks, setting.pick(128, 1024))
        rows += bounces(card, nook, setting.pick(512, 2048), setting.pick(1024, 8192))
        most = setting.pick(10, 12)
        rows += rays(card, nook, most, setting.pick(1024, 16384))
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
        title=f"after {marks[-1]} passes exact rays err by {last['exact']:.1%}, 20 steps by "
        f"{last['march 20']:.1%}; errors fall as passes^{even:.2f}, by independent directions as "
        f"passes^{independent:.2f}",
        truth="Embree on the very cubes; its own relative error stands in each row",
        rows=rows,
        panels=panels(rows),
        table=[row for row in rows if row["part"] != "rays" or "slope" in row],
        figures={"errors": last, "slopes": slopes},
    )


def ways(card: Card, world: Voxels, marks: list[int], truth_rays: int) -> list[Row]:
    """Follow rays in every way, one texel a face."""
    faces = laid_out(world, 1)
    truth = cube_gathers.traced(world, faces, truth_rays)
    stated = float(truth.quality["relative_error"])
    rows: list[Row] = []
    for way, knobs in WAYS.items():
        gather = card.gather(world, faces, **knobs)
        found = followed(card, gather, marks, faces, truth.irradiance)
        rows += [{"part": "ways", "way": way, **row, "truth_error": stated} for row in found]
    return rows


def followed(card: Card, gather: Any, marks: list[int], faces: Faces, truth: Float) -> list[Row]:
    """Return passes, processor milliseconds and error at each mark."""
    used = faces.cell() >= 0
    # What compiles is not counted, nor are its two passes
    gather.step(2)
    rows: list[Row] = []
    spent = 0.0
    for mark in marks:
        spent += 1e3 * card.seconds(gather, mark - gather.since)
        rows.append({"passes": mark, "ms": spent, "error": error_of(gather.read(), truth, used)})
    return rows


def texels(card: Card, world: Voxels, marks: list[int], truth_rays: int) -> list[Row]:
    """Gather on fewer and more texels; compare between them."""
    fine = laid_out(world, PLACES)
    truth = cube_gathers.traced(world, fine, truth_rays)
    x, y = fine.interior[3:]
    there = truth.irradiance[y, x][None]
    every = np.ones(there.shape[:2], np.bool_)
    rows: list[Row] = []
    for n in TEXELS:
        faces = laid_out(world, n)
        gather = card.gather(world, faces)
        gather.step(2)
        spent = 0.0
        for mark in marks:
            spent += 1e3 * card.seconds(gather, mark - gather.since)
            found = looked_up(faces, gather.read(), fine)[None]
            row: Row = {"part": "texels", "way": f"{n} x {n} a face", "passes": mark, "ms": spent}
            row |= {"error": error_of(found, there, every)}
            rows.append(row | {"truth_error": float(truth.quality["relative_error"])})
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


def bounces(card: Card, world: Voxels, passes: int, truth_rays: int) -> list[Row]:
    """Hand light on a few times only; the truth does so as often as it counts."""
    faces = laid_out(world, 1)
    used = faces.cell() >= 0
    truth = cube_gathers.traced(world, faces, truth_rays)
    rows: list[Row] = []
    for count in BOUNCES:
        gather = card.gather(world, faces, bounces=count)
        gather.step(2)
        spent = 1e3 * card.seconds(gather, passes - 2)
        light = gather.read()
        row: Row = {"part": "bounces", "way": named(count), "passes": passes, "ms": spent}
        row |= {"error": error_of(light, truth.irradiance, used)}
        row |= {"truth_error": float(truth.quality["relative_error"])}
        rows.append(row | {"light": float(light[used].mean() / truth.irradiance[used].mean())})
    return rows


def rays(card: Card, world: Voxels, most: int, truth_rays: int) -> list[Row]:
    """Double passes; fit the exponent of the error once bounces have settled."""
    faces = laid_out(world, 1)
    rows: list[Row] = []
    for count, first in ((0, 4), (-1, 8)):
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


def named(count: int) -> str:
    """Return how a number of bounces is told."""
    return "all" if count < 0 else str(count)


def panels(rows: list[Row]) -> tuple[Panel, ...]:
    """Plot errors against time and against passes."""

    def lines(part: str, x: str, y: str) -> dict[str, list[tuple[float, float]]]:
        found: dict[str, list[tuple[float, float]]] = {}
        for row in rows:
            if row["part"] == part:
                more = f", bounces {named(int(row['bounces']))}" if "bounces" in row else ""
                points = found.setdefault(f"{row['way']}{more}", [])
                points.append((float(row[x]), float(row[y])))
        return found

    log: tuple[str, str] = ("log", "log")
    time = "processor milliseconds"
    some: NDArray[Any] = np.array([row["error"] for row in rows if row["part"] == "bounces"])
    points = {"error": [(float(k), float(e)) for k, e in enumerate(some)]}
    ticks = [named(count) for count in BOUNCES]
    return (
        Panel(time, "error, kinds of rays", lines("ways", "ms", "error"), None, log),
        Panel(time, "error, texels a face", lines("texels", "ms", "error"), None, log),
        Panel("bounces", "error", points, None, ("linear", "log"), ticks),
        Panel("passes", "error", lines("rays", "passes", "net_error"), None, log),
    )
