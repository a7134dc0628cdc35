"""Spherical harmonics: functions on the sphere of directions as a few numbers.

Real, orthonormal over the sphere, no Condon-Shortley phase, index `l (l + 1) + m`; Y(1, -1..1) is
`sqrt(3 / 4 pi)` times (y, z, x). The highest band is `l_max`, and K = (l_max + 1)^2. (Papers that
count bands say "order" for l_max + 1, others for l_max: nothing here is called so.)

    Y(l, +-m) = q(l, m)(z) (Re, Im)(x + i y)^m

with polynomials q: sin^m of the polar angle is inside (x + i y)^m, no angle is ever taken, and the
poles are no special case.

The parts: `spherical_rotation`, `spherical_projection` (functions to coefficients, products,
irradiance), `spherical_window` (less ringing), `spherical_lights` (lamps to coefficients).

References
----------
Ramamoorthi, Hanrahan 2001, An Efficient Representation for Irradiance Environment Maps (signs).
Sloan 2008, Stupid Spherical Harmonics Tricks (zonal functions, convolution).
Holmes, Featherstone 2002, A unified approach to the Clenshaw summation and the recursive
    computation of very high degree and order normalised associated Legendre functions (recurrence).
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Real = NDArray[Any]
"""Any float type."""

MAX_L = 500
"""Highest band: q(l, m) reaches 1e104 there."""
BLOCK = 1 << 17
"""Values of the basis at once: 1 MB."""


def evaluate(directions: ArrayLike, l_max: int) -> Real:
    """Values of the basis in directions, scaled to unit length first.

    directions : (..., 3), any finite non-zero length.  l_max : 0 to 500.
    Returns (..., K) of the type of the directions, worked out in float64 and rounded: float32 stays
    float32, and integers become float64. Raises ValueError for zero and NaN directions and for
    other bands.

    >>> (evaluate([0.0, 0.0, 2.0], 1) * np.sqrt(4 * np.pi)).round(6).tolist()
    [1.0, 0.0, 1.732051, 0.0]
    """
    d = np.asarray(directions)
    kept = d.dtype if d.dtype.kind == "f" else np.dtype(np.float64)
    # A float32 recurrence would be 1.3e-6 off at l = 5 already, and 1.6e-5 at 25
    unit = _unit(d, np.promote_types(kept, np.float64), l_max)
    flat = unit.reshape(-1, 3)
    K = (l_max + 1) ** 2
    found = np.empty((len(flat), K), kept)
    rows = max(1, BLOCK // K)
    for start in range(0, len(flat), rows):
        found[start : start + rows] = unit_basis(flat[start : start + rows].T, l_max).T
    return found.reshape(*d.shape[:-1], K)


def band_of(l_max: int) -> NDArray[np.int64]:
    """Band l of each coefficient: 0, 1, 1, 1, 2, ... Returns (K,).

    >>> band_of(1).tolist()
    [0, 1, 1, 1]
    """
    return np.repeat(np.arange(l_max + 1), 2 * np.arange(l_max + 1) + 1)


def l_max_of(count: int) -> int:
    """Highest band of `count` coefficients. Raises ValueError where no set has so many.

    >>> l_max_of(25)
    4
    """
    root = int(np.rint(np.sqrt(max(count, 0))))
    if count < 1 or root * root != count:
        raise ValueError(f"Spherical harmonics come in 1, 4, 9, 16, ... numbers, not {count}.")
    return root - 1


def turn_zonal(zonal: ArrayLike, axis: ArrayLike) -> Array:
    """Coefficients (..., K) of a function of the angle around +z, turned to be around an axis.

    zonal : (..., l_max + 1), its coefficients Y(l, 0).  axis : (..., 3), non-zero.
    `c(l, m) = sqrt(4 pi / (2 l + 1)) z(l) Y(l, m)(axis)` (Sloan 2008). Raises ValueError as
    `evaluate`.
    """
    z = np.asarray(zonal, np.float64)
    band = band_of(z.shape[-1] - 1)
    basis = evaluate(np.asarray(axis, np.float64), z.shape[-1] - 1)
    return np.asarray(np.sqrt(4 * np.pi / (2 * band + 1)) * z[..., band] * basis)


def polynomials(z: Real, l_max: int) -> list[list[Real]]:
    """The polynomials q(l, m) of the module's head at z = cos of the polar angle.

    z : (...) in [-1, 1]. Returns q[m][l - m], each (...) and of z's type.
    """
    q: list[list[Real]] = []
    sectoral = float(np.sqrt(1 / (4 * np.pi)))
    for m in range(l_max + 1):
        if m:
            sectoral *= float(np.sqrt((2 * m + 1) / (2 * m) * (2 if m == 1 else 1)))
        column = [np.full_like(z, sectoral)]
        for band in range(m + 1, l_max + 1):
            a = float(np.sqrt((4 * band**2 - 1) / (band**2 - m**2)))
            term = z * column[-1]
            if band > m + 1:
                b = float(np.sqrt(((band - 1) ** 2 - m**2) / (4 * (band - 1) ** 2 - 1)))
                term = term - b * column[-2]
            column.append(a * term)
        q.append(column)
    return q


def unit_basis(d: Real, l_max: int) -> Real:
    """Values (K, n) in unit directions (3, n)."""
    x, y, z = d
    values = np.empty(((l_max + 1) ** 2, len(z)), d.dtype)
    real, imaginary = np.ones_like(z), np.zeros_like(z)
    for m, column in enumerate(polynomials(z, l_max)):
        if m:
            real, imaginary = x * real - y * imaginary, x * imaginary + y * real
        for band, q in enumerate(column, m):
            centre = band * (band + 1)
            values[centre + m] = q * real
            if m:
                values[centre - m] = q * imaginary
    return values


def _unit(d: Real, work: np.dtype[Any], l_max: int) -> Real:
    """Scale directions to unit length in a type; squares of 1e-200 and 1e200 do no harm."""
    if d.ndim < 1 or d.shape[-1] != 3 or not 0 <= l_max <= MAX_L:
        raise ValueError(f"Directions are (..., 3) and l_max is 0 to {MAX_L}.")
    v = d.astype(work)
    largest = np.max(np.abs(v), axis=-1, keepdims=True)
    # Written so that a NaN fails it too
    if not np.all((largest > 0) & np.isfinite(largest)):
        raise ValueError("A direction is a finite vector that is not zero.")
    v = v / largest
    return np.asarray(v / np.sqrt(np.sum(v * v, axis=-1, keepdims=True)))
