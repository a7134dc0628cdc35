"""How many texels of a lightmap does a face of a cube need?

A nook of the courtyard, lit by gathering on the card and by a baked lightmap, on 1 to 8 texels a
side, looked up between texels as the player does at 5 x 5 places a face. The truth is traced by
Embree at those very places, many rays each: nothing is looked up between them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import lightmap
from formats.lightmap import Faces
from formats.voxels import Voxels
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import PRICES, Answer, Panel, Row, Shot, lines_of, point
from pipelines.studies.cube_gathers import Card, Float, interval_of
from pipelines.studies.gather_modes import laid_out
from pipelines.studies.stages import processor_seconds
from pipelines.studies.subjects import Setting

Indices = NDArray[np.int64]
TAKES = ("voxels",)
TEXELS, PLACES = (1, 2, 4, 8), 5
DEFAULT = 2
BAKED, GATHERED = "baked lightmap", "gathered"
BYTES = 8  # a texel: RGBA16F


def measure(setting: Setting) -> Answer:
    """Light one world on fewer and more texels."""
    _, nook = cube_gathers.worlds(setting.source)
    shots: dict[tuple[str, str], Shot] = {}
    counts = TEXELS[: setting.pick(3, 4)]
    fine = laid_out(nook, PLACES)
    truth = cube_gathers.traced(nook, fine, setting.pick(48, 2048))
    view = cube_views.chosen(nook, fine, cube_views.of_light(truth.irradiance))
    look = cube_views.shown(view, nook, fine)
    stated = float(truth.quality["relative_error"])
    rows: list[Row] = []
    with cube_gathers.card() as card:
        for n in counts:
            faces = laid_out(nook, n)
            made = {
                BAKED: baked(nook, faces, setting.pick(192, 2048)),
                GATHERED: gathered(card, nook, faces, setting.pick(96, 1024)),
            }
            for kind, (light, seconds) in made.items():
                found = shown_at(faces, light, fine)
                what = f"{kind}, {n} x {n} a face"
                shots["nook", what] = look.shot(found, truth.irradiance)
                used = fine.cell() >= 0
                rows.append(
                    point(
                        "nook",
                        what,
                        interval_of(found, truth.irradiance, used),
                        series=kind,
                        bake_seconds=seconds,
                        bytes=BYTES * faces.size[0] * faces.size[1],
                        default=n == DEFAULT and kind == BAKED,
                        texels=n,
                        truth_error=stated,
                    )
                )
    errors = {(str(r["series"]), int(r["texels"])): float(r["error"]) for r in rows}
    times = {(str(r["series"]), int(r["texels"])): float(r["bake_seconds"]) for r in rows}
    twice = errors[BAKED, 1] / errors[BAKED, 2]
    again = errors[BAKED, 2] / errors[BAKED, 4]
    slower = [times[BAKED, b] / times[BAKED, a] for a, b in ((1, 2), (2, 4))]
    return Answer(
        question="lightmap_texels",
        title=f"2 x 2 divide the error of one by {twice:.1f} for {slower[0]:.1f} times the bake, "
        f"4 x 4 divide it by {again:.1f} again for {slower[1]:.1f} times that; then they err by "
        f"{errors[BAKED, 4]:.1%}",
        truth=f"Embree at {PLACES} x {PLACES} places a face, itself within {stated:.1%}",
        rows=rows,
        unit="RMS error of light between texels, share of its RMS",
        axes={"texels": "texels along a side", **PRICES},
        titles={
            "texels": f"1, 2 and 4 texels a side: {errors[BAKED, 1]:.1%}, {errors[BAKED, 2]:.1%} "
            f"and {errors[BAKED, 4]:.1%} of the light"
        },
        shots=shots,
        panels=(
            Panel(
                "texels along a side",
                "processor seconds",
                lines_of(rows, "texels", "bake_seconds", "series"),
                float(DEFAULT),
                ("log", "log"),
                slopes=True,
                title=f"Twice the texels a side take {slower[0]:.1f}, then {slower[1]:.1f} times "
                "as long",
            ),
        ),
        figures={"error": {f"{k}, {n}": e for (k, n), e in errors.items()}},
    )


def baked(world: Voxels, faces: Faces, rays: int) -> tuple[Float, float]:
    """Return light by Embree, and the processor's seconds."""
    params = lightmap.Params(texels=faces.texels, rays=rays, target=0.0)
    found, seconds = processor_seconds(lightmap.gather, world, faces, params=params)
    return found.irradiance, seconds


def gathered(card: Card, world: Voxels, faces: Faces, passes: int) -> tuple[Float, float]:
    """Return light by so many passes on the card, and the processor's seconds."""
    gather = card.gather(world, faces)
    gather.step(2)
    seconds = card.seconds(gather, passes - gather.since)
    return gather.read(), seconds


def shown_at(faces: Faces, image: Float, places: Faces) -> Float:
    """Return an image of one layout looked up on the atlas of another."""
    x, y = places.interior[3:]
    found = np.zeros((places.size[1], places.size[0], 3), np.float32)
    found[y, x] = looked_up(faces, image, places)
    return found


def looked_up(faces: Faces, image: Float, places: Faces) -> Float:
    """Return an image (h, w, 3) of one layout, bilinear, at the texels (T, 3) of another layout of
    the same cells, in the order of its `interior`. Long rectangles of the two may be cut in other
    places. ValueError where cells differ."""
    rows, tu, tv, _, _ = places.interior
    own = places.rectangles[rows]
    # Where texels lie along the sides of their cells
    u, v = (own[k] + (t + 0.5) / places.texels for k, t in (("u", tu), ("v", tv)))
    r = faces.rectangles[_holders(faces, own, u.astype(np.int64), v.astype(np.int64))]
    at = [r[k] + (w - r[o]) * faces.texels - 0.5 for k, o, w in (("x", "u", u), ("y", "v", v))]
    low = [np.floor(value).astype(np.int64) for value in at]
    part = [value - first for value, first in zip(at, low, strict=True)]
    total = np.zeros((len(tu), 3))
    for dx in (0, 1):
        for dy in (0, 1):
            share = (part[0] if dx else 1 - part[0]) * (part[1] if dy else 1 - part[1])
            total += share[:, None] * image[low[1] + dy, low[0] + dx]
    return total.astype(np.float32)


def _holders(faces: Faces, planes: NDArray[Any], u: Indices, v: Indices) -> Indices:
    """Return the rectangles (T,) of a layout that hold the faces (u, v) of cells, in the planes of
    other rectangles (T,)."""
    r = faces.rectangles
    count = r["width"].astype(np.int64) * r["height"]
    row = np.repeat(np.arange(len(r)), count)
    k = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    wide = r["width"][row]
    known = _numbers(r[row], r["u"][row] + k % wide, r["v"][row] + k // wide)
    order, wanted = np.argsort(known), _numbers(planes, u, v)
    place = np.minimum(np.searchsorted(known[order], wanted), len(order) - 1)
    found: Indices = row[order[place]]
    if not np.array_equal(known[order[place]], wanted):
        raise ValueError("the layouts are of other cells: their faces differ.")
    return found


def _numbers(planes: NDArray[Any], u: Indices, v: Indices) -> Indices:
    """Return a number of its own for each face of a cell."""
    side = 2 * planes["axis"].astype(np.int64) + (planes["sign"] > 0)
    return np.asarray(((side << 16 | planes["plane"]) << 20 | u) << 20 | v)
