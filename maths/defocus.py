"""The lens as a gather over a picture: signed radii of blur, and how a disc covers pixels.

Twins of the same names in `runtime/glsl/defocus.glsl`; radii are in pixels.

References
----------
Potmesil, Chakravarty 1981, A Lens and Aperture Camera Model for Synthetic Image Generation.
Jimenez 2014, Next Generation Post Processing in Call of Duty: Advanced Warfare (scatter as gather).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

SHARP = 0.25  # radius that changes nothing: a circle half a pixel across


def signed_radius(
    depth: ArrayLike, farthest: ArrayLike, focus_over_near: ArrayLike
) -> NDArray[np.float64]:
    """Radius of the circle of confusion, negative nearer than focus: `c (1 - d_f / d)`.

    depth : (...) of the window, 1 - near / d.  farthest : c, radius of what is at infinity, pixels.
    focus_over_near : d_f / near.  It is affine in the picture over any plane.

    >>> (signed_radius([1.0, 0.95, 0.9], 8.0, 20.0).round(9) + 0.0).tolist()
    [8.0, 0.0, -8.0]
    """
    nearness = 1.0 - np.asarray(depth, np.float64)
    return np.asarray(np.asarray(farthest) * (1.0 - np.asarray(focus_over_near) * nearness))


def kernel_radius(radius: ArrayLike) -> NDArray[np.float64]:
    """Radius of the soft disc over whole pixels that has the variance of a disc, `r^2 / 4` an axis.

    radius : (...) pixels, >= 0. At most SHARP gives 0.5, a disc that covers its own pixel only.

    >>> kernel_radius([0.0, 0.25]).tolist()
    [0.5, 0.5]
    """
    r = np.asarray(radius, np.float64)
    small = 0.5 + 0.316496581 * np.clip((r - SHARP) / (1.0 - SHARP), 0.0, 1.0) ** 2
    return np.asarray(np.where(r < 1.0, small, np.sqrt(np.maximum(r * r - 1.0 / 3.0, 0.0))))


def disc_share(distance: ArrayLike, radius: ArrayLike, texel: ArrayLike) -> NDArray[np.float64]:
    """Share of a disc's light that a pixel at `distance` from its middle gets, 1 / pixel^2.

    A disc whose rim is a ramp one texel wide, over its own area: it sums to 1 over the plane.
    distance : (...) >= 0.  radius : (...) >= texel / 2.  texel : (...) > 0.
    """
    k, h = np.asarray(radius, np.float64), np.asarray(texel, np.float64)
    inside = np.clip((k - np.asarray(distance)) / h + 0.5, 0.0, 1.0)
    return np.asarray(inside / (np.pi * (k * k + h * h / 12.0)))


def depth_of_radius(
    radius: ArrayLike, farthest: ArrayLike, focus_over_near: ArrayLike
) -> NDArray[np.float64]:
    """The window's depth (...) of a signed radius (...): the inverse of `signed_radius`.

    >>> depth_of_radius([8.0, 0.0, -8.0], 8.0, 20.0).tolist()
    [1.0, 0.95, 0.9]
    """
    nearness = np.maximum(1.0 - np.asarray(radius, np.float64) / np.asarray(farthest), 0.0)
    return np.asarray(1.0 - nearness / np.asarray(focus_over_near))


def layered(radius: ArrayLike) -> NDArray[np.float64]:
    """Share (...) of a blur of a radius (...) >= 0 that is gathered at half size: 0 to 2, 1 from 3.

    >>> layered([2.0, 2.5, 3.0]).tolist()
    [0.0, 0.5, 1.0]
    """
    return _smoothstep(np.asarray(radius, np.float64) - 2.0)


def behind(radius: ArrayLike, than: ArrayLike, distance: ArrayLike) -> NDArray[np.float64]:
    """How surely (...) a surface lies behind another `distance` pixels off, not on its slope.

    radius, than : signed radii (...), which grow with depth; a slope changes them by 0.1 a pixel.

    >>> behind(8.0, 0.0, 2.0).tolist()
    1.0
    """
    slack = 0.25 + 0.1 * np.asarray(distance, np.float64)
    return _smoothstep((np.asarray(radius) - np.asarray(than)) / slack - 1.0)


def _smoothstep(x: NDArray[np.float64]) -> NDArray[np.float64]:
    t = np.clip(x, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
