"""How smooth a dome's series should be: by the error at lights that are left out one at a time.

The grid is small and each point is one factorisation for all pixels, or one a pixel of a sample
where dark values weigh more. Errors are taken as they are seen, on codes of sRGB.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from maths import hemispherical_harmonics as harmonics
from maths.colour import srgb_encode
from maths.image_error import psnr

Array = NDArray[np.float64]

# Bands cost nothing in the asset; a weighted fit solves 49 unknowns a pixel instead of 36 for .2 dB
BANDS = (4, 5, 6, 7)
WEIGHTED_BANDS = (4, 5, 6)
PENALTIES = (0.01, 0.03, 0.1, 0.3, 1.0)
# A linear fit spends itself on bright values, and eyes see dark ones: weights 1/(value + .01)^p
EXPONENTS = (0.0, 0.5, 1.0, 1.5)
BLACK = 0.01
BEST = 200.0  # dB, of equal pictures


@dataclass(frozen=True)
class Knobs:
    """bands : of the harmonics. penalty : a fraction of the light count. exponent : p of the sample
    weights `1 / (value + .01)^p`. predicted : leave-one-light-out PSNR, dB."""

    bands: int
    penalty: float
    exponent: float
    predicted: float


def choose(
    samples: Array, directions: Array, space: str, bands: int = 0, penalty: float = 0.0
) -> Knobs:
    """Try the grid on some pixels; bands and penalty other than 0 are kept.

    samples : (pixels, N, 3), of a space "linear" or "stored", as they are seen.
    """

    def at(point: tuple[int, float, float]) -> Knobs:
        return Knobs(*point, left_out_psnr(samples, directions, space, *point))

    # The exponent first, at a usual smoothness; stored values are about as dark as they look
    exponents = {0.0}
    if space == "linear":
        middle = [(bands or 5, penalty or 0.1, p) for p in EXPONENTS]
        exponents.add(max(workers.map_tiles(at, middle), key=lambda k: k.predicted).exponent)
    grid = [
        (b, q, p)
        for p in sorted(exponents)
        for b in ((bands,) if bands else WEIGHTED_BANDS if p else BANDS)
        for q in ((penalty,) if penalty else PENALTIES)
    ]
    return max(workers.map_tiles(at, grid), key=lambda k: k.predicted)


def left_out_psnr(
    samples: Array, directions: Array, space: str, bands: int, penalty: float, exponent: float
) -> float:
    """Return the mean over lights of the PSNR at each, from a fit of all the others, in dB."""
    if exponent == 0:
        fit = harmonics.fit_weights(directions, bands, penalty)
        return linear_psnr(samples, harmonics.evaluate(directions, bands) @ fit.matrix, space)
    weights = weights_of(samples, exponent)
    C = harmonics.fit_each(samples, directions, bands, penalty, weights)
    hats = harmonics.hats_each(directions, bands, penalty, weights)
    fitted = np.matmul(harmonics.evaluate(directions, bands), C)
    return _left_out(samples, fitted, hats, space)


def linear_psnr(samples: Array, smoother: Array, space: str) -> float:
    """Return leave-one-light-out PSNR of a fit whose values are `smoother` (N, N) times samples."""
    return _left_out(samples, np.matmul(smoother, samples), np.diag(smoother)[None], space)


def _left_out(samples: Array, fitted: Array, hats: Array, space: str) -> float:
    # 1e-9: a residual has a rounding of 1e-16; what nothing else determines is predicted at random
    free = np.maximum(1.0 - hats, 1e-9)[..., None]
    predicted = samples - (samples - fitted) / free
    pairs = zip(*(np.moveaxis(seen(v, space), 1, 0) for v in (predicted, samples)), strict=True)
    return mean_psnr(list(pairs))


def weights_of(samples: NDArray[np.floating[Any]], exponent: float) -> Array:
    """Return the weights (pixels, N) of samples (pixels, N, 3): dark ones count for more."""
    value = np.mean(np.asarray(samples, np.float64), axis=-1)
    return np.asarray((value + BLACK) ** -exponent)


def seen(values: NDArray[np.floating[Any]], space: str) -> Array:
    """Return values as a screen shows them, in 0..1."""
    shown = np.clip(np.asarray(values, np.float64), 0.0, 1.0)
    return shown if space == "stored" else srgb_encode(shown)


def mean_psnr(pairs: list[tuple[Any, Any]]) -> float:
    """Return the mean of the PSNR of pairs of pictures, each up to 200 dB."""
    return float(np.mean([min(BEST, psnr(a, b)) for a, b in pairs]))
