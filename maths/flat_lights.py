"""Flat lights as handfuls of suns: what projections on harmonics take, whatever the harmonics.

A disc or polygon becomes quadrature points on its area; seen from a place, each is a sun of
perpendicular irradiance `L A cos / r^2`. For closed forms of irradiance see maths.area_lights: a
projection on harmonics has none, and its weights are smooth, so few points do.

References
----------
Radon 1948, Zur mechanischen Kubatur (seven points of a triangle, exact to degree 5).
Peirce 1957, Numerical Integration over the Planar Annulus (disc).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

NEAREST = 0.25
"""Distance, as a share of the square root of a point's area, under which it comes no nearer: what
an eighth of a light's side would add there is not seen from the middle of a sprite."""

_A, _B = (6 - np.sqrt(15)) / 21, (6 + np.sqrt(15)) / 21
_W = np.array([9 / 40, *[(155 - np.sqrt(15)) / 1200] * 3, *[(155 + np.sqrt(15)) / 1200] * 3])
_BARYCENTRIC = np.array(
    [
        [1 / 3, 1 / 3, 1 / 3],
        [1 - 2 * _A, _A, _A],
        [_A, 1 - 2 * _A, _A],
        [_A, _A, 1 - 2 * _A],
        [1 - 2 * _B, _B, _B],
        [_B, 1 - 2 * _B, _B],
        [_B, _B, 1 - 2 * _B],
    ]
)


def polygon_points(corners: ArrayLike, parts: int = 2) -> tuple[Array, Array]:
    """Quadrature points of a convex polygon: exact for polynomials of degree 5 on each part.

    corners : (k, 3), k >= 3.  parts : each triangle of the fan about the middle is cut in parts^2.
    Returns points (m, 3) and areas (m,), m = 7 k parts^2. Raises ValueError for other shapes.

    >>> points, areas = polygon_points([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])
    >>> round(float(areas.sum()), 12), (areas @ points / 2).round(12).tolist()
    (2.0, [1.0, 0.5, 0.0])
    """
    outline = np.asarray(corners, np.float64)
    if outline.ndim != 2 or outline.shape[1] != 3 or len(outline) < 3 or parts < 1:
        raise ValueError("A polygon is a list of three or more corners (x, y, z).")
    middle = np.broadcast_to(outline.mean(axis=0), outline.shape)
    fan = np.stack([middle, outline, np.roll(outline, -1, axis=0)], axis=1)
    small = np.einsum("pij,fjx->fpix", _cuts(parts), fan).reshape(-1, 3, 3)
    sides = small[:, 1:] - small[:, :1]
    areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1)
    points = np.einsum("qi,tix->tqx", _BARYCENTRIC, small)
    return points.reshape(-1, 3), (areas[:, None] * _W).ravel()


def disc_points(
    centre: ArrayLike, axis: ArrayLike, radius: float, nodes: tuple[int, int] = (4, 12)
) -> tuple[Array, Array]:
    """Quadrature points of a disc: Gauss in the squared radius, even steps around.

    centre : (3,).  axis : (3,) unit, perpendicular to it.  nodes : rings, points on each. Returns
    points (m, 3) and areas (m,). Raises ValueError for a radius that is none.
    """
    if not (radius > 0 and np.isfinite(radius)):
        raise ValueError("A disc has a radius above 0.")
    normal = np.asarray(axis, np.float64)
    across = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
    across /= np.linalg.norm(across)
    up = np.cross(normal, across)
    x, w = np.polynomial.legendre.leggauss(nodes[0])
    # Turn every other ring by half a step
    turn = 2 * np.pi * (np.arange(nodes[1]) + 0.5 * (np.arange(nodes[0])[:, None] % 2)) / nodes[1]
    r = radius * np.sqrt(0.5 * (1 + x))[:, None]
    flat = (r * np.cos(turn))[..., None] * across + (r * np.sin(turn))[..., None] * up
    areas = np.repeat(0.5 * w * np.pi * radius**2 / nodes[1], nodes[1])
    return np.asarray(centre, np.float64) + flat.reshape(-1, 3), areas


def as_suns(
    places: ArrayLike,
    points: ArrayLike,
    areas: ArrayLike,
    axis: ArrayLike,
    radiance: ArrayLike,
    *,
    two_sided: bool = False,
) -> tuple[Array, Array]:
    """Directions and perpendicular irradiance of a flat light's points as seen from places.

    places : (..., 3) metres.  points, areas : (m, 3), (m,) of `polygon_points` or `disc_points`.
    axis : (3,) unit, which its front faces.  radiance : (3,) W/(m2 sr). Behind a one-sided light
    there is none. Returns directions (..., m, 3) unit and irradiance (..., m, 3) W/m2.
    """
    offset = np.asarray(points, np.float64) - np.asarray(places, np.float64)[..., None, :]
    area, normal = np.asarray(areas, np.float64), np.asarray(axis, np.float64)
    least = NEAREST * np.sqrt(area)
    distance = np.linalg.norm(offset, axis=-1)
    # A place on a point of the light sees it straight ahead
    towards = np.where(distance[..., None] > 0, offset, -normal)
    towards = towards / np.where(distance > 0, distance, 1.0)[..., None]
    cosine = -(towards @ normal)
    seen = np.abs(cosine) if two_sided else np.maximum(cosine, 0.0)
    # No finite area subtends more than the half-space: bound each point's own solid angle
    solid = np.minimum(area * seen / np.maximum(distance, least) ** 2, 2 * np.pi)
    return towards, solid[..., None] * np.asarray(radiance, np.float64)


def _cuts(parts: int) -> Array:
    """Barycentric corners (parts^2, 3, 3) of a triangle cut into equal ones."""
    found = []
    for i in range(parts):
        for j in range(parts - i):
            k = parts - 1 - i - j
            found.append([(i + 1, j, k), (i, j + 1, k), (i, j, k + 1)])
            if k > 0:
                # The one that stands on its head between this and the next two
                found.append([(i + 1, j + 1, k - 1), (i, j + 1, k), (i + 1, j, k)])
    return np.array(found, np.float64) / parts
