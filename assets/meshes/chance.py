"""Chance: a small stream of numbers that is the same with every version of numpy."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Chance:
    """Uniform and normal draws from PCG64's raw stream, whose bits numpy guarantees."""

    def __init__(self, seed: int) -> None:
        self._bits = np.random.PCG64(seed)

    def uniform(
        self, low: float = 0.0, high: float = 1.0, size: int | tuple[int, ...] = 1
    ) -> Array:
        """Numbers in [low, high), shape `size`."""
        count = int(np.prod(size))
        raw = np.asarray(self._bits.random_raw(count), dtype=np.uint64)
        fractions = (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53
        return (low + (high - low) * fractions).reshape(size)

    def one(self, low: float = 0.0, high: float = 1.0) -> float:
        """One number in [low, high)."""
        return float(self.uniform(low, high)[0])

    def normal(self, size: int | tuple[int, ...] = 1) -> Array:
        """Standard normal numbers by Box and Muller's transform."""
        radius = np.sqrt(-2.0 * np.log(1.0 - self.uniform(size=size)))
        return radius * np.cos(2.0 * np.pi * self.uniform(size=size))

    def sphere(self, count: int) -> Array:
        """Directions (count, 3) uniform on the sphere."""
        y = self.uniform(-1.0, 1.0, count)
        turn = self.uniform(0.0, 2.0 * np.pi, count)
        r = np.sqrt(np.maximum(0.0, 1.0 - y * y))
        return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=-1)
