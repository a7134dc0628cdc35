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

from bake import dome, dome_knobs, photographs
from bake.photographs import Photographs, Space
from maths.colour import srgb_encode
from pipelines.studies import glossy_ball
from pipelines.studies.answer import Answer, Panel, Row
from pipelines.studies.subjects import Setting

SPACES: tuple[Space, ...] = ("stored", "linear")
FOLDS = 9
CHANNELS = (4, 8, 12, 16, 24)
DEFAULT = 16


def measure(setting: Setting) -> Answer:
    """Hold out each fold of a `.lp` set, or of the glossy ball, in both spaces."""
    rows: list[Row] = []
    by_channels: dict[str, list[tuple[float, float]]] = {}
    by_penalty: dict[str, list[tuple[float, float]]] = {}
    figures: dict[str, Any] = {}
    for space in SPACES:
        taken = subject(setting, space)
        folds = [folded(taken, i, DEFAULT) for i in range(setting.pick(1, FOLDS))]
        means = {
            name: float(np.mean([float(row[name]) for row in folds]))
            for name in ("ours_db", "ptm_18_db", "hsh_27_db", "seconds")
        }
        rows += folds
        figures[space] = means
        for channels in CHANNELS:
            row = folds[0] if channels == DEFAULT else folded(taken, 0, channels)
            rows += [row] if channels != DEFAULT else []
            by_channels.setdefault(space, []).append((channels, float(row["ours_db"])))
        for bands, penalty, error in grid(taken):
            by_penalty.setdefault(f"{space}, {bands} bands", []).append((penalty, error))
    ours = ", ".join(
        f"{m['ours_db']:.1f} dB {space} (PTM {m['ptm_18_db']:.1f}, HSH {m['hsh_27_db']:.1f})"
        for space, m in figures.items()
    )
    return Answer(
        question="dome",
        title=f"16 channels of 8 bits meet unseen lights to {ours}",
        truth="photographs that no fit saw",
        rows=rows,
        panels=(
            Panel("channels", "held-out PSNR of one fold, dB", by_channels, marked=DEFAULT),
            Panel("penalty", "leave-one-light-out PSNR, dB", by_penalty),
        ),
        table=[{"space": space, **means} for space, means in figures.items()],
        figures=figures,
    )


def subject(setting: Setting, space: Space) -> Photographs:
    """Return the user's photographs (.lp), or 49 pictures of the glossy ball."""
    if setting.source is not None and setting.source.suffix.lower() == ".lp":
        return photographs.load(setting.source, space=space)
    directions = glossy_ball.lights(49)
    pictures = glossy_ball.ball(directions, setting.pick(16, 128))
    if space == "stored":
        pictures = srgb_encode(pictures).astype(np.float32)
    return Photographs(pictures, directions, space)


def folded(taken: Photographs, fold: int, channels: int) -> Row:
    """Fit without the lights fold, fold + 9, ... and measure at these."""
    held = tuple(range(fold, len(taken.directions), FOLDS))
    began = perf_counter()
    quality = dome.fit(taken, params=dome.Params(held_out=held, channels=channels)).quality
    return {
        "space": taken.space,
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
        "seconds": perf_counter() - began,
    }


def grid(taken: Photographs) -> list[tuple[int, float, float]]:
    """Return (bands, penalty, leave-one-light-out PSNR), all lights and equal weights."""
    samples = dome.sample_of(taken.pictures, np.arange(len(taken.directions)))
    return [
        (b, q, dome_knobs.left_out_psnr(samples, taken.directions, taken.space, b, q, 0.0))
        for b in dome_knobs.BANDS
        for q in dome_knobs.PENALTIES
    ]
