"""How many light directions does a ring need?

The truth is the same sprite under 512 directions, whose aliases are far beyond what is compared;
and, apart from any fit, renders under lights that no bake saw. The error is that of the relit
picture over all azimuths: by Parseval, its mean square is the sum of the squared differences of
the coefficients over 2 pi.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from formats.coefficients import Coefficients
from pipelines.studies import sprite_errors
from pipelines.studies.answer import PRICES, Answer, Panel, Row, Shot, point
from pipelines.studies.subjects import Setting, traced, traced_in

TAKES = ("mesh",)
TRUTH = 512
COUNTS = (5, 6, 7, 8, 9, 12, 16, 24, 32, 48, 64, 96, 128)
QUICK = (5, 8, 16, 64)
TERMS = 5
DEFAULT = 64


def measure(setting: Setting) -> Answer:
    """Bake under N directions and compare with the truth."""
    knobs = {
        "resolution": setting.pick(48, 128),
        "samples": setting.pick(2, 8),
        "terms": TERMS,
        "held_out": 16,
    }
    rows: list[Row] = []
    lines: dict[str, list[tuple[float, float]]] = {}
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in setting.meshes("knot", "oak").items():
        truth = traced(mesh, **knobs, lights=TRUTH, lights_per_sample=TRUTH)
        floor = truth.quality["held_out_psnr"]
        stage = sprite_errors.stage(mesh, truth)
        for count in QUICK if setting.quick else COUNTS:
            master, seconds = traced_in(mesh, **knobs, lights=count, lights_per_sample=count)
            error = relit_error(master.terms[0], truth.terms[0], truth.alpha[0])
            decibels = float(20 * np.log10(peak_of(truth) / error))
            held_out = master.quality["held_out_psnr"]
            rows.append(
                point(
                    name,
                    f"{count} directions",
                    sprite_errors.held_out(master),
                    bake_seconds=seconds,
                    default=count == DEFAULT,
                    directions=count,
                    psnr_db=decibels,
                    held_out_db=held_out,
                    held_out_of_truth_db=floor,
                )
            )
            shots[name, f"{count} directions"] = stage.shot(master.terms[0])
            lines.setdefault(f"{name}: against {TRUTH} directions", []).append((count, decibels))
            lines.setdefault(f"{name}: against held-out lights", []).append((count, held_out))
    enough = enough_of(rows)
    return Answer(
        question="light_directions",
        title=f"{enough} directions are enough for {TERMS} terms: beyond, truncation dominates",
        truth=f"the same sprite under {TRUTH} directions; and lights that no bake saw",
        rows=rows,
        unit=sprite_errors.UNIT,
        axes={"directions": "light directions", **PRICES},
        decibels=True,
        shots=shots,
        panels=(
            Panel(
                "light directions",
                "PSNR, dB",
                lines,
                marked=DEFAULT,
                title=f"From {enough} directions on lights that no bake saw are met as well as by "
                f"{TRUTH}",
            ),
        ),
        figures={"enough": enough, "truth": TRUTH},
    )


def relit_error(
    terms: NDArray[np.float32], truth: NDArray[np.float32], alpha: NDArray[np.float32]
) -> float:
    """Return the RMS of relit radiance over azimuths and covered texels; terms (K, h, w, 3)."""
    difference = (terms - truth).astype(np.float64)[:, alpha > 0]
    return float(np.sqrt(np.mean(np.sum(np.square(difference), axis=0)) / (2 * np.pi)))


def peak_of(master: Coefficients) -> float:
    """Return the brightest value of the renders under held-out lights."""
    return float(master.quality["held_out_peak"])


def enough_of(rows: list[Row], slack: float = 0.1) -> int:
    """Return from how many directions on every subject stays within `slack` dB of the truth's own
    held-out PSNR."""
    short = [
        int(r["directions"])
        for r in rows
        if float(r["held_out_db"]) < float(r["held_out_of_truth_db"]) - slack
    ]
    beyond = [int(r["directions"]) for r in rows if int(r["directions"]) > max(short, default=0)]
    return min(beyond, default=TRUTH)
