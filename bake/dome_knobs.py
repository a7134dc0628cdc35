"""How smooth a dome's series should be: by the error at lights that are left out one at a time.

The grid is small and each point is one factorisation for all pixels, or one a pixel of a sample
where dark values weigh more. Errors are taken as they are seen, on codes of sRGB.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log10
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from maths import hemispherical_harmonics as harmonics
from maths.colour import srgb_encode

Array = NDArray[np.float64]

# Bands cost nothing in the asset; a weighted fit solves 49 unknowns a pixel instead of 36 for .2 dB
BANDS = (4, 5, 6, 7)
WEIGHTED_BANDS = (4, 5, 6)
PENALTIES = (0.01, 0.03, 0.1, 0.3, 1.0)
# A linear fit spends itself on bright values, and eyes see dark ones: weights 1/(value + .01)^p
EXPONENTS = (0.0, 0.5, 1.0, 1.5)
ROUGH = 256  # samples that tell weighted fits apart; all of them tell the best from plain ones
BLACK = 0.01
AMPLIFICATION = 6.0
"""How far answers to lights that nobody took may exceed the photographs; even domes give 2 to 4."""
BEST = 200.0  # dB, of equal pictures


@dataclass(frozen=True)
class Knobs:
    """bands : of the harmonics. penalty : a fraction of the light count. exponent : p of the sample
    weights `1 / (value + .01)^p`. predicted : leave-one-light-out PSNR, dB. amplification : of
    `amplification_of`. notes : what a reader of the result should know."""

    bands: int
    penalty: float
    exponent: float
    predicted: float
    amplification: float
    notes: tuple[str, ...] = ()


def choose(
    samples: Array, directions: Array, space: str, bands: int = 0, penalty: float = 0.0
) -> Knobs:
    """Try the grid on some pixels; bands and penalty other than 0 are kept.

    samples : (pixels, N, 3), of a space "linear" or "stored", as they are seen.
    """
    some = samples[:: max(1, len(samples) // ROUGH)]

    def at(point: tuple[int, float, float]) -> Knobs:
        predicted = left_out_psnr(samples, directions, space, *point)
        return Knobs(*point, predicted, amplification_of(directions, *point[:2]))

    def coarse(point: tuple[int, float, float]) -> tuple[float, tuple[int, float, float]]:
        return left_out_psnr(some, directions, space, *point), point

    def best(points: list[tuple[int, float, float]]) -> tuple[int, float, float]:
        return max(workers.map_tiles(coarse, points), key=lambda found: found[0])[1]

    # What lights leave open is not for errors at lights to decide: bound it
    pairs = [
        (b, q)
        for b in ((bands,) if bands else BANDS)
        for q in ((penalty,) if penalty else PENALTIES)
    ]
    bounded = [p for p in pairs if amplification_of(directions, *p) <= AMPLIFICATION]
    if not bounded:
        return _smooth(at, directions, bands, penalty)
    # The exponent first, at a usual smoothness; stored values are about as dark as they look
    weighted = [(b, q) for b, q in bounded if bands or b in WEIGHTED_BANDS]
    grid = [(*pair, 0.0) for pair in bounded]
    if space == "linear" and weighted:
        usual = min(weighted, key=lambda p: (abs(p[0] - 5), abs(np.log(p[1] / 0.1))))
        if exponent := best([(*usual, p) for p in EXPONENTS])[2]:
            grid.append(best([(*pair, exponent) for pair in weighted]))
    return max(workers.map_tiles(at, grid), key=lambda k: k.predicted)


def _smooth(
    at: Callable[[tuple[int, float, float]], Knobs], directions: Array, bands: int, penalty: float
) -> Knobs:
    """Take the most bands that stay bounded under a high penalty; what is given is kept."""
    high = max(PENALTIES)
    ladder = [(b, penalty or high) for b in ((bands,) if bands else range(min(BANDS), 0, -1))]
    found = (p for p in ladder if amplification_of(directions, *p) <= AMPLIFICATION)
    knobs = at((*next(found, ladder[-1]), 0.0))
    note = f"the lights leave much open: {knobs.bands} bands, penalty {knobs.penalty:g}, answers "
    return replace(knobs, notes=(note + f"up to {knobs.amplification:.3g} times the photographs",))


def spiral(count: int, lowest: float) -> Array:
    """Return unit directions (count, 3), evenly spread over the dome from z = `lowest` up."""
    z = lowest + (1 - lowest) * (1 - (np.arange(count) + 0.5) / count)
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)


def amplification_of(directions: Array, bands: int, penalty: float) -> float:
    """Return how far answers can exceed the samples: over the hemisphere, the largest sum of the
    magnitudes of the weights by which samples of N lights count (Lebesgue constant)."""
    matrix = harmonics.fit_weights(directions, bands, penalty).matrix
    return float(np.abs(harmonics.evaluate(spiral(256, 0.0), bands) @ matrix).sum(axis=1).max())


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
    return _left_out(np.moveaxis(samples, 1, 0), np.moveaxis(fitted, 1, 0), hats.T, space)


def linear_psnr(samples: Array, smoother: Array, space: str) -> float:
    """Return leave-one-light-out PSNR of a fit whose values are `smoother` (N, N) times samples."""
    by_light = np.moveaxis(samples, 1, 0)
    fitted = (smoother @ by_light.reshape(len(by_light), -1)).reshape(by_light.shape)
    return _left_out(by_light, fitted, np.diag(smoother)[:, None], space)


def _left_out(samples: Array, fitted: Array, hats: Array, space: str) -> float:
    """Return the PSNR of (N, pixels, 3); hats : (N, pixels or 1)."""
    # 1e-9: a residual has a rounding of 1e-16; what nothing else determines is predicted at random
    free = np.maximum(1.0 - hats, 1e-9)[..., None]
    predicted = samples - (samples - fitted) / free
    error = seen(predicted, space) - seen(samples, space)
    return float(np.mean([psnr_of(e) for e in np.mean(np.square(error), axis=(1, 2))]))


def weights_of(samples: NDArray[np.floating[Any]], exponent: float) -> NDArray[np.floating[Any]]:
    """Return the weights (pixels, N) of samples (pixels, N, 3), of their precision: dark ones count
    for more."""
    third = samples.dtype.type(1 / 3)
    value = (samples[..., 0] + samples[..., 1] + samples[..., 2]) * third
    dark = np.maximum(value, 0) + samples.dtype.type(BLACK)
    # A sample 1e12 times the others still counts for something
    weights = dark ** samples.dtype.type(-exponent) + samples.dtype.type(1e-12)
    return np.asarray(weights, samples.dtype)


def seen(values: NDArray[np.floating[Any]], space: str) -> Array:
    """Return values as a screen shows them, in 0..1."""
    shown = np.clip(np.asarray(values, np.float64), 0.0, 1.0)
    return shown if space == "stored" else srgb_encode(shown)


def psnr_of(square: float) -> float:
    """Return the PSNR of a mean square error of values in 0..1: dB, up to 200."""
    return min(BEST, -10.0 * log10(square)) if square > 0 else BEST
