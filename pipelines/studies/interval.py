"""A measured number and the 95 % interval that its own spread gives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maths import intervals

LEVEL = 0.975  # quantile: 2.5 % lie on each side


@dataclass(frozen=True)
class Interval:
    """value, and the ends of its 95 % interval: low <= value <= high."""

    value: float
    low: float
    high: float


def rms(squares: ArrayLike) -> Interval:
    """Return the root of the mean of independent mean squares (n,): one a light, point or block.

    The mean's own error follows Student's t; it is taken on the logarithm, so that the interval
    stays above 0. A single square has no spread: its interval is a point.
    """
    squares = np.asarray(squares, np.float64).ravel()
    mean = float(np.mean(squares))
    relative = _relative_error(squares, mean)
    root = float(np.sqrt(mean))
    return Interval(root, root * float(np.exp(-relative / 2)), root * float(np.exp(relative / 2)))


def mean(values: ArrayLike) -> Interval:
    """Return the mean of independent values (n,) above 0, its interval taken on the logarithm."""
    values = np.asarray(values, np.float64).ravel()
    centre = float(np.mean(values))
    factor = float(np.exp(_relative_error(values, centre)))
    return Interval(centre, centre / factor, centre * factor)


def ratio(parts: ArrayLike, wholes: ArrayLike) -> Interval:
    """Return sum(parts) / sum(wholes) of independent pairs (n,), both above 0; Cochran 1977, 6.4:
    the residuals parts - ratio * wholes carry the spread."""
    parts, wholes = (np.asarray(v, np.float64).ravel() for v in (parts, wholes))
    found = float(parts.sum() / wholes.sum())
    residual = (parts - found * wholes) / max(float(parts.mean()), 1e-300)
    factor = float(np.exp(_relative_error(1 + residual, 1.0)))
    return Interval(found, found / factor, found * factor)


def share(hits: int, count: int) -> Interval:
    """Return hits / count and its interval by Clopper and Pearson 1934, exact for counts."""
    from scipy.special import betaincinv

    low = float(betaincinv(hits, count - hits + 1, 1 - LEVEL)) if hits else 0.0
    high = float(betaincinv(hits + 1, count - hits, LEVEL)) if hits < count else 1.0
    return Interval(hits / count, low, high)


def fastest(times: Sequence[float]) -> Interval:
    """Return the least of some times; up to their median, as other work only slows one down."""
    least = float(min(times))
    return Interval(least, least, float(np.median(times)))


def blocks(squares: ArrayLike, side: int = 16) -> np.ndarray:
    """Return the mean of squares (h, w) over blocks of a side: neighbours are alike, so that pixels
    are not independent."""
    squares = np.asarray(squares, np.float64)
    height, width = squares.shape
    return np.array([
        squares[y : y + side, x : x + side].mean()
        for y in range(0, height, side)
        for x in range(0, width, side)
    ])  # fmt: skip


def _relative_error(values: np.ndarray, mean: float) -> float:
    """Return the half-width of the mean's interval over the mean, at most 3."""
    if len(values) < 2 or mean <= 0:
        return 0.0
    error = float(np.std(values, ddof=1)) / np.sqrt(len(values)) / mean
    return float(min(3.0, intervals.coverage_factor(len(values) - 1) * error))
