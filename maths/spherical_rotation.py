"""Rotation of spherical harmonics: one orthogonal matrix a band, each made from the one before.

`Y(R d) = D Y(d)`, so that the function `f(d) = c . Y(d)` turned by R, `f(R^T d)`, has `D c`.

References
----------
Ivanic, Ruedenberg 1996, Rotation Matrices for Real Spherical Harmonics: Direct Determination by
    Recursion, J. Phys. Chem. 100, and its additions and corrections of 1998, J. Phys. Chem. A 102
    (tables 1 and 2, eq. 8.1).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.spherical_harmonics import MAX_L, l_max_of

Array = NDArray[np.float64]

TOLERANCE = 1e-4
"""Largest entry of `R R^T - I` of what still counts as a rotation: float32, and scene files."""
ORDER = [1, 2, 0]
"""Axes in the order of band 1: y, z, x."""


def rotation_matrices(R: ArrayLike, l_max: int) -> tuple[Array, ...]:
    """Matrices of the bands 0 to l_max.

    R : (..., 3, 3), target_from_source. What is within 1e-4 of a rotation is made one first, so
        that bands are orthogonal to rounding: to 1e-14 up to l = 20.
    Always turn the original: of 3600 turns in a row each adds its rounding.
    Returns D_l (..., 2 l + 1, 2 l + 1), rows and columns m = -l .. l. Raises ValueError for scale,
    shear, mirror images and NaN.

    >>> from maths.transforms import rotation
    >>> rotation_matrices(rotation("z", np.pi / 2), 1)[1].round(12).tolist()
    [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    """
    if not 0 <= l_max <= MAX_L:
        raise ValueError(f"The highest band is 0 to {MAX_L}.")
    turn = _checked(R)
    first = turn[..., ORDER, :][..., ORDER]
    bands = [np.ones((*turn.shape[:-2], 1, 1)), first]
    for band in range(2, l_max + 1):
        bands.append(_next_band(first, bands[-1], band))
    return tuple(bands[: l_max + 1])


def rotate(coefficients: ArrayLike, R: ArrayLike, *, axis: int | None = None) -> Array:
    """Coefficients of a function turned by R.

    coefficients : (..., K) or (..., K, 3).  R : (3, 3), or one for each, (..., 3, 3).  axis : the
        axis of K; needed where the last one has neither K nor three numbers.
    Returns the same shape. Raises ValueError as `rotation_matrices`, and for shapes that are none.

    >>> rotate([0.0, 1.0, 0.0, 0.0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]]).round(12).tolist()
    [0.0, 0.0, 0.0, -1.0]
    """
    c = np.asarray(coefficients, np.float64)
    # Three is no number of coefficients: it is colour
    colour = c.ndim > 1 and c.shape[-1] == 3
    where = axis if axis is not None else -2 if colour else -1
    if axis is None and not colour and c.ndim > 1 and c.shape[-1] == 1:
        raise ValueError("Say by axis where the coefficients are: (..., 1) may be one colour.")
    # Columns of other channels: (..., K, channels)
    columns = np.moveaxis(c, where, -1)[..., None] if where != -2 else c
    l_max = l_max_of(columns.shape[-2])
    parts, start = [], 0
    for D in rotation_matrices(R, l_max):
        parts.append(D @ columns[..., start : start + D.shape[-1], :])
        start += D.shape[-1]
    found = np.concatenate(parts, axis=-2)
    return found if where == -2 else np.moveaxis(found[..., 0], -1, where)


def _checked(R: ArrayLike) -> Array:
    """Rotations (..., 3, 3), orthogonal to rounding."""
    turn = np.asarray(R, np.float64)
    if turn.shape[-2:] != (3, 3) or not np.all(np.isfinite(turn)) or np.any(np.abs(turn) > 2):
        raise ValueError("A rotation is a matrix of three rows and columns of numbers -1 to 1.")
    error = np.swapaxes(turn, -1, -2) @ turn - np.eye(3)
    if np.any(np.abs(error) > TOLERANCE):
        raise ValueError("The matrix is no rotation: it scales or shears.")
    if np.any(np.linalg.det(turn) < 0):
        raise ValueError("The matrix is no rotation: it mirrors.")
    # Newton's iteration to the nearest rotation squares the error: 1e-8, 1e-16
    for _ in range(2):
        error = np.swapaxes(turn, -1, -2) @ turn - np.eye(3)
        turn = turn - 0.5 * turn @ error
    return turn


def _next_band(first: Array, last: Array, band: int) -> Array:
    """D of `band` from those of band 1 and `band - 1` (1996, tables 1 and 2, as corrected)."""
    m = np.arange(-band, band + 1)
    size, sign = np.abs(m), np.sign(m)
    zero, one = (m == 0) * 1.0, (size == 1) * 1.0
    P = {i: _products(first, last, i) for i in (-1, 0, 1)}

    def row(i: int, mu: NDArray[np.int64]) -> Array:
        # Rows that do not exist have a factor of 0
        return P[i][..., np.clip(mu, 1 - band, band - 1) + band - 1, :]

    # V of m = 0 is P(1, 1) + P(-1, -1)
    inner = np.where(m == 0, 1, sign * (size - 1))
    root = np.sqrt(1 + one)
    cosine = np.where(m < 0, 1 - one, root)
    sine = np.where(m > 0, one - 1, root)
    V = cosine[:, None] * row(1, inner) + sine[:, None] * row(-1, -inner)
    W = row(1, sign * (size + 1)) + sign[:, None] * row(-1, -sign * (size + 1))
    u = np.sqrt((band + m) * (band - m))
    v = 0.5 * np.sqrt((1 + zero) * (band + size - 1) * (band + size)) * (1 - 2 * zero)
    w = -0.5 * np.sqrt(np.maximum((band - size - 1) * (band - size), 0)) * (1 - zero)
    below = np.where(size == band, 2 * band * (2 * band - 1), (band + m) * (band - m))
    total = u[:, None] * row(0, m) + v[:, None] * V + w[:, None] * W
    return np.asarray(total / np.sqrt(below))


def _products(first: Array, last: Array, i: int) -> Array:
    """P(i; mu, n) for all rows mu of the band before and all columns n: (..., 2 l - 1, 2 l + 1)."""
    left, middle, right = (first[..., i + 1, j, None, None] for j in range(3))
    low, high = last[..., :, :1], last[..., :, -1:]
    parts = [right * low + left * high, middle * last, right * high - left * low]
    return np.concatenate(parts, axis=-1)
