"""Directions towards lights for Monte Carlo integration, with their density per solid angle.

Each sampler takes u (..., 2) in [0, 1)^2 and returns directions (..., 3), unit, and the density
(...) that they were drawn with; 0 where the light cannot be seen. `L cos / density` is then an
estimate of the irradiance without the shadows.

References
----------
Ureña, Fajardo, King 2013, An Area-Preserving Parametrization for Spherical Rectangles, EGSR.
Pharr, Jakob, Humphreys 2023, Physically Based Rendering, 4th ed., 6.2.4 (sphere), A.5.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.sampling import concentric_disc, orthonormal_basis, uniform_cone

Array = NDArray[np.float64]

SMALL = 1e-3
"""Solid angle below which a rectangle is sampled by its area: the paper's angles cancel to
1e-16."""


def sample_sphere(
    point: ArrayLike, centre: ArrayLike, radius: ArrayLike, u: ArrayLike
) -> tuple[Array, Array]:
    """Directions spread evenly over a ball's solid angle; over all directions from inside it.

    point, centre : (..., 3), metres.  radius : (...).  u : (..., 2). Returns (..., 3), (...).
    """
    offset = np.asarray(centre, np.float64) - np.asarray(point, np.float64)
    R = np.asarray(radius, np.float64)
    distance = np.sqrt(np.sum(offset * offset, axis=-1))
    inside = distance <= R
    D = np.where(distance > 0, distance, 1.0)
    angle = np.where(inside, np.pi, np.arcsin(np.where(inside, 0.0, R / D)))
    axis = np.where((distance > 0)[..., None], offset / D[..., None], [0.0, 0.0, 1.0])
    local = uniform_cone(u, angle)
    a, b = orthonormal_basis(axis)
    found = local[..., :1] * a + local[..., 1:2] * b + local[..., 2:] * axis
    solid = 4.0 * np.pi * np.sin(0.5 * angle) ** 2
    return found, np.broadcast_to(_inverse(solid), found.shape[:-1])


def sample_disc(
    point: ArrayLike, centre: ArrayLike, axis: ArrayLike, radius: ArrayLike, u: ArrayLike
) -> tuple[Array, Array]:
    """Directions to points spread evenly over a disc's area, seen from either side.

    point, centre, axis : (..., 3), axis unit.  radius : (...).  u : (..., 2). Returns (..., 3),
    (...).
    """
    w, R = np.asarray(axis, np.float64), np.asarray(radius, np.float64)
    a, b = orthonormal_basis(w)
    spot = concentric_disc(u) * R[..., None]
    to = np.asarray(centre, np.float64) - np.asarray(point, np.float64)
    to = to + spot[..., :1] * a + spot[..., 1:] * b
    return _to_area(to, w, np.pi * R * R)


def sample_rectangle(
    point: ArrayLike, centre: ArrayLike, half_u: ArrayLike, half_v: ArrayLike, u: ArrayLike
) -> tuple[Array, Array]:
    """Directions spread evenly over the solid angle of `centre +- half_u +- half_v`, either side.

    point, centre, half_u, half_v : (..., 3), half_u at right angles to half_v.  u : (..., 2). Below
    a solid angle of SMALL points are spread over the area. Returns (..., 3), (...).
    """
    U, V = np.asarray(half_u, np.float64), np.asarray(half_v, np.float64)
    offset = np.asarray(centre, np.float64) - np.asarray(point, np.float64)
    uv = np.asarray(u, np.float64)
    width, height = (np.sqrt(np.sum(e * e, axis=-1)) for e in (U, V))
    x = U / np.where(width > 0, width, 1.0)[..., None]
    y = V / np.where(height > 0, height, 1.0)[..., None]
    axis = np.cross(x, y)
    side = np.where(np.sum(axis * offset, axis=-1) > 0, -1.0, 1.0)[..., None]
    z = axis * side
    middle = [np.sum(offset * e, axis=-1) for e in (x, y, z)]
    x0, x1 = middle[0] - width, middle[0] + width
    y0, y1 = middle[1] - height, middle[1] + height
    across, up, solid = _spread(x0, x1, y0, y1, middle[2], uv)
    by_area = solid < SMALL
    across = np.where(by_area, x0 + uv[..., 0] * (x1 - x0), across)
    up = np.where(by_area, y0 + uv[..., 1] * (y1 - y0), up)
    to = across[..., None] * x + up[..., None] * y + middle[2][..., None] * z
    found, density = _to_area(to, axis, 4.0 * width * height)
    return found, np.where(by_area, density, _inverse(solid))


def _spread(
    x0: Array, x1: Array, y0: Array, y1: Array, z: Array, u: Array
) -> tuple[Array, Array, Array]:
    """Ureña's map to places in the rectangle's frame, z < 0; and the solid angle."""
    depth = np.minimum(z, -1e-12 * (np.abs(x0) + np.abs(x1) + np.abs(y0) + np.abs(y1) + 1e-290))
    # z of the normals of the planes through the edges y0, x1, y1, x0
    n = [e / np.sqrt(depth**2 + e * e) for e in (-y0, x1, y1, -x0)]
    g = [np.arccos(np.clip(-n[i] * n[(i + 1) % 4], -1.0, 1.0)) for i in range(4)]
    solid = np.maximum(g[0] + g[1] + g[2] + g[3] - 2.0 * np.pi, 0.0)
    k = 2.0 * np.pi - g[2] - g[3]
    angle = u[..., 0] * solid + k
    sine = np.sin(angle)
    f = (np.cos(angle) * n[0] - n[2]) / np.where(np.abs(sine) > 1e-12, sine, 1e-12)
    c = np.clip(np.where(f > 0, 1.0, -1.0) / np.sqrt(np.maximum(f * f + n[0] ** 2, 1e-24)), -1, 1)
    across = -c * depth / np.sqrt(np.maximum(1.0 - c * c, 1e-24))
    across = np.clip(across, x0, x1)
    d = np.sqrt(across * across + depth * depth)
    h0, h1 = y0 / np.sqrt(d * d + y0 * y0), y1 / np.sqrt(d * d + y1 * y1)
    h = h0 + u[..., 1] * (h1 - h0)
    up = np.clip(h * d / np.sqrt(np.maximum(1.0 - h * h, 1e-24)), y0, y1)
    return across, up, solid


def _to_area(to: Array, axis: Array, area: Array) -> tuple[Array, Array]:
    """Unit directions, and the density of an even spread over an area."""
    squared = np.sum(to * to, axis=-1)
    length = np.sqrt(np.where(squared > 0, squared, 1.0))
    cosine = np.abs(np.sum(to * axis, axis=-1)) / length
    return to / length[..., None], squared * _inverse(cosine * area)


def _inverse(x: Array) -> Array:
    return np.where(x > 0, 1.0 / np.where(x > 0, x, 1.0), 0.0)
