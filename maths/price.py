"""What accuracy costs: error^2 = floor^2 + (scale / n^power)^2, and seconds linear in the work.

The floor is what no number of samples mends: a band limit, a number of terms, codes. Squares add
up, as errors of samples and errors of a model have nothing to do with each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from maths.intervals import coverage_factor

Array = NDArray[np.float64]

WIDEST = 3.0  # of the logarithm of a mean square: what few samples can say is no more


@dataclass(frozen=True)
class Law:
    """Relative error after n samples.

    >>> Law(0.03, 0.4, 0.5).error(100)
    0.05
    """

    floor: float
    scale: float
    power: float

    def error(self, count: float) -> float:
        """Return the error at a count > 0."""
        return float(np.hypot(self.floor, self.scale * count**-self.power))


@dataclass(frozen=True)
class Estimate:
    """A relative RMS error and its 95 % interval: low <= value <= high."""

    value: float
    low: float
    high: float


def fitted(counts: ArrayLike, errors: ArrayLike, power: float) -> Law:
    """Return the law through errors (n,) measured at counts (n,), each trusted to a same share.

    Least squares on squares, neither part below 0. ValueError for no or non-positive counts.
    """
    counts, errors = np.asarray(counts, np.float64), np.asarray(errors, np.float64)
    if not counts.size or counts.min() <= 0:
        raise ValueError("Fit a law to at least one positive count.")
    squares = np.maximum(np.square(errors), 1e-24)
    columns = np.stack([np.ones_like(counts), counts ** (-2 * power)], axis=1)
    floor, scale = nnls(columns / squares[:, None], np.ones_like(squares))[0]
    return Law(float(np.sqrt(floor)), float(np.sqrt(scale)), power)


def seconds_fitted(work: ArrayLike, seconds: ArrayLike) -> Array:
    """Return seconds (k,) >= 0 a unit of each kind of work; work : (n, k), seconds : (n,) > 0.

    Each measurement is trusted to a same share of it.
    """
    work, seconds = np.asarray(work, np.float64), np.asarray(seconds, np.float64)
    # Columns of one size: voxels are thousands where meshes are one
    size = np.maximum(np.abs(work).max(axis=0), 1e-300)
    found = nnls(work / size / seconds[:, None], np.ones_like(seconds))[0]
    return np.asarray(found / size)


def relative_rms(squares: ArrayLike, wholes: ArrayLike) -> Estimate:
    """Return sqrt(sum squares / sum wholes) of independent pairs (n,), with its interval.

    squares : of errors, wholes : of what they are errors of; one pair a voxel, vertex or span. The
    ratio's own error follows Student's t (Cochran 1977, 6.4), taken on its logarithm. Where nothing
    is there to err about, 0.
    """
    squares, wholes = (np.asarray(v, np.float64).ravel() for v in (squares, wholes))
    whole = float(wholes.sum())
    if whole <= 0:
        return Estimate(0.0, 0.0, 0.0)
    ratio, n = float(squares.sum()) / whole, len(squares)
    root = float(np.sqrt(ratio))
    if n < 2 or ratio <= 0:
        return Estimate(root, root, root)
    residual = (squares - ratio * wholes) / (whole / n)
    error = float(np.std(residual, ddof=1)) / n**0.5 / ratio
    half = float(np.exp(min(WIDEST, coverage_factor(n - 1) * error) / 2))
    return Estimate(root, root / half, root * half)
