"""Discrete random choice in constant time.

References
----------
Walker 1977, An Efficient Method for Generating Discrete Random Variables with General
Distributions.
Vose 1991, A Linear Algorithm for Generating Random Numbers with a Given Distribution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AliasTable:
    """n bins of equal width. stay : (n,) part of a bin that stands for itself, 0..1. alias : (n,)
    index that the rest stands for. share : (n,) probabilities."""

    stay: Array
    alias: NDArray[np.int64]
    share: Array

    @classmethod
    def of(cls, weights: ArrayLike) -> AliasTable:
        """Make the table of weights (n,) >= 0 with a finite sum above 0; ValueError for others.

        >>> AliasTable.of([3.0, 1.0]).share.tolist()
        [0.75, 0.25]
        """
        w = np.asarray(weights, np.float64)
        total = float(w.sum()) if w.ndim == 1 else 0.0
        if not (total > 0 and np.isfinite(total)) or w.min() < 0:
            raise ValueError("Weights of a choice are a list of numbers from 0, not all of them 0.")
        share = w / total
        stay, alias = (share * len(w)).tolist(), list(range(len(w)))
        small = [i for i, x in enumerate(stay) if x < 1]
        large = [i for i, x in enumerate(stay) if x >= 1]
        # Fill up each small bin from a large one, which shrinks
        while small and large:
            low, high = small.pop(), large[-1]
            alias[low] = high
            stay[high] -= 1 - stay[low]
            if stay[high] < 1:
                small.append(large.pop())
        # What is left over is 1 but for rounding; nothing of weight 0 may remain
        for i in small + large:
            stay[i] = 1.0 if share[i] > 0 else 0.0
            alias[i] = i if share[i] > 0 else int(np.argmax(share))
        return cls(np.array(stay), np.array(alias, np.int64), share)

    def choose(self, u: ArrayLike) -> NDArray[np.int64]:
        """Return indices (...) for numbers u (...) in [0, 1)."""
        place = np.asarray(u, np.float64) * len(self.stay)
        found = np.minimum(place.astype(np.int64), len(self.stay) - 1)
        return np.where(place - found < self.stay[found], found, self.alias[found])
