"""Integrals of spherical harmonics over small flat lights, by a few points of their area.

A parallelogram, disc or triangle of radius x D about its middle, seen from a distance D, takes the
points of a rule that is exact to degree n: 4, 7, 16 or 36 for degree 3, 5, 7 or 11. The first
power that it misses is `x^(n + 1)`, and its derivative grows with l as `(l_max + n + 3 choose
n + 1)`; the error of any coefficient is at most MARGIN times both, as a share of area / D^2
(measured, not proven).

References
----------
Stroud 1971, Approximate Calculation of Multiple Integrals (products of Gauss's rules, discs, the
rules of 7 points: C2 5-1, S2 5-1, and Radon's for triangles).
"""

from dataclasses import dataclass
from functools import cache
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maths.polygon_lights import RADON
from maths.sampling import orthonormal_basis
from maths.spherical_harmonics import unit_basis

Array = NDArray[np.float64]
Float = NDArray[np.float32]

MARGIN = {
    "disc": {3: 0.026, 5: 0.0045, 7: 0.0021, 11: 0.0006},
    "parallelogram": {3: 0.026, 5: 0.003, 7: 0.0004, 11: 7e-6},
    "triangle": {5: 0.0009},
}
"""Error over both, by shape and degree: 1.7 times the largest measured or more, on 1,000 lights
each of ratio .05 to .5, l_max 2 to 10."""
BLOCK = 1 << 17
"""Values of the basis at once: 1 MB."""


@dataclass(frozen=True, eq=False)
class Patches:
    """Flat lights of one shape: points `start + s a + t b`, s and t of +-1 in a parallelogram, of
    the unit circle in a disc, of s, t, 1 - s - t > 0 in a triangle.

    start, a, b : (n, 3).  area : (n, 3) its vector, along the front's normal.  front : (n, 3) along
    the normal of the light that it is a piece of, any length.  middle : (n, 3).  size : (n,) radius
    about it.  two_sided : (n,).  pieces : of each light, one after the other.
    """

    shape: str
    start: Array
    a: Array
    b: Array
    area: Array
    front: Array
    middle: Array
    size: Array
    two_sided: NDArray[np.bool_]
    pieces: int = 1


def disc_patches(
    centre: Array, axis: Array, radius: Array, two_sided: NDArray[np.bool_]
) -> Patches:
    """Patches of n discs: centre, axis (n, 3), axis unit; radius, two_sided (n,)."""
    a, b = (radius[:, None] * side for side in orthonormal_basis(axis))
    area = (np.pi * radius * radius)[:, None] * axis
    return Patches("disc", centre, a, b, area, axis, centre, radius, two_sided)


def polygon_patches(corners: Array, two_sided: NDArray[np.bool_]) -> Patches:
    """Patches of n polygons of k corners (n, k, 3): whole where all are parallelograms, else the
    fan of triangles about a corner. two_sided : (n,)."""
    r, k = corners, corners.shape[1]
    if k == 4 and bool(np.all(is_parallelogram(r))):
        middle = 0.5 * (r[:, 0] + r[:, 2])
        a, b = 0.5 * (r[:, 1] - r[:, 0]), 0.5 * (r[:, 2] - r[:, 1])
        area = 4 * np.cross(a, b)
        size = np.sqrt(np.maximum(_square(a + b), _square(a - b)))
        return Patches("parallelogram", middle, a, b, area, area, middle, size, two_sided)
    start = np.repeat(r[:, :1], k - 2, axis=1)
    a, b = r[:, 1:-1] - start, r[:, 2:] - start
    middle = start + (a + b) / 3
    ends = np.stack([start, start + a, start + b]) - middle
    area = 0.5 * np.cross(a, b)
    front = np.repeat(area.sum(axis=1, keepdims=True), k - 2, axis=1)
    size = np.sqrt(_square(ends).max(axis=0)).ravel()
    start, a, b, area, front, middle = (
        np.asarray(v).reshape(-1, 3) for v in (start, a, b, area, front, middle)
    )
    both = np.repeat(two_sided, k - 2)
    return Patches("triangle", start, a, b, area, front, middle, size, both, k - 2)


def is_parallelogram(corners: Array) -> NDArray[np.bool_]:
    """Tell which quadrangles (n, 4, 3) are parallelograms."""
    r = corners
    size = np.maximum(_square(r[:, 2] - r[:, 0]), _square(r[:, 3] - r[:, 1]))
    return np.asarray(_square(r[:, 0] + r[:, 2] - r[:, 1] - r[:, 3]) <= 4e-18 * size)


def _square(v: Array) -> Array:
    return np.asarray(np.einsum("...x,...x->...", v, v))


def degrees_for(ratio: Array, l_max: int, precision: float, shape: str) -> NDArray[np.int64]:
    """Least degree (...) of a rule within `precision` of area / D^2; 0 where none is.

    ratio : (...), radius about the middle over the distance of the middle.
    """
    found = np.zeros(ratio.shape, np.int64)
    for degree in reversed(MARGIN[shape]):
        found[ratio < reach(l_max, degree, precision, shape)] = degree
    return found


def reach(l_max: int, degree: int, precision: float, shape: str) -> float:
    """Largest ratio of a light to its distance that a rule is within `precision` for.

    >>> round(reach(4, 3, 1e-3, "disc"), 3), round(reach(4, 7, 1e-3, "disc"), 3)
    (0.116, 0.335)
    """
    terms = comb(l_max + degree + 3, degree + 1)
    return float(min(0.5, (precision / (MARGIN[shape][degree] * terms)) ** (1 / (degree + 1))))


def integral(
    middle: Array, sides: tuple[Array, Array], area: Array, l_max: int, degree: int, shape: str
) -> Array:
    """Integrals (n, K) of the basis over flat lights as seen from 0, from their front.

    middle : (n, 3).  sides : two of (n, 3), half sides of a parallelogram or two perpendicular
    radii of a disc.  area : (n, 3), its vector, along the front's normal.
    """
    points, weights = _rule(degree, shape)
    K, m = (l_max + 1) ** 2, len(weights)
    found = np.empty((len(middle), K))
    step = max(1, BLOCK // (K * m))
    for first in range(0, len(middle), step):
        part = slice(first, first + step)
        c, a, b = (np.ascontiguousarray(x[part].T) for x in (middle, *sides))
        d, share = _seen(c, a, b, area[part].T, points, weights)
        basis = unit_basis(d.reshape(3, -1), l_max).reshape(K, *share.shape)
        found[part] = np.einsum("knm,nm->nk", basis, share)
    return found


def total(
    points: Array, lights: Patches, radiance: Array, l_max: int, precision: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Sum (p, K, c) over lights at points (p, 3), and which of them (p, n) are too near for it.

    radiance : (n, c) of each light.  precision : error of each, as a share of area / distance^2;
    the arithmetic is that of float32, 1e-6 of it. Points behind a light that is not two-sided, and
    in its own plane, get nothing.
    """
    offset = lights.middle - points[:, None]
    far = np.sqrt(np.einsum("pnx,pnx->pn", offset, offset))
    side = -np.einsum("pnx,nx->pn", offset, lights.front)
    lit = (side > 0) | (lights.two_sided & (side < 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(far > 0, lights.size / far, np.inf)
    degrees = np.where(lit, degrees_for(ratio, l_max, precision, lights.shape), -1)
    # Where one piece is too near none counts
    by_light = degrees.reshape(len(points), -1, lights.pieces)
    too_near = (by_light == 0).any(axis=2)
    by_light[too_near] = 0
    found = np.zeros((len(points), (l_max + 1) ** 2, radiance.shape[1]))
    emitted = radiance.astype(np.float32)
    for degree in MARGIN[lights.shape]:
        where, which = np.nonzero(degrees == degree)
        step = max(1, 2 * BLOCK // (found.shape[1] * len(_rule(degree, lights.shape)[1])))
        for first in range(0, len(which), step):
            pair = where[first : first + step], which[first : first + step]
            basis, share = _pairs(points, lights, pair, 1 / far[pair], side[pair], l_max, degree)
            # Pairs are in the order of their points
            ends = np.searchsorted(pair[0], np.arange(len(points) + 1))
            for p in np.unique(pair[0]):
                part = slice(ends[p], ends[p + 1])
                light = share[part, :, None] * emitted[pair[1][part] // lights.pieces][:, None]
                columns = slice(ends[p] * share.shape[1], ends[p + 1] * share.shape[1])
                found[p] += basis[:, columns] @ light.reshape(-1, light.shape[-1])
    return found, too_near


def _pairs(
    points: Array,
    lights: Patches,
    pair: tuple[NDArray[np.int64], NDArray[np.int64]],
    near: Array,
    side: Array,
    l_max: int,
    degree: int,
) -> tuple[Float, Float]:
    """Basis (K, q m) and shares (q, m) of m points of a light in q pairs of a place and a light."""
    where, which = pair
    rule = tuple(x.astype(np.float32) for x in _rule(degree, lights.shape))
    # In units of the distance, so that squares of any size stay within float32
    start = (lights.start[which] - points[where]) * near[:, None]
    sides = (x[which] * near[:, None] for x in (lights.a, lights.b))
    area = lights.area[which] * (np.sign(side) * near * near)[:, None]
    c, a, b, n = (np.ascontiguousarray(x.T, np.float32) for x in (start, *sides, area))
    d, share = _seen(c, a, b, n, *rule)
    return unit_basis(d.reshape(3, -1), l_max), share


def _seen(c: Any, a: Any, b: Any, area: Any, points: Any, weights: Any) -> tuple[Any, Any]:
    """Unit directions (3, n, m) to a rule's points and solid angles (n, m) that they stand for.

    c, a, b, area : (3, n).
    """
    d = c[..., None] + a[..., None] * points[:, 0]
    d += b[..., None] * points[:, 1]
    x, y, z = d
    inverse = 1 / np.sqrt(x * x + y * y + z * z)
    d *= inverse
    u, v, w = area[..., None]
    share = (x * u + y * v + z * w) * (inverse * inverse) * -weights
    return d, share


@cache
def _rule(degree: int, shape: str) -> tuple[Array, Array]:
    """Points (m, 2) of the shape, and weights (m,) that sum to 1."""
    if shape == "triangle":
        return np.array([[s, t] for _, s, t in RADON]), np.array([w for w, _, _ in RADON])
    if degree == 5:
        return _seven(shape)
    if shape == "parallelogram":
        x, w = np.polynomial.legendre.leggauss((degree + 1) // 2)
        grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
        return grid, np.outer(w, w).ravel() / 4
    # Even steps around, Gauss in the squared radius
    x, w = np.polynomial.legendre.leggauss((degree + 3) // 4)
    turn = 2 * np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1)
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    points = np.sqrt(0.5 * (1 + x))[:, None, None] * rim
    return points.reshape(-1, 2), np.repeat(0.5 * w / (degree + 1), degree + 1)


def _seven(shape: str) -> tuple[Array, Array]:
    """The rules of 7 points and degree 5 for the square +-1 and the unit disc."""
    if shape == "disc":
        turn = np.pi / 3 * np.arange(6)
        rim = np.sqrt(2 / 3) * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        return np.concatenate([np.zeros((1, 2)), rim]), np.array([1 / 4] + 6 * [1 / 8])
    x, y, top = np.sqrt(3 / 5), np.sqrt(1 / 3), np.sqrt(14 / 15)
    corners = [[x, y], [x, -y], [-x, y], [-x, -y]]
    points = np.array([[0.0, 0.0], [0.0, top], [0.0, -top], *corners])
    return points, np.array([2 / 7, 5 / 63, 5 / 63] + 4 * [5 / 36])
