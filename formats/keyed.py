"""Numbers and vectors that may move: one value, or keys over time."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths import keyframes

Interpolation = Literal["linear", "step", "smooth"]
INTERPOLATIONS: tuple[Interpolation, ...] = ("linear", "step", "smooth")


@dataclass(frozen=True, eq=False)
class Keyed:
    """A value over time.

    times : (n,) seconds, strictly increasing.
    values : (n,) numbers or (n, size) vectors.
    interpolation : between keys; before the first and after the last key the value holds.
    loop : repeats with the period times[-1] - times[0].
    """

    times: NDArray[np.float64]
    values: NDArray[np.float64]
    interpolation: Interpolation = "linear"
    loop: bool = False

    @classmethod
    def hold(cls, value: ArrayLike) -> "Keyed":
        """A value that never changes: a number or a vector (size,).

        >>> Keyed.hold([1.0, 2.0, 3.0]).at(5.0).tolist()
        [1.0, 2.0, 3.0]
        """
        return cls(np.zeros(1), np.asarray(value, dtype=np.float64)[None])

    def at(self, t: float) -> Any:
        """The value at t seconds: a float for numbers, an array (size,) for vectors."""
        value = self.values[0] if self.constant else self._curve.at(t)
        return float(value) if self.values.ndim == 1 else np.array(value, dtype=np.float64)

    def sampled(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values at many moments (n,): (n,) or (n, size)."""
        if self.constant:
            return np.broadcast_to(self.values[0], (*times.shape, *self.values.shape[1:]))
        return self._curve.at(times)

    @cached_property
    def _curve(self) -> keyframes.Curve:
        return keyframes.Curve.of(self.times, self.values, self.interpolation, self.loop)

    @cached_property
    def constant(self) -> bool:
        """Whether the value is the same at all times."""
        return bool(np.all(self.values == self.values[0]))

    @property
    def extremes(self) -> tuple[Any, Any]:
        """Smallest and largest value, a component at a time: curves stay within their keys."""
        low, high = self.values.min(axis=0), self.values.max(axis=0)
        return (float(low), float(high)) if self.values.ndim == 1 else (low, high)

    @cached_property
    def shortest(self) -> float:
        """The least length that a vector takes, at 64 moments between each two keys."""
        share = np.arange(64) / 64
        between = (self.times[:-1, None] + np.diff(self.times)[:, None] * share).ravel()
        moments = np.append(between, self.times[-1])
        found = self._curve.at(moments)
        return float(np.linalg.norm(found, axis=-1).min())
