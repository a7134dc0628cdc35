"""How good a ring from photographs is: its error at lights beside that of two other methods."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import dome_knobs, dome_report, workers
from bake.photographs import Photographs
from formats.coefficients import Coefficients
from maths import circular_harmonics, circular_lights
from maths.circular_fit import Fit

Array = NDArray[np.float64]
Float = NDArray[np.float32]

TILE = 3 << 14  # values at once
NEGATIVE = 1e-3  # of a white sheet: lower relit values are counted


def described(photographs: Photographs, train: NDArray[np.int64], made: Fit) -> dict[str, Any]:
    """Return what the fit is and which lights it has."""
    lights = photographs.directions[train]
    off = np.degrees(np.arcsin(np.clip(lights[:, 2], -1, 1)))
    return {
        "source": "photographs",
        "lights": len(train),
        "lights_of_the_set": len(photographs.directions),
        "lowest_light_degrees": float(off.min()),
        "highest_light_degrees": float(off.max()),
        "terms_used": made.terms,
        "condition": min(float(made.condition), 1e300),
        "largest_gap_degrees": float(np.degrees(made.largest_gap)),
        "fit": made.method,
        "notes": [*photographs.notes, *made.warnings],
    }


def errors(
    photographs: Photographs,
    train: NDArray[np.int64],
    held: NDArray[np.int64],
    master: Coefficients,
) -> dict[str, Any]:
    """Return the PSNR at held-out lights, or else at those fitted, as seen; and the minimum."""
    seen = held if len(held) else train
    prefix = "held_out" if len(held) else "fitted"
    directions, ring = photographs.directions, master.ring
    basis = lit(directions[seen], ring.terms, ring.elevation)
    Y = np.moveaxis(master.terms, 1, 0).reshape(ring.terms, -1)
    flat = photographs.pictures.reshape(len(photographs.pictures), -1)
    found: dict[str, list[float]] = {"": []}
    others = dome_report.baselines(directions[train], directions[seen]) if len(held) else {}
    for n, light in enumerate(seen):
        made = {"": (np.pi * basis[n]).astype(np.float32) @ Y}
        for name, rows in others.items():
            weights = np.zeros(len(flat), np.float32)
            weights[train] = rows[n]
            made[f"{name}_"] = weights @ flat
        for name, values in made.items():
            found.setdefault(name, []).append(psnr(values, flat[light]))
    quality: dict[str, Any] = {f"{prefix}_lights": len(seen)}
    quality |= {f"{prefix}_{name}psnr": float(np.mean(values)) for name, values in found.items()}
    return quality | _minimum(Y, ring.terms)


def _minimum(Y: Float, terms: int) -> dict[str, float]:
    """Return the lowest radiance per unit irradiance over 64 azimuths, and the share of texels that
    go below -NEGATIVE of a white sheet's."""
    t = 2 * np.pi * np.arange(64) / 64
    basis = (np.pi * circular_harmonics.evaluate(t, terms)).astype(np.float32)

    def tile(start: int) -> tuple[float, int]:
        low = (basis @ Y[:, start : start + TILE]).min(axis=0).reshape(-1, 3).min(axis=1)
        return float(low.min()), int(np.count_nonzero(low < -NEGATIVE))

    found = workers.map_tiles(tile, range(0, Y.shape[1], TILE))
    lowest = min(0.0, *(low for low, _ in found))
    return {"minimum": lowest / np.pi, "negative_texels": sum(n for _, n in found) * 3 / Y.shape[1]}


def others_left_out(samples: Array, lights: Array) -> dict[str, float]:
    """Return the leave-one-light-out PSNR of two other methods from samples (pixels, n, 3), dB."""
    quality = {}
    for name, smoother in dome_report.baselines(lights, lights).items():
        # Where a light alone determines a number, nothing can be left out
        if np.diag(smoother).max() < 1 - 1e-9:
            error = dome_knobs.linear_psnr(samples, smoother, "linear")
            quality[f"leave_one_out_{name}_psnr"] = error
    return quality


def lit(lights: Array, terms: int, elevation: float) -> Array:
    """Return what a ring sprite makes of lights (n, 3) of irradiance 1: (n, K)."""
    return circular_lights.evaluate_direction(lights, terms, axis="view", elevation=elevation)


def psnr(values: NDArray[np.floating[Any]], truth: NDArray[np.floating[Any]]) -> float:
    """Return the PSNR of linear values as they are seen, dB."""
    error = dome_knobs.seen(values, "linear") - dome_knobs.seen(truth, "linear")
    return dome_knobs.psnr_of(float(np.mean(np.square(error))))
