"""What a told error means, and the interval that it gives.

An `error` of a report or an array is always one standard error: the standard deviation that the
estimate would show if it were made again with other random numbers. From the estimate to either end
of its 95 % interval are `coverage_factor` of them: Student's t for as many degrees of freedom as
the error was estimated with, 1.96 where those are many. Reports tell the factor beside the error.

References
----------
JCGM 100:2008, Guide to the Expression of Uncertainty in Measurement, 6.2 (coverage factor) and
equation G.2b (effective degrees of freedom; Welch 1947, Satterthwaite 1946).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri, stdtrit

LEVEL = 0.95
"""Share of intervals that hold the truth."""


def coverage_factor(degrees: float = np.inf) -> float:
    """Return how many standard errors the 95 % interval reaches to each side.

    degrees : of freedom of the standard error, above 0; ValueError else.

    >>> round(coverage_factor(), 3), round(coverage_factor(7), 3), round(coverage_factor(1), 3)
    (1.96, 2.365, 12.706)
    """
    if not degrees > 0:
        raise ValueError(f"An error of {degrees} degrees of freedom has no interval.")
    quantile = (1 + LEVEL) / 2
    return float(ndtri(quantile) if np.isinf(degrees) else stdtrit(degrees, quantile))


def effective_degrees(variances: ArrayLike, degrees: ArrayLike) -> float:
    """Return the degrees of freedom of a sum of independent estimates (Welch, Satterthwaite).

    variances : (n,) estimated variances of the parts, not all 0.  degrees : those of each, (n,) or
    one for all.

    >>> effective_degrees([1.0, 1.0], 7), effective_degrees([1.0, 0.0], 7)
    (14.0, 7.0)
    """
    v = np.asarray(variances, np.float64)
    return float(v.sum() ** 2 / np.sum(v**2 / np.asarray(degrees, np.float64)))
