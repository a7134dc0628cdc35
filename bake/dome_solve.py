"""Many small symmetric systems at once: a step of the elimination is a step for all of them.

LAPACK takes one system at a time, which for sixteen unknowns is four times as slow.

References
----------
Golub, Van Loan 2013, Matrix Computations, section 4.2 (Cholesky by outer products).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]

LEAST = 1e-6
"""A pivot's least share of its diagonal: ten roundings of single precision. What the equations do
not determine is then held near 0, as by a small penalty."""


def solved(normal: Float, right: Float) -> Float:
    """Solve P positive semi-definite systems of J unknowns in place; returns `right`, (J, P).

    normal : (J, J, P), diagonals above 0; its lower triangles are read, and overwritten. right :
    (J, P). Relative error about the condition of a system times 1e-7.
    """
    count = len(normal)
    least = np.stack([normal[j, j] for j in range(count)]) * np.float32(LEAST)
    for j in range(count):
        # The pivot's place keeps its inverse root
        inverse = 1 / np.sqrt(np.maximum(normal[j, j], least[j]))
        column = normal[j + 1 :, j]
        column *= inverse
        normal[j, j] = inverse
        right[j] *= inverse
        right[j + 1 :] -= column * right[j]
        for k in range(j + 1, count):
            normal[k:, k] -= normal[k:, j] * normal[k, j]
    for j in reversed(range(count)):
        right[j] *= normal[j, j]
        right[:j] -= normal[j, :j] * right[j]
    return right
