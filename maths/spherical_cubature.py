"""Integrals of spherical harmonics over small flat lights, by a few points of their area.

A parallelogram or disc of radius x D about its middle, seen from a distance D, takes 4 points by a
rule that is exact to degree 3, or 16 to degree 7. The first power that a rule of degree n misses is
`x^(n + 1)`, and its derivative grows with l as `(l_max + n + 3 choose n + 1)`; the error of any
coefficient is at most MARGIN times both, as a share of area / D^2 (measured, not proven).

References
----------
Stroud 1971, Approximate Calculation of Multiple Integrals (products of Gauss's rules, discs).
"""

from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from maths.spherical_harmonics import unit_basis

Array = NDArray[np.float64]

DEGREES = 3, 7
MARGIN = {3: 0.026, 7: 0.0021}
"""Error over both, by degree: twice the largest measured on 1,500 lights each of ratio .05 to .5,
l_max 2 to 8."""
BLOCK = 1 << 17
"""Values of the basis at once: 1 MB."""


def degrees_for(ratio: Array, l_max: int, precision: float) -> NDArray[np.int64]:
    """Least degree (n,) of a rule within `precision` of area / D^2; 0 where none is.

    ratio : (n,), radius about the middle over the distance of the middle.
    """
    found = np.zeros(ratio.shape, np.int64)
    for degree in reversed(DEGREES):
        found[ratio < reach(l_max, degree, precision)] = degree
    return found


def reach(l_max: int, degree: int, precision: float) -> float:
    """Largest ratio of a light to its distance that a rule is within `precision` for.

    >>> round(reach(4, 3, 1e-3), 3), round(reach(4, 7, 1e-3), 3)
    (0.116, 0.335)
    """
    terms = comb(l_max + degree + 3, degree + 1)
    return float(min(0.5, (precision / (MARGIN[degree] * terms)) ** (1 / (degree + 1))))


def integral(
    middle: Array, sides: tuple[Array, Array], area: Array, l_max: int, degree: int, disc: bool
) -> Array:
    """Integrals (n, K) of the basis over flat lights as seen from 0, from their front.

    middle : (n, 3).  sides : two of (n, 3), half sides of a parallelogram or two perpendicular
    radii of a disc.  area : (n, 3), its vector, along the front's normal.
    """
    points, weights = _rule(degree, disc)
    K, m = (l_max + 1) ** 2, len(weights)
    found = np.empty((len(middle), K))
    step = max(1, BLOCK // (K * m))
    for first in range(0, len(middle), step):
        part = slice(first, first + step)
        c, a, b = middle[part].T[:, None], sides[0][part].T[:, None], sides[1][part].T[:, None]
        d = c + points[:, :1] * a + points[:, 1:] * b
        inverse = 1 / np.sqrt(np.einsum("xmn,xmn->mn", d, d))
        d *= inverse
        share = np.einsum("xmn,nx->mn", d, area[part]) * inverse**2 * -weights[:, None]
        basis = unit_basis(d.reshape(3, -1), l_max).reshape(K, *share.shape)
        found[part] = np.einsum("kmn,mn->nk", basis, share)
    return found


@cache
def _rule(degree: int, disc: bool) -> tuple[Array, Array]:
    """Points (m, 2) of the square +-1 or of the unit disc, and weights (m,) that sum to 1."""
    if not disc:
        x, w = np.polynomial.legendre.leggauss((degree + 1) // 2)
        grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
        return grid, np.outer(w, w).ravel() / 4
    # Even steps around, Gauss in the squared radius
    x, w = np.polynomial.legendre.leggauss((degree + 3) // 4)
    turn = 2 * np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1)
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    points = np.sqrt(0.5 * (1 + x))[:, None, None] * rim
    return points.reshape(-1, 2), np.repeat(0.5 * w / (degree + 1), degree + 1)
