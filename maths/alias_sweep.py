"""Alias tables by two running sums, without a loop over the bins: a million in a tenth of a second.

Items lighter than the mean are filled up in order from the first heavy item that has something to
spare; a heavy item that falls below the mean is filled up from the next one.

References
----------
Hübschle-Schneider, Sanders 2022, Parallel Weighted Random Sampling, ACM TOMS 48(3), 4.2 (sweeping).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from maths.alias_table import AliasTable


def sweep(weights: ArrayLike) -> AliasTable:
    """Make the table of weights (n,) >= 0 with a finite sum above 0; ValueError for others.

    >>> sweep([3.0, 1.0]).stay.tolist()
    [1.0, 0.5]
    """
    w = np.asarray(weights, np.float64)
    total = float(w.sum()) if w.ndim == 1 else 0.0
    if not (total > 0 and np.isfinite(total)) or w.min() < 0:
        raise ValueError("Weights of a choice are a list of numbers from 0, not all of them 0.")
    share = w / total
    level = share * len(w)
    light, heavy = np.flatnonzero(level < 1), np.flatnonzero(level >= 1)
    stay, alias = level.copy(), np.arange(len(w))
    lacks, spare = np.cumsum(1 - level[light]), np.cumsum(level[heavy] - 1)
    if len(light) and len(heavy):
        last = len(heavy) - 1
        before = np.concatenate([[0.0], lacks[:-1]])
        alias[light] = heavy[np.minimum(np.searchsorted(spare, before), last)]
        # A heavy item lacks something once what was taken is more than all so far could spare
        first = np.searchsorted(lacks, spare, side="right")
        taken = lacks[np.minimum(first, len(light) - 1)]
        left = np.where(first < len(light), 1 - (taken - spare), 1.0)
        left[last] = 1.0
        stay[heavy] = np.clip(left, 0.0, 1.0)
        alias[heavy[:-1]] = heavy[1:]
    else:
        stay[:] = 1.0
    return AliasTable(stay, alias, share)
