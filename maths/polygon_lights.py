"""Irradiance from a flat polygon of uniform radiance in closed form, cut off by the horizon.

Lambert's formula adds up the edges, `E = L / 2 sum angle(r_i, r_i+1) n . (r_i x r_i+1) / |...|`,
over the polygon clipped to the receiver's horizon. Angles are atan2 of cross and dot product. The
terms of a polygon seen from far away cancel but for size / distance of them, so below FAR the
clipped polygon is summed by Radon's rule of seven points a triangle instead.

References
----------
Lambert 1760, Photometria; Baum, Rushmeier, Winget 1989, Improving Radiosity Solutions Through the
    Use of Analytically Determined Form-Factors.
Van Oosterom, Strackee 1983, The Solid Angle of a Plane Triangle.
Radon 1948, Zur mechanischen Kubatur.
"""

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

TINY = 1e-150
FAR = 0.004
"""Size / distance below which Radon's rule, of error (FAR / 2)^6 = 6e-17, takes over."""

_A, _B = (6 - np.sqrt(15)) / 21, (6 + np.sqrt(15)) / 21
RADON = (
    (9 / 40, 1 / 3, 1 / 3),
    *(
        (float((155 - np.sqrt(15)) / 1200), *p)
        for p in ((_A, _A), (_A, 1 - 2 * _A), (1 - 2 * _A, _A))
    ),
    *(
        (float((155 + np.sqrt(15)) / 1200), *p)
        for p in ((_B, _B), (_B, 1 - 2 * _B), (1 - 2 * _B, _B))
    ),
)
"""Share of a triangle's area, and the coordinates of the point along two of its sides."""


def polygon_irradiance(
    point: ArrayLike,
    normal: ArrayLike,
    corners: ArrayLike,
    radiance: ArrayLike,
    *,
    two_sided: bool = False,
) -> Array:
    """Irradiance from a glowing polygon, convex or not, wherever it and the horizon are.

    point, normal : (..., 3), metres; normal unit.  corners : (..., k, 3), k >= 3, of one plane,
    counter-clockwise as seen from the front, which shines.  radiance : a number or (..., c).
    two_sided : the back shines too. Points in the polygon's own plane get nothing, and polygons
    without an area give nothing.
    Returns (...) or (..., c), W/m^2. Raises ValueError for fewer than three corners, or any not
    finite.

    >>> square = [[-1.0, 1, 1], [-1, 1, -1], [1, 1, -1], [1, 1, 1]]
    >>> E = polygon_irradiance([0.0, 0, 0], [0, 1.0, 0], square, 1.0, two_sided=True)
    >>> round(float(E / (4 * np.sqrt(0.5) * np.arctan(np.sqrt(0.5)))), 14)
    1.0
    """
    r0, q, area, height = _placed(point, corners)
    n = np.asarray(normal, np.float64)
    sign = np.where(height < 0, -1.0, 1.0) if two_sided else 1.0
    lit = sign * height > 0
    edges = list(_clipped(r0, q, n))
    near, far = np.zeros(lit.shape), np.zeros(lit.shape)
    first, last = edges[0][0], edges[-1][1]
    small = np.max(_square(q), axis=-1) < FAR * FAR
    for start, end in edges:
        # The way along the horizon from where the outline went under
        near = near + _chord(r0 + last, start - last, n) + _edge(r0 + start, end - start, n)
        last = end
        if np.any(small):
            far = far + _triangle(r0, first, start, end, n, area)
    if np.any(small):
        for (_, end), (start, _) in itertools.pairwise(edges):
            far = far + _triangle(r0, first, end, start, n, area)
    factor = np.where(small, height * far, -0.5 * near)
    return _scaled(np.where(lit, np.clip(sign * factor, 0.0, np.pi), 0.0), radiance)


def rectangle_corners(centre: ArrayLike, half_u: ArrayLike, half_v: ArrayLike) -> Array:
    """Corners (..., 4, 3) of a rectangle that shines along half_u x half_v; all arguments (..., 3).

    >>> rectangle_corners([0.0, 0, 0], [1.0, 0, 0], [0, 2.0, 0])[0].tolist()
    [-1.0, -2.0, 0.0]
    """
    c, u, v = (np.asarray(x, np.float64) for x in (centre, half_u, half_v))
    return np.stack([c - u - v, c + u - v, c + u + v, c - u + v], axis=-2)


def rectangle_irradiance(
    point: ArrayLike,
    normal: ArrayLike,
    centre: ArrayLike,
    half_u: ArrayLike,
    half_v: ArrayLike,
    radiance: ArrayLike,
    *,
    two_sided: bool = False,
) -> Array:
    """`polygon_irradiance` of the parallelogram `centre +- half_u +- half_v`, all (..., 3).

    It shines along half_u x half_v.
    """
    corners = rectangle_corners(centre, half_u, half_v)
    return polygon_irradiance(point, normal, corners, radiance, two_sided=two_sided)


def polygon_solid_angle(point: ArrayLike, corners: ArrayLike) -> Array:
    """Solid angle of a flat polygon, from either side. Returns (...) steradians; 0 in its plane.

    point : (..., 3).  corners : (..., k, 3), k >= 3. Raises ValueError for fewer corners.

    >>> cube = [[-1.0, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]
    >>> round(float(polygon_solid_angle([0.0, 0, 0], cube) / (4 * np.pi / 6)), 14)
    1.0
    """
    r0, q, _, height = _placed(point, corners)
    r = r0[..., None, :] + q
    length = np.sqrt(_square(r))
    total = np.zeros(height.shape)
    for i in range(1, q.shape[-2] - 1):
        a, b, c = r[..., 0, :], r[..., i, :], r[..., i + 1, :]
        la, lb, lc = length[..., 0], length[..., i], length[..., i + 1]
        triple = _dot(a, np.cross(q[..., i, :], q[..., i + 1, :]))
        below = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        total = total + 2.0 * np.arctan2(triple, below)
    return np.where(height == 0, 0.0, np.abs(total))


def _placed(point: ArrayLike, corners: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """First corner from the point, corners from it, front's unit vector, height; scaled."""
    outline, p = np.asarray(corners, np.float64), np.asarray(point, np.float64)
    if outline.ndim < 2 or outline.shape[-2] < 3 or not np.all(np.isfinite(outline)):
        raise ValueError("A polygon has three finite corners or more.")
    r0, q = outline[..., 0, :] - p, outline - outline[..., :1, :]
    size = np.sqrt(np.max(_square(q), axis=-1))
    scale = np.sqrt(_square(r0)) + size
    scale = np.where(scale > 0, scale, 1.0)
    # Newell's vector, of the area in units of size, which does not underflow
    unit = q / np.where(size > 0, size, 1.0)[..., None, None]
    area = 0.5 * np.sum(np.cross(unit, np.roll(unit, -1, axis=-2)), axis=-2)
    length = np.sqrt(_square(area))
    area = area / np.where(length > 0, length, 1.0)[..., None]
    r0 = r0 / scale[..., None]
    q = np.broadcast_to(q, (*np.broadcast_shapes(q.shape[:-2], scale.shape), *q.shape[-2:]))
    return r0, q / scale[..., None, None], area, np.asarray(-_dot(r0, area))


def _clipped(r0: Array, q: Array, n: Array) -> Iterator[tuple[Array, Array]]:
    """Ends of every edge's part above the horizon; one below ends where the last one did."""
    count = q.shape[-2]
    shape = np.broadcast_shapes(q.shape[:-2], n.shape[:-1])
    z = _dot(r0, n)[..., None] + np.sum(q * n[..., None, :], axis=-1)
    last = np.broadcast_to(q[..., 0, :], (*shape, 3))
    for i in range(2 * count):
        a, b = i % count, (i + 1) % count
        za, zb = z[..., a], z[..., b]
        cross = (za > 0) != (zb > 0)
        t = np.where(cross, za / np.where(cross, za - zb, 1.0), 0.0)[..., None]
        cut = q[..., a, :] + t * (q[..., b, :] - q[..., a, :])
        start = np.where(
            (za > 0)[..., None], q[..., a, :], np.where((zb > 0)[..., None], cut, last)
        )
        end = np.where((zb > 0)[..., None], q[..., b, :], np.where((za > 0)[..., None], cut, last))
        last = end
        # The first turn only finds where the last edge ends
        if i >= count:
            yield start, end


def _edge(r: Array, e: Array, n: Array) -> Array:
    """Angle of the edge from r to r + e, times the cosine of its plane's normal with n."""
    cross = np.cross(r, e)
    length = np.sqrt(_square(cross))
    angle = np.arctan2(length, _dot(r, r + e))
    return np.asarray(angle * _dot(cross, n) / np.where(length > 0, length, 1.0))


def _chord(r: Array, e: Array, n: Array) -> Array:
    """Signed angle of an edge in the plane of the horizon."""
    return np.asarray(np.arctan2(_dot(np.cross(r, e), n), _dot(r, r + e)))


def _triangle(r0: Array, a: Array, b: Array, c: Array, n: Array, area: Array) -> Array:
    """Integral of n . r / r^4 over a far triangle, of signed area about the polygon's front."""
    b, c = b - a, c - a
    total = np.zeros(np.broadcast_shapes(r0.shape[:-1], a.shape[:-1]))
    for weight, p, q in RADON:
        r = r0 + a + p * b + q * c
        total = total + weight * _dot(r, n) / np.maximum(_square(r) ** 2, TINY)
    return np.asarray(0.5 * total * _dot(np.cross(b, c), area))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1))


def _square(a: Array) -> Array:
    return np.asarray(np.sum(a * a, axis=-1))


def _scaled(factor: Array, radiance: ArrayLike) -> Array:
    L = np.asarray(radiance, np.float64)
    return np.asarray(factor * L if L.ndim == 0 else factor[..., None] * L)
