"""How a volume of occlusion harmonics is looked up: twins of runtime/glsl/occlusion.glsl.

p is a point of the caster's object frame, where the mesh's bounding box is +-1/2 and the volume +-1
(see `formats.occlusion`). Outside the volume its edge is taken, along the ray from the middle, and
thinned as the solid angle of a disc that fills the bounding box's own ball.

A surface of normal n loses `int L cos+ O / int L cos+` of its light. With the clamped cosine cut
after band 2, `sum_j A_j Y_j(n) Y_j(d)`, both are nine numbers of the light: `sum_j Y_j(n) P_j . O`,
P_j the harmonics of `A_j Y_j L`, and `sum_j Y_j(n) A_j L_j`. Without a normal, n = 0, only the
first is left of either: the share `L . O / L . U` of all light.

References
----------
Ramamoorthi, Hanrahan 2001, An Efficient Representation for Irradiance Environment Maps.
Evans 2006, Fast Approximations for Global Illumination on Dynamic Scenes, SIGGRAPH course on
Advanced Real-Time Rendering in 3D Graphics and Games (deferred shadows from a volume of harmonics,
two candidate points of light).
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.spherical_harmonics import band_of, l_max_of
from maths.spherical_projection import cosine_factors, product_matrix

Array = NDArray[np.float64]

LOBES = 9
"""Numbers of a normal: the bands of the clamped cosine that count."""
FAINT = 1.0 / 32.0
"""Least light of a receiver, of the light from all directions together, that it can lose some of.
The cut cosine reaches that .14 behind the horizon, where there is nothing left to lose."""


def occlusion_place(p: ArrayLike) -> Array:
    """Texture coordinates (..., 3) in [0, 1] of points p (..., 3): `0.5 + 0.5 p / max(1, |p|)`.

    >>> occlusion_place([[0.0, 0.5, -1.0], [4.0, 2.0, 0.0]]).tolist()
    [[0.5, 0.75, 0.0], [1.0, 0.75, 0.5]]
    """
    p = np.asarray(p, np.float64)
    return np.asarray(0.5 + 0.5 * p / outside(p)[..., None])


def occlusion_warp(place: ArrayLike, k: float) -> Array:
    """Texture coordinates (..., 3) in [0, 1] of a volume that is finer in its middle.

    Per axis, `q (1 + k) / (1 + k |q|)` of q = 2 place - 1: 1 + k times as fine in the middle as
    without, 1 / (1 + k) at the edge, where k = 0 changes nothing.

    >>> occlusion_warp([0.0, 0.25, 0.5, 1.0], 0.5).tolist()
    [0.0, 0.2, 0.5, 1.0]
    """
    q = 2.0 * np.asarray(place, np.float64) - 1.0
    return np.asarray(0.5 + 0.5 * q * (1.0 + k) / (1.0 + k * np.abs(q)))


def occlusion_unwarp(place: ArrayLike, k: float) -> Array:
    """Inverse of `occlusion_warp`.

    >>> occlusion_unwarp([0.0, 0.2, 0.5, 1.0], 0.5).tolist()
    [0.0, 0.25, 0.5, 1.0]
    """
    q = 2.0 * np.asarray(place, np.float64) - 1.0
    return np.asarray(0.5 + 0.5 * q / (1.0 + k - k * np.abs(q)))


def outside(p: ArrayLike) -> Array:
    """How many times farther than the volume's edge points p (..., 3) lie, 1 inside. Returns (...).

    >>> outside([[0.0, 0.5, -1.0], [4.0, 2.0, 0.0]]).tolist()
    [1.0, 4.0]
    """
    return np.asarray(np.maximum(1.0, np.max(np.abs(np.asarray(p, np.float64)), axis=-1)))


def disc_share(distance: ArrayLike, radius: ArrayLike) -> Array:
    """Solid angle (...) over 2 pi of a disc seen along its axis: `1 - r / sqrt(r^2 + R^2)`.

    distance, radius : (...) >= 0, not both 0. Without what cancels far away.

    >>> disc_share([0.0, 1.0], 1.0).round(6).tolist()
    [1.0, 0.292893]
    """
    r, R = np.asarray(distance, np.float64), np.asarray(radius, np.float64)
    far = np.hypot(r, R)
    return np.asarray(R * R / (far * (far + r)))


def disc_distance(share: ArrayLike, radius: ArrayLike) -> Array:
    """Distance (...) at which `disc_share` is a share (...) of (0, 1].

    >>> bool(np.isclose(disc_share(disc_distance(0.01, 2.0), 2.0), 0.01))
    True
    """
    t, R = np.asarray(share, np.float64), np.asarray(radius, np.float64)
    return np.asarray(R * (1.0 - t) / np.sqrt(t * (2.0 - t)))


def occlusion_falloff(p: ArrayLike, extent: ArrayLike) -> Array:
    """Factor (...) in (0, 1] of what the volume's edge hides, at points p (..., 3).

    extent : (3,) half of the volume, metres of the mesh: twice the half-extent of its bounding box.
    1 inside.

    >>> occlusion_falloff([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [2.0, 2.0, 2.0]).round(4).tolist()
    [1.0, 0.3373]
    """
    p, extent = np.asarray(p, np.float64), np.asarray(extent, np.float64)
    radius = 0.5 * np.linalg.norm(extent)
    distance = np.linalg.norm(p * extent, axis=-1)
    edge = distance / outside(p)
    return np.asarray(disc_share(distance, radius) / disc_share(edge, radius))


def receiver_lobe(normal: ArrayLike) -> Array:
    """Harmonics Y_j (..., 9) of unit normals (..., 3), bands 0 to 2; of 0 only the first is left.

    >>> (receiver_lobe([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])[:, [0, 2, 6]]).round(4).tolist()
    [[0.2821, 0.4886, 0.6308], [0.2821, 0.0, 0.0]]
    """
    x, y, z = np.moveaxis(np.asarray(normal, np.float64), -1, 0)
    one, two = np.sqrt(3 / (4 * np.pi)), np.sqrt(15 / (4 * np.pi))
    zonal = np.sqrt(5 / (16 * np.pi)) * (2 * z * z - x * x - y * y)
    lobe = [np.full_like(x, np.sqrt(1 / (4 * np.pi))), one * y, one * z, one * x]
    lobe += [two * x * y, two * y * z, zonal, two * x * z, 0.5 * two * (x * x - y * y)]
    return np.stack(lobe, axis=-1)


def receiver_share(hidden: ArrayLike, facing: ArrayLike) -> Array:
    """Share (...) in [0, 1] of its light that a receiver keeps.

    hidden, facing : (...) `int L cos+ O` and `int L cos+`, over the light of all directions. All is
    kept where it faces less than FAINT.

    >>> receiver_share([0.1, 0.3, 0.1], [0.4, 0.2, 0.01]).tolist()
    [0.75, 0.0, 1.0]
    """
    N, D = np.asarray(hidden, np.float64), np.asarray(facing, np.float64)
    lit = D > FAINT
    return np.clip(1.0 - np.where(lit, N, 0.0) / np.where(lit, D, 1.0), 0.0, 1.0)


def receiver_products(light: ArrayLike, l_max: int) -> Array:
    """Harmonics P_j (..., 9, K, C) up to l_max of lights times each harmonic of the cosine.

    light : (..., K', C) radiance; exact where it has bands up to l_max + 2.
    """
    L = np.asarray(light, np.float64)
    matrix = _products(L.shape[-2], l_max)
    found = matrix.reshape(-1, L.shape[-2]) @ L
    return np.asarray(found.reshape(*L.shape[:-2], LOBES, -1, L.shape[-1]))


def receiver_facing(light: ArrayLike) -> Array:
    """Numbers A_j L_j (..., 9, C) of lights (..., K', C): with `receiver_lobe` irradiance.

    >>> L = np.zeros((9, 1)); L[0] = np.sqrt(4 * np.pi)  # radiance 1 all around
    >>> (receiver_lobe([0.0, 0.6, 0.8]) @ receiver_facing(L) / np.pi).round(12).tolist()
    [1.0]
    """
    L = np.asarray(light, np.float64)
    return np.asarray(_cosine()[:, None] * L[..., :LOBES, :])


@cache
def _products(count: int, l_max: int) -> Array:
    """Matrix (9, K, count) from a light to the harmonics of its products."""
    matrix = product_matrix(np.diag(_cosine()), l_max_of(count), l_max)
    matrix.flags.writeable = False
    return matrix


def _cosine() -> Array:
    return np.asarray(cosine_factors(2)[band_of(2)])
