"""Values keyed over time: linear, step, or smooth without overshoot.

References
----------
Fritsch, Butland 1984, A Method for Constructing Local Monotone Piecewise Cubic Interpolants.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

INTERPOLATIONS = ("linear", "step", "smooth")

CLOSEST = 1e-6
"""Seconds between two keys: slopes of nearer ones would leave the range of numbers."""


def sample(
    times: ArrayLike,
    values: ArrayLike,
    t: ArrayLike,
    interpolation: str = "linear",
    loop: bool = False,
) -> NDArray[np.float64]:
    """Evaluate keys at times t; never outside the range of the keyed values.

    times : (n,) seconds, increasing by CLOSEST or more, n >= 1.  values : (n, ...).
    t : (...) seconds.
    interpolation : "linear"; "step" (a key holds until the next); "smooth" (C1 cubic that starts
        and ends at rest, monotone between keys; with two keys it is smoothstep).
    loop : repeat with period times[-1] - times[0]; otherwise the ends hold.
    Returns t.shape + values.shape[1:]. Raises ValueError for keys that are none.

    >>> sample([0, 2], [0, 10], [-1.0, 1.0, 9.0]).tolist()
    [0.0, 5.0, 10.0]
    >>> sample([0, 1, 2], [0, 1, 0], 2.5, loop=True).tolist()
    0.5
    """
    return Curve.of(times, values, interpolation, loop).at(t)


@dataclass(frozen=True, eq=False)
class Curve:
    """Keys that were checked, to sample often; arguments as of `sample`.

    slopes : (n, ...) at the keys of a smooth curve.
    """

    times: NDArray[np.float64]
    values: NDArray[np.float64]
    interpolation: str
    loop: bool
    slopes: NDArray[np.float64] | None

    @classmethod
    def of(
        cls, times: ArrayLike, values: ArrayLike, interpolation: str = "linear", loop: bool = False
    ) -> "Curve":
        """Check keys. Raises ValueError for keys that are none."""
        when, keyed = _checked(times, values, interpolation)
        smooth = interpolation == "smooth" and len(when) > 1
        return cls(
            when, keyed, interpolation, loop, _tangents(when, keyed, loop) if smooth else None
        )

    def at(self, t: ArrayLike) -> NDArray[np.float64]:
        """Evaluate at times t (...) seconds; see `sample`."""
        when, keyed, at = self.times, self.values, np.asarray(t, np.float64)
        if not np.isfinite(at).all():
            raise ValueError("Keys are sampled at finite times.")
        if len(when) == 1:
            return np.broadcast_to(keyed[0], at.shape + keyed.shape[1:]).copy()
        # Bring the time into the keys' range
        period = when[-1] - when[0]
        # A loop takes whole turns off, so that times in the first one keep every bit
        at = at - np.floor((at - when[0]) / period) * period if self.loop else at
        at = np.minimum(np.maximum(at, when[0]), when[-1])
        left = np.minimum(np.maximum(when.searchsorted(at, "right") - 1, 0), len(when) - 2)
        width = when[left + 1] - when[left]
        fraction = ((at - when[left]) / width).reshape(at.shape + (1,) * (keyed.ndim - 1))
        a, b = keyed[left], keyed[left + 1]
        if self.interpolation == "step":
            return np.asarray(np.where(fraction >= 1.0, b, a))
        if self.slopes is None:
            # This form gives both keys exactly and stays between them
            near_b = b - (b - a) * (1.0 - fraction)
            return np.asarray(np.where(fraction < 0.5, a + (b - a) * fraction, near_b))
        # Cubic Hermite in the form a + (b - a) blend + tangents
        scale = width.reshape(fraction.shape)
        blend = fraction * fraction * (3.0 - 2.0 * fraction)
        bend = fraction * (1.0 - fraction) * scale
        before, after = self.slopes[left], self.slopes[left + 1]
        curve = a + (b - a) * blend + bend * ((1.0 - fraction) * before - fraction * after)
        return np.asarray(np.minimum(np.maximum(curve, np.minimum(a, b)), np.maximum(a, b)))


def _checked(
    times: ArrayLike, values: ArrayLike, interpolation: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    when, keyed = np.asarray(times, np.float64), np.asarray(values, np.float64)
    if interpolation not in INTERPOLATIONS:
        raise ValueError(f"Interpolation is one of {', '.join(INTERPOLATIONS)}.")
    if when.ndim != 1 or len(when) == 0 or keyed.ndim == 0 or len(keyed) != len(when):
        raise ValueError("Keys need one value for each of one or more times.")
    if not (np.all(np.isfinite(when)) and np.all(np.isfinite(keyed))):
        raise ValueError("Times and values of keys are finite numbers.")
    if np.any(np.diff(when) < CLOSEST):
        raise ValueError(f"Times of keys increase, by {CLOSEST:g} s or more.")
    return when, keyed


def _tangents(
    when: NDArray[np.float64], keyed: NDArray[np.float64], loop: bool
) -> NDArray[np.float64]:
    """Harmonic-mean slopes (Fritsch, Butland 1984, eq. 5), 0 at extrema and at open ends."""
    width = np.diff(when).reshape((-1,) + (1,) * (keyed.ndim - 1))
    secant = np.diff(keyed, axis=0) / width
    tangents = np.zeros_like(keyed)
    tangents[1:-1] = _harmonic(secant[:-1], secant[1:], width[:-1], width[1:])
    # A loop that closes passes its seam without a stop
    if loop and np.array_equal(keyed[0], keyed[-1]):
        tangents[0] = tangents[-1] = _harmonic(secant[-1], secant[0], width[-1], width[0])
    return tangents


def _harmonic(
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    w_before: NDArray[np.float64],
    w_after: NDArray[np.float64],
) -> NDArray[np.float64]:
    same_way = (np.sign(before) * np.sign(after)) > 0
    safe_before, safe_after = np.where(same_way, before, 1.0), np.where(same_way, after, 1.0)
    alpha = (w_before + 2.0 * w_after) / (3.0 * (w_before + w_after))
    mean = 1.0 / ((1.0 - alpha) / safe_after + alpha / safe_before)
    return np.where(same_way, mean, 0.0)
