"""How a volume of occlusion harmonics is looked up: twins of runtime/glsl/occlusion.glsl.

p is a point of the caster's object frame, where the mesh's bounding box is +-1/2 and the volume +-1
(see `formats.occlusion`). Outside the volume its edge is taken, along the ray from the middle, and
thinned as the solid angle of a disc that fills the bounding box's own ball.

References
----------
Evans 2006, Fast Approximations for Global Illumination on Dynamic Scenes, SIGGRAPH course on
Advanced Real-Time Rendering in 3D Graphics and Games (deferred shadows from a volume of harmonics,
two candidate points of light).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def occlusion_place(p: ArrayLike) -> Array:
    """Texture coordinates (..., 3) in [0, 1] of points p (..., 3): `0.5 + 0.5 p / max(1, |p|)`.

    >>> occlusion_place([[0.0, 0.5, -1.0], [4.0, 2.0, 0.0]]).tolist()
    [[0.5, 0.75, 0.0], [1.0, 0.75, 0.5]]
    """
    p = np.asarray(p, np.float64)
    return np.asarray(0.5 + 0.5 * p / outside(p)[..., None])


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
