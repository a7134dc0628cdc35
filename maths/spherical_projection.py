"""Functions on the sphere to coefficients: samples, maps, caps, the clamped cosine, products.

References
----------
Ramamoorthi, Hanrahan 2001, On the relationship between radiance and irradiance (clamped cosine).
Sloan, Kautz, Snyder 2002, Precomputed Radiance Transfer (products).
Atkinson, Han 2012, Spherical Harmonics and Approximations on the Unit Sphere, 5.2 (quadrature).
"""

from collections.abc import Callable
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.spherical_harmonics import band_of, evaluate, l_max_of, polynomials
from maths.spherical_rotation import rotate

Array = NDArray[np.float64]

UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Turns +z to +y, +x to +z and +y to +x."""


def quadrature(l_max: int) -> tuple[Array, Array]:
    """Directions (n, 3) and solid angles (n,) that integrate bands up to 2 l_max exactly.

    So they integrate products of two functions up to l_max: l_max + 1 nodes of Gauss in z by
    2 l_max + 1 azimuths, n = 28 for l_max = 3.
    """
    x, w = np.polynomial.legendre.leggauss(l_max + 1)
    count = 2 * l_max + 1
    turn = 2 * np.pi * (np.arange(count) + 0.5) / count
    ring = np.sqrt(1 - x * x)[:, None]
    z = np.broadcast_to(x[:, None], (len(x), count))
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=-1)
    return directions.reshape(-1, 3), np.repeat(w * 2 * np.pi / count, count)


def project_function(function: Callable[[Array], Array], l_max: int, degree: int) -> Array:
    """Coefficients (K, ...) of a function of directions, exact where it has no band over `degree`.

    function : directions (n, 3) to values (n, ...).
    """
    directions, area = quadrature((l_max + degree + 1) // 2)
    values = np.asarray(function(directions), np.float64)
    return np.tensordot((evaluate(directions, l_max) * area[:, None]).T, values, 1)


def project_samples(
    directions: ArrayLike,
    values: ArrayLike,
    l_max: int,
    *,
    solid_angles: ArrayLike | None = None,
    least_squares: bool = False,
) -> Array:
    """Coefficients (K, ...) from samples.

    directions : (N, 3) over the whole sphere.  values : (N, ...).  solid_angles : (N,) of each,
    4 pi / N if left out.  least_squares : solve for the best fit, weighted by them: halves the
    error of random directions, and changes nothing for evenly spread ones.
    Raises ValueError for fewer samples than coefficients.
    """
    basis = evaluate(np.asarray(directions, np.float64), l_max)
    x = np.asarray(values, np.float64)
    N, K = basis.shape
    if len(x) != N or N < K:
        raise ValueError(f"{K} coefficients need as many samples or more, with a value each.")
    area = np.broadcast_to(
        np.asarray(4 * np.pi / N if solid_angles is None else solid_angles, np.float64), (N,)
    )
    if not least_squares:
        return np.tensordot((basis * area[:, None]).T, x, 1)
    root = np.sqrt(area)[:, None]
    found, _, rank, _ = np.linalg.lstsq(root * basis, root * x.reshape(N, -1), rcond=None)
    if rank < K:
        raise ValueError("The directions of the samples do not determine all coefficients.")
    return np.asarray(found.reshape(K, *x.shape[1:]))


def gram_error(directions: ArrayLike, l_max: int) -> float:
    """Largest |G - I| of evenly weighted directions (N, 3): how far from orthonormal they see Y."""
    basis = evaluate(np.asarray(directions, np.float64), l_max)
    gram = basis.T @ basis * (4 * np.pi / len(basis))
    return float(np.abs(gram - np.eye(len(gram))).max())


def project_latlong(radiance: ArrayLike, l_max: int) -> Array:
    """Coefficients (K, c) of a lat-long map (h, w, c) of even texels, exact.

    About the map's own axis the integral over a texel is one over azimuth, of cos m t, times one
    over the row, a trigonometric polynomial of degree l + 1 that nodes of Gauss integrate to
    rounding; then the poles are turned from z to y. Raises ValueError for other shapes.
    """
    image = np.asarray(radiance)
    if image.ndim != 3 or image.size == 0:
        raise ValueError(f"A lat-long map is an array (h, w, channels), not {image.shape}.")
    h, w, channels = image.shape
    m = np.arange(1, l_max + 1)
    # In the frame of UPRIGHT's transpose the map's centre, -z, is -x: azimuth t runs from +x
    t = 2 * np.pi * np.arange(w + 1) / w
    # u grows to the map's +x, which is +y turned: t = pi + 2 pi (1/2 - u) = -2 pi u
    sines, cosines = np.sin(np.outer(t, m)) / m, np.cos(np.outer(t, m)) / m
    azimuth = np.concatenate(
        [np.full((w, 1), 2 * np.pi / w), np.diff(sines, axis=0), np.diff(cosines, axis=0)], axis=1
    )
    rows = np.einsum("hwc,wa->hac", image.astype(np.float64), azimuth, optimize=True)
    x, weight = np.polynomial.legendre.leggauss(8 + (l_max + 1) * 4 // h)
    q = np.pi * (np.arange(h)[:, None] + 0.5 * (1 + x)) / h
    area = 0.5 * np.pi / h * weight * np.sin(q)
    legendre = polynomials(np.cos(q), l_max)
    upright = np.zeros(((l_max + 1) ** 2, channels))
    for order, column in enumerate(legendre):
        ring = area * np.sin(q) ** order
        for band, polynomial in enumerate(column, order):
            share = np.sum(ring * polynomial, axis=1)
            centre = band * (band + 1)
            upright[centre + order] = share @ rows[:, order]
            if order:
                upright[centre - order] = share @ rows[:, l_max + order]
    return rotate(upright, UPRIGHT, axis=0)


def cap(half_angle: ArrayLike, l_max: int) -> Array:
    """Zonal coefficients (..., l_max + 1) of 1 within half_angle of +z: a round light or occluder.

    `z(0) = sqrt(pi) (1 - cos a)`, `z(l) = sqrt(pi / (2 l + 1)) (P(l - 1) - P(l + 1))(cos a)`,
    without what cancels in small caps.  half_angle : (...) radians in [0, pi].

    >>> cap(np.pi / 2, 3).round(5).tolist()  # a half-space
    [1.77245, 1.53499, 0.0, -0.58618]
    """
    a = np.asarray(half_angle, np.float64)
    if not np.all((a >= 0) & (a <= np.pi)):
        raise ValueError("The half-angle of a cap is 0 to pi.")
    # What a cap over half the sphere leaves is the other one, with odd bands turned
    wide = a > np.pi / 2
    small = np.where(wide, np.pi - a, a)
    found = cap_factors(np.cos(small), l_max) * np.square(np.sin(small))[..., None]
    other = -found * (-1.0) ** np.arange(l_max + 1)
    other[..., 0] += np.sqrt(4 * np.pi)
    return np.where(wide[..., None], other, found)


def cap_factors(cosine: ArrayLike, l_max: int) -> Array:
    """`cap` divided by sin^2 of its half-angle: finite for a single direction.

    With `(1 - x^2) P'(l) = l (l + 1) / (2 l + 1) (P(l - 1) - P(l + 1))` that is `sqrt(pi (2 l + 1))
    P'(l)(cos a) / (l (l + 1))`, and `sqrt(pi) / (1 + cos a)` for l = 0.  cosine : (...) in [0, 1].
    """
    c = np.asarray(cosine, np.float64)
    found = np.empty((*c.shape, l_max + 1))
    found[..., 0] = np.sqrt(np.pi) / (1 + c)
    before, P = np.ones_like(c), c
    slope_before, slope = np.zeros_like(c), np.ones_like(c)
    for band in range(1, l_max + 1):
        found[..., band] = np.sqrt(np.pi * (2 * band + 1)) / (band * (band + 1)) * slope
        slope_before, slope = slope, slope_before + (2 * band + 1) * P
        before, P = P, ((2 * band + 1) * c * P - band * before) / (band + 1)
    return found


def cosine_factors(l_max: int) -> Array:
    """Factors A_l (l_max + 1,) of the clamped cosine: irradiance is `A_l L(l, m)`.

    >>> (cosine_factors(4) / np.pi).round(6).tolist()
    [1.0, 0.666667, 0.25, 0.0, -0.041667]
    """
    found = np.zeros(l_max + 1)
    found[:2] = [np.pi, 2 * np.pi / 3][: l_max + 1]
    for band in range(2, l_max + 1, 2):
        half = band // 2
        central = factorial(band) / (2**band * factorial(half) ** 2)
        found[band] = 2 * np.pi * (-1) ** (half - 1) / ((band + 2) * (band - 1)) * central
    return found


def clamped_cosine(normals: ArrayLike, l_max: int) -> Array:
    """Coefficients (..., K) of max(0, n . d): their product with a light's sum is irradiance."""
    basis = evaluate(np.asarray(normals, np.float64), l_max)
    return np.asarray(cosine_factors(l_max)[band_of(l_max)] * basis)


def product_matrix(a: ArrayLike, l_max: int, out: int) -> Array:
    """Matrix (..., K_out, K) that multiplies functions of bands up to l_max by a (..., K_a).

    By quadrature that is exact for the three band limits.
    """
    factor = np.asarray(a, np.float64)
    own = l_max_of(factor.shape[-1])
    directions, area = quadrature((own + l_max + out + 1) // 2)
    values = factor @ evaluate(directions, own).T * area
    left, right = evaluate(directions, out), evaluate(directions, l_max)
    return np.asarray(left.T @ (values[..., None] * right))


def product(a: ArrayLike, b: ArrayLike, out: int) -> Array:
    """Coefficients (..., K_out) of the product of two functions (..., K_a) and (..., K_b), exact.

    Both bands add up: all of it needs `out` = l_max of a + l_max of b.
    """
    first, second = np.asarray(a, np.float64), np.asarray(b, np.float64)
    bands = l_max_of(first.shape[-1]), l_max_of(second.shape[-1])
    directions, area = quadrature((sum(bands) + out + 1) // 2)
    x, y = first @ evaluate(directions, bands[0]).T, second @ evaluate(directions, bands[1]).T
    return np.asarray((x * y * area) @ evaluate(directions, out))
