"""Lat-long maps: row 0 is +y, the centre column looks along -z, u grows towards +x."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


def turned(values: ArrayLike, yaw: float) -> NDArray[np.float64]:
    """Turn a map (h, w, c) about +y by `yaw` radians, counter-clockwise from above.

    Between columns it is linear, so that every row keeps its sum.

    >>> turned(np.arange(4.0).reshape(1, 4, 1), np.pi / 2).ravel().round(9).tolist()
    [1.0, 2.0, 3.0, 0.0]
    """
    found = np.asarray(values, np.float64)
    columns = float(yaw) / (2 * np.pi) * found.shape[1]
    whole = int(np.floor(columns))
    share = columns - whole
    first = np.roll(found, -whole, axis=1)
    return np.asarray((1 - share) * first + share * np.roll(first, -1, axis=1))


def joined(maps: Sequence[ArrayLike]) -> NDArray[np.float64]:
    """Add maps (h, w, c) up; smaller ones take the size of the largest, each texel its nearest.

    Raises ValueError where there is none.

    >>> joined([np.ones((2, 4, 1)), np.full((1, 2, 1), 2.0)])[..., 0].tolist()
    [[3.0, 3.0, 3.0, 3.0], [3.0, 3.0, 3.0, 3.0]]
    """
    found = [np.asarray(each, np.float64) for each in maps]
    if not found:
        raise ValueError("There is no map to add up.")
    height, width = (max(each.shape[axis] for each in found) for axis in (0, 1))
    total = np.zeros((height, width, found[0].shape[2]))
    for each in found:
        rows = (2 * np.arange(height) + 1) * each.shape[0] // (2 * height)
        columns = (2 * np.arange(width) + 1) * each.shape[1] // (2 * width)
        total += each[rows[:, None], columns]
    return total
