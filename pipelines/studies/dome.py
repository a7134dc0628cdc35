"""How well do sixteen channels meet lights that they were not fitted to?

Photographs are held out in folds, each light in one of them, and everything, knobs included, is
made from the others. The error is taken on values as a screen shows them, a mean of the PSNR of
each photograph. Beside it polynomial texture maps (18 numbers a pixel) and hemispherical harmonics
(27), in floats, from the same photographs. Leave-one-out errors say what bands and penalty do.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import dome, dome_knobs, dome_report, photographs
from bake.photographs import Photographs, Space
from formats.dome import Dome
from maths import hemispherical_harmonics
from maths.colour import srgb_encode
from pipelines.studies import glossy_ball
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.interval import Interval, rms
from pipelines.studies.subjects import Setting

Float = NDArray[np.float32]

TAKES = ("photographs",)
SPACES: tuple[Space, ...] = ("stored", "linear")
FOLDS = 9
CHANNELS = (4, 8, 12, 16, 20, 24, 27)
QUICK = (4, 16)
DEFAULT = 16
PIXELS = 1009  # that tell the knobs' errors; a prime, so that no column is favoured


def measure(setting: Setting) -> Answer:
    """Hold out each fold of a `.lp` set, or of the glossy ball, in both spaces."""
    rows: list[Row] = []
    by_channels: dict[str, list[tuple[float, float]]] = {}
    by_penalty: dict[str, list[tuple[float, float]]] = {}
    table: list[Row] = []
    figures: dict[str, Any] = {}
    shots: dict[tuple[str, str], Shot] = {}
    for space in SPACES:
        taken = subject(setting, space)
        folds = [folded(taken, i, DEFAULT, shots) for i in range(setting.pick(1, FOLDS))]
        means = {
            name: float(np.mean([float(row[name]) for row in folds]))
            for name in ("ours_db", "ptm_18_db", "hsh_27_db", "seconds")
        }
        rows += folds + others(taken, shots)
        figures[space] = means
        for channels in QUICK if setting.quick else CHANNELS:
            row = folds[0] if channels == DEFAULT else folded(taken, 0, channels, shots)
            rows += [row] if channels != DEFAULT else []
            by_channels.setdefault(space, []).append((channels, float(row["ours_db"])))
        knobs = grid(taken, setting)
        rows += knobs
        for row in knobs:
            if row["weight_exponent"] == 0:
                points = by_penalty.setdefault(f"{space}, {row['bands']} bands", [])
                points.append((float(row["penalty"]), float(row["expected_db"])))
        table += summary(space, means, by_channels[space], knobs)
    ours = ", ".join(
        f"{m['ours_db']:.1f} dB {space} (PTM {m['ptm_18_db']:.1f}, HSH {m['hsh_27_db']:.1f})"
        for space, m in figures.items()
    )
    return Answer(
        question="dome",
        title=f"16 channels of 8 bits meet unseen lights to {ours}",
        truth="photographs that no fit saw",
        rows=rows,
        unit="RMS error of a held-out photograph, share of white",
        decibels=True,
        shots=shots,
        panels=(
            Panel(
                "channels", "held-out PSNR of one fold, dB", by_channels, marked=DEFAULT,
                title=f"{DEFAULT} channels meet unseen lights to {ours}",
            ),
            Panel(
                "penalty", "leave-one-light-out PSNR, dB", by_penalty,
                title="Best without weights: " + ", ".join(best_knobs(rows)),
            ),
        ),
        table=table,
        figures=figures,
    )  # fmt: skip


def best_knobs(rows: list[Row]) -> list[str]:
    """Say at which bands and penalty an unweighted fit of each space errs least."""
    found = []
    for space in SPACES:
        own = [r for r in rows if r.get("space") == space and r.get("weight_exponent") == 0]
        own = [r for r in own if r.get("measured") != "held-out fold" and "expected_db" in r]
        if own:
            best = max(own, key=lambda r: float(r["expected_db"]))
            found.append(f"{space} {best['bands']} bands, penalty {float(best['penalty']):g}")
    return found


def subject(setting: Setting, space: Space) -> Photographs:
    """Return the user's photographs (.lp), or 49 pictures of the glossy ball."""
    if setting.source is not None:
        return photographs.load(setting.source, space=space)
    directions = glossy_ball.lights(49)
    pictures = glossy_ball.ball(directions, setting.pick(16, 128))
    if space == "stored":
        pictures = srgb_encode(pictures).astype(np.float32)
    return Photographs(pictures, directions, space)


def folded(
    taken: Photographs, fold: int, channels: int, shots: dict[tuple[str, str], Shot] | None = None
) -> Row:
    """Fit without the lights fold, fold + 9, ... and measure at these."""
    held = tuple(range(fold, len(taken.directions), FOLDS))
    began = perf_counter()
    made = dome.fit(taken, params=dome.Params(held_out=held, channels=channels))
    seconds = perf_counter() - began
    quality = made.quality
    relit = shown(made, taken, held)
    row: Row = {}
    # Further folds of the same setting are no points of their own
    if fold == 0:
        what = f"{channels} channels, 8 bits"
        row = point(
            taken.space,
            what,
            error_of(relit, taken, held),
            series="dome",
            bake_seconds=seconds,
            bytes=sum(level.nbytes for level in made.levels),
            default=channels == DEFAULT,
        )
        if shots is not None:
            shots[taken.space, what] = shot(relit[0], taken, held[0])
    return row | {
        "space": taken.space,
        "measured": "held-out fold",
        "fold": fold,
        "channels": channels,
        "lights": quality["lights"],
        "bands": quality["bands"],
        "penalty": quality["penalty"],
        "weight_exponent": quality["weight_exponent"],
        "ours_db": quality["held_out_psnr"],
        "ptm_18_db": quality["held_out_ptm_18_psnr"],
        "hsh_27_db": quality["held_out_hsh_27_psnr"],
        "expected_db": quality["leave_one_out_psnr"],
        "loss_channels_db": quality["loss_channels_db"],
        "loss_bits_db": quality["loss_bits_db"],
        "seconds": seconds,
    }


def shown(made: Dome, taken: Photographs, held: tuple[int, ...]) -> Float:
    """Return what the codes of a dome show under the lights `held`: (n, h, w, 3)."""
    border, (height, width) = int(made.quality["border"]), taken.pictures.shape[1:3]
    channels = made.decoded()[border : border + height, border : border + width]
    bands = round(made.components.shape[1] ** 0.5)
    basis = hemispherical_harmonics.evaluate(taken.directions[list(held)], bands)
    colours = np.einsum("lj,kjc->lkc", basis, made.components)
    return np.asarray(np.einsum("hwk,lkc->lhwc", channels, colours), np.float32)


def others(taken: Photographs, shots: dict[tuple[str, str], Shot]) -> list[Row]:
    """Return points of the two other methods, in floats, at the first fold."""
    held = tuple(range(0, len(taken.directions), FOLDS))
    train = np.setdiff1d(np.arange(len(taken.directions)), held)
    found = dome_report.baselines(taken.directions[train], taken.directions[list(held)])
    rows = []
    for name, (label, numbers) in {"ptm_18": ("PTM", 18), "hsh_27": ("HSH", 27)}.items():
        began = perf_counter()
        relit = np.tensordot(found[name].astype(np.float32), taken.pictures[train], (1, 0))
        what = f"{label}, {numbers} floats"
        rows.append(
            point(
                taken.space,
                what,
                error_of(relit, taken, held),
                series=label,
                bake_seconds=perf_counter() - began,
                bytes=4 * numbers * taken.pictures[0].size // 3,
                space=taken.space,
                measured="first fold",
            )
        )
        shots[taken.space, what] = shot(relit[0], taken, held[0])
    return rows


def error_of(relit: Float, taken: Photographs, held: tuple[int, ...]) -> Interval:
    """Return the error of values as a screen shows them, its spread that between photographs."""
    truth = dome_knobs.seen(taken.pictures[list(held)], taken.space)
    return rms(np.mean(np.square(dome_knobs.seen(relit, taken.space) - truth), axis=(1, 2, 3)))


def shot(relit: Float, taken: Photographs, held: int) -> Shot:
    """Return a photograph as relit, and as taken."""
    codes = [
        np.asarray(np.rint(255 * np.clip(dome_knobs.seen(p, taken.space), 0, 1)), np.uint8)
        for p in (relit, taken.pictures[held])
    ]
    return Shot(codes[0], codes[1])


def grid(taken: Photographs, setting: Setting) -> list[Row]:
    """Return the leave-one-light-out PSNR of some pixels for each point of the knobs' grid: all
    lights, no compression. A quick run keeps one point of the weighted fits."""
    flat = taken.pictures.reshape(len(taken.pictures), -1, 3)
    chosen = np.linspace(0, flat.shape[1] - 1, min(PIXELS, flat.shape[1])).astype(np.int64)
    samples = np.asarray(flat[:, chosen].transpose(1, 0, 2), np.float64)
    points = [(b, q, 0.0) for b in dome_knobs.BANDS for q in dome_knobs.PENALTIES]
    weighted = [
        (b, q, p)
        for p in dome_knobs.EXPONENTS[1:]
        for b in dome_knobs.WEIGHTED_BANDS
        for q in dome_knobs.PENALTIES
    ]
    return [
        {
            "space": taken.space,
            "measured": "leave one out",
            "bands": bands,
            "penalty": penalty,
            "weight_exponent": exponent,
            "expected_db": dome_knobs.left_out_psnr(
                samples, taken.directions, taken.space, bands, penalty, exponent
            ),
        }
        for bands, penalty, exponent in points + weighted[: 1 if setting.quick else None]
    ]


def summary(
    space: str, means: dict[str, float], channels: list[tuple[float, float]], knobs: list[Row]
) -> list[Row]:
    """Return the rows worth printing: the methods, the channels, and of bands and weights the best
    penalty."""
    found = [
        ("mean of folds", "16 channels, 8 bits", means["ours_db"]),
        ("mean of folds", "PTM, 18 floats", means["ptm_18_db"]),
        ("mean of folds", "HSH, 27 floats", means["hsh_27_db"]),
        *(("first fold", f"{count:g} channels", decibels) for count, decibels in channels),
    ]
    best: dict[tuple[float, float], Row] = {}
    for row in knobs:
        key = (float(row["weight_exponent"]), float(row["bands"]))
        if key not in best or float(row["expected_db"]) > float(best[key]["expected_db"]):
            best[key] = row
    for (exponent, bands), row in best.items():
        what = f"weights {exponent:g}, {bands:g} bands, penalty {row['penalty']:g}"
        found.append(("leave one out", what, float(row["expected_db"])))
    return [{"space": space, "measured": m, "of": what, "psnr_db": d} for m, what, d in found]
