"""Sums of face normals about points where very many faces meet, such as the middle of a fine fan:
not pair by pair, which takes the square of their number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CROWDED = 1024
"""More faces than this about a point count by groups."""
STEPS = 32
"""Groups are normals that round to the same multiples of 1 / STEPS: within 3 degrees."""
PAIRS = 4_000_000


def sums(
    unit: NDArray[np.float64], weighted: NDArray[np.float64], crease: float
) -> NDArray[np.float64]:
    """Return (n, 3), for each of the n faces about a point the sum of `weighted` (n, 3) over the
    faces whose normals `unit` (n, 3) meet its own at a cosine above `crease`, by groups."""
    cells = np.rint(unit * STEPS).astype(np.int64) + 2 * STEPS
    code = (cells[:, 0] * 4 * STEPS + cells[:, 1]) * 4 * STEPS + cells[:, 2]
    _, group = np.unique(code, return_inverse=True)
    total = np.stack([np.bincount(group, weighted[:, axis]) for axis in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    middle = np.divide(total, length, where=length > 0, out=np.zeros_like(total))
    found = np.empty_like(unit)
    rows = max(1, PAIRS // len(middle))
    for start in range(0, len(unit), rows):
        block = slice(start, start + rows)
        # Not by BLAS, whose kernels round otherwise
        near = np.einsum("fi,gi->fg", unit[block], middle) > crease
        found[block] = np.einsum("fg,gi->fi", near.astype(np.float64), total)
    return found
