"""Lamps to coefficients: suns, spheres and environments, on the ring of a sprite and off it.

Directions are in the sprite's frame: +x right, +y up, +z towards the viewer. A direction at sine s
from the ring's axis, where the ring has s0 = cos(elevation), counts `g^h B_k(t)`, g = min(1, s /
s0), h the harmonic. With `u + i v = exp(i t) g` that is the real and imaginary part of `(u + i
v)^h`: no angle is ever taken, and a direction on the axis, where t has no value, is no special
case.

References
----------
Evans 2004, Making Pretty Pictures with D3D (lights as coefficients: cost does not depend on their
number).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.circular_basis import harmonic_of
from maths.sampling import sphere_quadrature
from maths.transforms import latlong_direction, latlong_solid_angles, normalise

Array = NDArray[np.float64]

GRAZING = 0.1  # sine over the plane of a one-sided set under which a sun fades out

# (right, left, along): components that make cos t, sin t and the cosine from the axis
RING_AXES: dict[str, Callable[[Array], tuple[Array, Array, Array]]] = {
    "view": lambda d: (d[..., 0], d[..., 1], d[..., 2]),
    "up": lambda d: (d[..., 0], -d[..., 2], d[..., 1]),
}
BLOCK = 1 << 18  # texels at once: 10 MB of basis for five terms


def ring_coordinates(
    directions: ArrayLike, axis: str = "view"
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Azimuth t on the ring, sine s from its axis, and whether the direction is in front.

    directions : (..., 3) towards the light, any non-zero length.  axis : "view" (+z, t from +x to
        +y) or "up" (+y, t = atan2(-z, x)).
    Returns t (...) in [-pi, pi], 0 on the axis; s (...) in [0, 1]; front (...), not below the plane
    through the ring's centre. Raises ValueError for zero and NaN directions and for other axes.

    >>> t, s, front = ring_coordinates([0.0, 0.6, -0.8], "view")
    >>> float(t / np.pi), round(float(s), 12), bool(front)
    (0.5, 0.6, False)
    """
    right, left, along = _components(normalise(directions), axis)
    return np.arctan2(left + 0.0, right + 0.0), np.minimum(np.hypot(right, left), 1.0), along >= 0


def ring_direction(t: ArrayLike, axis: str = "view", elevation: float = 0.0) -> Array:
    """Unit direction (..., 3) of azimuth t on the ring at `elevation` over its plane, both radians.

    >>> ring_direction(np.pi / 2, "up").round(12).tolist()
    [0.0, 0.0, -1.0]
    """
    c, s = np.cos(np.asarray(t, np.float64)), np.sin(np.asarray(t, np.float64))
    flat, along = np.cos(elevation), np.full_like(c, np.sin(elevation))
    if axis not in RING_AXES:
        raise ValueError("The axis of a ring is view or up.")
    return np.stack(
        [flat * c, flat * s, along] if axis == "view" else [flat * c, along, -flat * s], -1
    )


def evaluate_direction(
    directions: ArrayLike,
    terms: int,
    *,
    axis: str = "view",
    elevation: float = 0.0,
    one_sided: bool = False,
) -> Array:
    """Coefficients of unit irradiance from directions: `g^h B_k(t)`, 0 behind a one-sided set.

    directions : (..., 3) towards the light, non-zero.  terms : K, odd.  elevation : of the ring,
        radians, |elevation| < pi / 2.  one_sided : lights with z < 0 give 0 (axis "view" only).
    Returns (..., K). Raises ValueError for a ring or directions that are none.

    >>> (evaluate_direction([0.0, 0.0, 1.0], 5) > 0).tolist()  # on the axis: only the constant
    [True, False, False, False, False]
    """
    order = int(harmonic_of(terms)[-1])
    s0 = float(np.cos(elevation))
    if not s0 > 1e-9:
        raise ValueError("The elevation of a ring is under 90 degrees.")
    if one_sided and axis != "view":
        raise ValueError("Only a ring around the view can be one-sided.")
    right, left, along = _components(normalise(directions), axis)
    # First harmonic with its gain, then powers of it
    first = (right + 1j * left) / np.maximum(np.hypot(right, left), s0)
    weights = np.empty((*right.shape, terms))
    weights[..., 0] = 1.0 / np.sqrt(2.0 * np.pi)
    power = np.full_like(first, 1.0 / np.sqrt(np.pi))
    for h in range(1, order + 1):
        power = power * first
        weights[..., 2 * h - 1], weights[..., 2 * h] = power.imag, power.real
    return weights * (along >= 0)[..., None] if one_sided else weights


def project_sun(
    direction: ArrayLike,
    irradiance: ArrayLike,
    terms: int,
    *,
    axis: str = "view",
    elevation: float = 0.0,
    one_sided: bool = False,
) -> Array:
    """Coefficients of a light from one direction: `E g^h B_k(t)`.

    direction : (..., 3) towards the light, sprite's frame.  irradiance : (..., 3) perpendicular to
    it. Others as `evaluate_direction`. Returns (..., K, 3).
    A sun sets behind a one-sided set over the last `GRAZING` of z: a sprite that turns away from it
    darkens within 6 degrees instead of going out from one frame to the next. Spheres and
    environments do so by their own extent.
    """
    weights = evaluate_direction(
        direction, terms, axis=axis, elevation=elevation, one_sided=one_sided
    )
    if one_sided:
        z = normalise(direction)[..., 2]
        weights = weights * np.clip(z / GRAZING, 0.0, 1.0)[..., None]
    return np.asarray(weights[..., :, None] * np.asarray(irradiance, np.float64)[..., None, :])


def project_sphere(
    position: ArrayLike,
    radius: ArrayLike,
    radiance: ArrayLike,
    terms: int,
    *,
    axis: str = "view",
    elevation: float = 0.0,
    one_sided: bool = False,
    nodes: tuple[int, int] = (8, 8),
) -> Array:
    """Coefficients of a glowing sphere: its radiance times the integral of `g^h B_k` over its cap.

    position : (..., 3) centre relative to the sprite, sprite's frame, metres.  radius : (...)
        metres, > 0.
    radiance : (..., 3).  nodes : strips of the cap, and azimuths on each.
    Closer than its radius the sphere is all around. Returns (..., K, 3).
    Raises ValueError for a radius that is none.

    >>> L = project_sphere([0.0, 0.0, 2.0], 1.0, [1.0, 1.0, 1.0], 1)  # cap of 30 degrees
    >>> bool(np.isclose(L[0, 0] * np.sqrt(2 * np.pi), 2 * np.pi * (1 - np.cos(np.pi / 6))))
    True
    """
    if one_sided and axis != "view":
        raise ValueError("Only a ring around the view can be one-sided.")
    directions, share = sphere_quadrature(position, radius, nodes, above=one_sided)
    weights = evaluate_direction(directions, terms, axis=axis, elevation=elevation)
    mean = np.einsum("...nk,...n->...k", weights, share)
    return np.asarray(mean[..., :, None] * np.asarray(radiance, np.float64)[..., None, :])


def project_environment(
    radiance: ArrayLike,
    terms: int,
    *,
    axis: str = "view",
    elevation: float = 0.0,
    one_sided: bool = False,
    yaw: ArrayLike = 0.0,
) -> Array:
    """Coefficients of a lat-long map: the integral of radiance times `g^h B_k` over its texels.

    radiance : (h, w, 3), lat-long as `transforms.latlong_direction`.  yaw : (...) radians by which
        the sprite's frame is turned about +y in the map's world (positive turns its +z towards +x).
    Others as `evaluate_direction`. Returns (..., K, 3). Raises ValueError for another shape.

    >>> L = project_environment(np.ones((8, 16, 3)), 3)
    >>> bool(np.allclose(L[:, 0], [4 * np.pi / np.sqrt(2 * np.pi), 0, 0]))
    True
    """
    image = np.asarray(radiance)
    if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise ValueError(f"An environment is an array (h, w, 3), not {image.shape}.")
    height, width, _ = image.shape
    yaws = np.asarray(yaw, np.float64)
    solid_angles = latlong_solid_angles(height, width)
    u = (np.arange(width) + 0.5) / width
    answer = np.zeros((yaws.size, terms, 3))
    rows = max(1, BLOCK // width)
    for top in range(0, height, rows):
        v = (np.arange(top, min(top + rows, height)) + 0.5) / height
        power = (
            image[top : top + rows].astype(np.float64) * solid_angles[top : top + rows, None, None]
        )
        for i, angle in enumerate(yaws.ravel()):
            # Turning the sprite by yaw moves the map to longer u
            uv = np.stack(np.meshgrid(u + angle / (2.0 * np.pi), v), axis=-1)
            weights = evaluate_direction(
                latlong_direction(uv), terms, axis=axis, elevation=elevation, one_sided=one_sided
            )
            answer[i] += weights.reshape(-1, terms).T @ power.reshape(-1, 3)
    return answer.reshape(*yaws.shape, terms, 3)


def _components(unit: Array, axis: str) -> tuple[Array, Array, Array]:
    if axis not in RING_AXES:
        raise ValueError("The axis of a ring is view or up.")
    return RING_AXES[axis](unit)
