"""Integrals of spherical harmonics over flat lights, as integrals along their outlines.

On the sphere `-l (l + 1) Y` is the Laplacian of Y, so that by the divergence theorem

    integral over A of Y dw = -1 / (l (l + 1)) contour integral of grad Y . (r x dr) / r^2,  l > 0,

for an outline r(t) that runs counter-clockwise as seen from its front; band 0 is the solid angle.
Along an edge grad Y . n is a trigonometric polynomial of degree l in the angle, which n nodes of
Gauss integrate to `(l a)^(2n) (n!)^4 / ((2n + 1) (2n)!^3)` of its size over an angle a; around a
circle the mean of n points has an error of `exp(-n s)`, s the distance of the nearest pole.

References
----------
Wang, Ramamoorthi 2018, Analytic Spherical Harmonic Coefficients for Polygonal Area Lights (the same
    integrals by recurrence).
Bernstein's bound of derivatives of trigonometric polynomials; Davis, Rabinowitz 1984, Methods of
    Numerical Integration (errors of Gauss's rule and of the trapezoidal rule).
"""

from collections.abc import Callable
from functools import cache
from math import lgamma, log

import numpy as np
from numpy.typing import NDArray

from maths.disc_lights import disc_solid_angle
from maths.polygon_lights import RADON, polygon_solid_angle
from maths.sampling import orthonormal_basis
from maths.spherical_harmonics import band_of, evaluate, polynomials

Array = NDArray[np.float64]

PRECISION = 1e-16
"""Error that the number of nodes is chosen for, of the light's outline, unless told another."""
FAR = 1e-4
"""Size / distance below which a polygon is seven points a triangle, exact to (l FAR)^6, and a
hundredth of it that below which a disc is its middle. Outlines lose 1e-16 / size."""
MOST = 1024
"""Most points around a circle."""
BLOCK = 1 << 17
"""Values of gradients at once: 1 MB, and as much for each of five steps."""


def slope(directions: Array, tangents: Array, l_max: int) -> Array:
    """Derivatives (..., K) of the basis at unit directions (..., 3) along vectors (..., 3)."""
    x, y, z = np.moveaxis(directions, -1, 0)
    u, v, w = np.moveaxis(tangents, -1, 0)
    q = polynomials(z, l_max)
    found = np.empty(((l_max + 1) ** 2, *z.shape))
    real, imaginary = np.ones_like(z), np.zeros_like(z)
    across, along = np.zeros_like(z), np.zeros_like(z)
    for m in range(l_max + 1):
        if m:
            # m (x + i y)^(m - 1) (u + i v)
            across, along = m * (real * u - imaginary * v), m * (real * v + imaginary * u)
            real, imaginary = x * real - y * imaginary, x * imaginary + y * real
        for band in range(m, l_max + 1):
            # q(l, m)' is q(l, m + 1) but for its norm
            rise = np.sqrt((band - m) * (band + m + 1) / (1 if m else 2)) * w
            rise = rise * q[m + 1][band - m - 1] if band > m else np.zeros_like(z)
            centre = band * (band + 1)
            found[centre + m] = rise * real + q[m][band - m] * across
            if m:
                found[centre - m] = rise * imaginary + q[m][band - m] * along
    return np.moveaxis(found, 0, -1)


def polygon_integral(corners: Array, l_max: int, precision: float = PRECISION) -> Array:
    """Integrals (n, K) of the basis over polygons as seen from 0, above their planes.

    corners : (n, k, 3), counter-clockwise as seen from 0.
    """
    # The farthest corner sets the scale: squares of 1e-200 are no harm
    r = corners / np.max(np.abs(corners), axis=(1, 2), keepdims=True)
    e = np.roll(r, -1, axis=1) - r
    normal = np.cross(r, e)
    length = np.linalg.norm(normal, axis=-1)
    angle = np.arctan2(length, np.sum(r * (r + e), axis=-1))
    normal = normal / np.where(length > 0, length, 1.0)[..., None]
    start = r / np.linalg.norm(r, axis=-1, keepdims=True)
    side = np.cross(normal, start)
    nodes = _nodes_of(angle.max(axis=1), l_max, precision)

    def along(part: NDArray[np.int64], count: int) -> tuple[Array, Array]:
        x, w = _gauss(count)
        turn = (0.5 * angle[part])[..., None] * (1 + x)
        d = np.cos(turn)[..., None] * start[part][:, :, None]
        d = d + np.sin(turn)[..., None] * side[part][:, :, None]
        share = ((0.5 * angle[part])[..., None] * w)[..., None]
        vectors = share * normal[part][:, :, None]
        return d.reshape(len(part), -1, 3), vectors.reshape(len(part), -1, 3)

    found = -_contour(nodes, along, l_max)
    found[:, 0] = polygon_solid_angle(np.zeros(3), r) / np.sqrt(4 * np.pi)
    size = np.max(np.linalg.norm(r - r[:, :1], axis=-1), axis=-1)
    far = np.flatnonzero(size < FAR * np.linalg.norm(r[:, 0], axis=-1))
    if len(far):
        found[far] = _far_polygon(r[far], l_max)
    return found


def disc_integral(
    centre: Array, axis: Array, radius: Array, l_max: int, precision: float = PRECISION
) -> Array:
    """Integrals (n, K) of the basis over discs as seen from 0, in front of them.

    centre, axis : (n, 3), axis unit, `centre . axis < 0`.  radius : (n,) > 0.
    """
    scale = np.max(np.abs(centre), axis=-1) + radius
    c, R = centre / scale[:, None], radius / scale
    height = -np.sum(c * axis, axis=-1)
    across = -(c + height[:, None] * axis)
    flat = np.linalg.norm(across, axis=-1)
    # From where the rim is nearest
    a, b = orthonormal_basis(axis)
    a = np.where(flat[:, None] > 1e-9, across / np.maximum(flat, 1e-9)[:, None], a)
    b = np.cross(axis, a)
    # |r|^2 = |c|^2 + R^2 - 2 R flat cos t has its zero at cosh s
    over = (height**2 + (flat - R) ** 2) / (2 * R * np.maximum(flat, 1e-30))
    s = np.log1p(over + np.sqrt(over * (over + 2)))
    # tan(t / 2) = k tan(turn / 2) puts points where it is near, and moves s to its root
    k = np.sqrt(np.tanh(0.5 * np.maximum(s, 1e-9)))
    pole = 2 * np.arctanh(np.minimum(k, 1 - 1e-9))
    points = 2 * l_max + (4 - np.log(precision)) / pole
    nodes = 2 ** np.ceil(np.log2(np.clip(points, 8, MOST))).astype(np.int64)

    def along(part: NDArray[np.int64], count: int) -> tuple[Array, Array]:
        turn = np.pi * (np.arange(count) + 0.5) / count
        cosine, sine = np.cos(turn), k[part][:, None] * np.sin(turn)
        below = cosine**2 + sine**2
        u, v = a[part][:, None], b[part][:, None]
        x, y = ((cosine**2 - sine**2) / below)[..., None], (2 * cosine * sine / below)[..., None]
        wide = R[part][:, None, None]
        r = c[part][:, None] + wide * (x * u + y * v)
        dr = wide * (x * v - y * u) * (k[part][:, None] / below)[..., None]
        square = np.sum(r * r, axis=-1, keepdims=True)
        return r / np.sqrt(square), np.cross(r, dr) / square * (2 * np.pi / count)

    found = -_contour(nodes, along, l_max)
    solid = disc_solid_angle(np.zeros(3), c, axis, R)
    found[:, 0] = solid / np.sqrt(4 * np.pi)
    far = np.flatnonzero(R < FAR / 100)
    if len(far):
        # (l R)^2 / 4 off: less than what the outline has lost
        found[far] = evaluate(c[far], l_max) * solid[far][:, None]
    return found


def _contour(
    nodes: NDArray[np.int64],
    along: Callable[[NDArray[np.int64], int], tuple[Array, Array]],
    l_max: int,
) -> Array:
    """Sums (n, K) of the slope over l (l + 1) along outlines, those of equal nodes at once."""
    K = (l_max + 1) ** 2
    band = band_of(l_max)
    found = np.zeros((len(nodes), K))
    for count in np.unique(nodes):
        chosen = np.flatnonzero(nodes == count)
        step = max(1, BLOCK // (K * int(count)))
        for first in range(0, len(chosen), step):
            part = chosen[first : first + step]
            directions, vectors = along(part, int(count))
            found[part] = np.sum(slope(directions, vectors, l_max), axis=1)
    return np.asarray(found / np.maximum(band * (band + 1), 1))


@cache
def _gauss(count: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss on [-1, 1]: numpy solves for them anew each time."""
    x, w = np.polynomial.legendre.leggauss(count)
    return x, w


def _nodes_of(angle: Array, l_max: int, precision: float) -> NDArray[np.int64]:
    """Nodes for edges of at most such angles (n,), by the bound of the module's head."""
    nodes = np.full(angle.shape, 2 * l_max + 16)
    for count in range(2 * l_max + 16, 1, -1):
        rest = 4 * lgamma(count + 1) - log(2 * count + 1) - 3 * lgamma(2 * count + 1)
        reach = np.exp((log(precision) - rest) / (2 * count)) / max(l_max, 1)
        nodes = np.where(angle <= reach, count, nodes)
    return nodes


def _far_polygon(r: Array, l_max: int) -> Array:
    """Integrals over small polygons: Radon's points on the fan of triangles about a corner."""
    found = np.zeros((len(r), (l_max + 1) ** 2))
    for i in range(1, r.shape[1] - 1):
        b, c = r[:, i] - r[:, 0], r[:, i + 1] - r[:, 0]
        area = 0.5 * np.cross(b, c)
        for weight, p, q in RADON:
            d = r[:, 0] + p * b + q * c
            share = weight * np.sum(area * d, axis=-1) / np.sum(d * d, axis=-1) ** 1.5
            found -= share[:, None] * evaluate(d, l_max)
    return found
