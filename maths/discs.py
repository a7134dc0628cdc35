"""A glowing disc with a soft edge, out of focus: a closed form instead of a picture and its levels.

A disc is 1 within, 0 without, and falls off by 1 - smoothstep between two radii: `mean` is midway,
`width` half of the way. A lens spreads it over a disc of its own. The result is again such a
profile: as wide as the larger of the two, its edge as soft as the smaller one and the own edge
together, and as much darker as it is larger, so that all its light is kept. In focus it is exact,
and far out of focus it is the even disc that a lens makes of a point.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
SMOOTH_VARIANCE = 1 / 20  # of the density 6 t (1 - t), the slope of smoothstep


def light(mean: ArrayLike, width: ArrayLike) -> Array:
    """Return the integral over the plane of a profile, area: pi (mean^2 + width^2 / 5).

    By parts it is pi times the mean of r^2 over the slope of the fall.
    """
    m, w = np.asarray(mean, np.float64), np.asarray(width, np.float64)
    return np.asarray(np.pi * (m * m + 4 * SMOOTH_VARIANCE * w * w))


def blurred(radius: ArrayLike, edge: float, blur: ArrayLike) -> tuple[Array, Array, Array]:
    """Return (mean, width, gain) of a disc of `radius` spread over one of the radius `blur`.

    edge : share of the radius over which it falls off, 0..1. gain : factor on its brightness.

    >>> [float(each) for each in blurred(2.0, 0.5, 0.0)]
    [1.5, 0.5, 1.0]
    """
    outer, spread = np.asarray(radius, np.float64), np.asarray(blur, np.float64)
    width = 0.5 * edge * outer
    mean = outer - width
    larger, smaller = np.maximum(mean, spread), np.minimum(mean, spread)
    soft = np.minimum(np.hypot(width, smaller), larger)
    return larger, soft, light(mean, width) / np.maximum(light(larger, soft), 1e-300)


def profile(r: ArrayLike, mean: ArrayLike, width: ArrayLike) -> Array:
    """Return 0..1 at a distance from the middle."""
    m, w = np.asarray(mean, np.float64), np.asarray(width, np.float64)
    t = np.clip((np.asarray(r, np.float64) - (m - w)) / np.maximum(2.0 * w, 1e-300), 0.0, 1.0)
    return np.asarray(1.0 - t * t * (3.0 - 2.0 * t))
