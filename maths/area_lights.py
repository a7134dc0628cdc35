"""Irradiance from lights of uniform radiance, in closed form, whatever lies below the horizon cut
off.

Every function takes `point` and unit `normal` (..., 3), and a radiance that is a number (returns
(...)) or (..., c) with channels in its last axis (returns (..., c)), in W/m^2 for W/(m^2 sr).
Nothing blocks the light: visibility is the caller's. Discs and polygons are in modules of their
own, and come with this one.

References
----------
Snyder 1996, Area Light Sources for Real-Time Graphics, MSR-TR-96-11 (sphere across the horizon).
Lagarde, de Rousiers 2014, Moving Frostbite to Physically Based Rendering, 4.7.2 (the same, listed).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.disc_lights import disc_irradiance, disc_solid_angle
from maths.polygon_lights import (
    polygon_irradiance,
    polygon_solid_angle,
    rectangle_corners,
    rectangle_irradiance,
)

__all__ = [
    "cap_cosine",
    "disc_irradiance",
    "disc_solid_angle",
    "polygon_irradiance",
    "polygon_solid_angle",
    "rectangle_corners",
    "rectangle_irradiance",
    "sphere_irradiance",
    "sphere_solid_angle",
    "sun_irradiance",
]

Array = NDArray[np.float64]

SERIES = 0.3
"""Below this t, t - atan(t) comes from its series: 14 terms leave .3^28 / 31 < 1e-16."""
TERMS = 14


def sun_irradiance(
    normal: ArrayLike, to_light: ArrayLike, irradiance: ArrayLike, angular_radius: ArrayLike = 0.0
) -> Array:
    """Irradiance from a distant disc of light, cut off by the horizon while it sets.

    normal, to_light : (..., 3) unit.  irradiance : a number or (..., c), of a surface that faces
    the light.  angular_radius : (...) radians in [0, pi / 2]; 0 gives `E max(0, n . l)`.
    Returns (...) or (..., c). Raises ValueError for directions and angles that are none.

    >>> float(sun_irradiance([0.0, 1.0, 0.0], [0.0, 0.6, 0.8], 2.0))
    1.2
    """
    radius = np.asarray(angular_radius, np.float64)
    if not (np.all(np.isfinite(to_light)) and np.all((radius >= 0) & (radius <= np.pi / 2))):
        raise ValueError("A sun has a finite direction and an angular radius of 0 to pi / 2.")
    cosine = np.sum(np.asarray(normal, np.float64) * np.asarray(to_light, np.float64), axis=-1)
    return _scaled(cap_cosine(cosine, np.sin(radius), np.cos(radius)), irradiance)


def sphere_irradiance(
    point: ArrayLike, normal: ArrayLike, centre: ArrayLike, radius: ArrayLike, radiance: ArrayLike
) -> Array:
    """Irradiance from a glowing ball: `pi L (R / D)^2 cos` above the horizon, exact across it.

    point, normal, centre : (..., 3), metres; normal unit.  radius : (...) metres; 0 or less gives
    no light.  radiance : a number or (..., c). A point inside has light all around, pi L.
    Returns (...) or (..., c). Raises ValueError for a place or a radius that is not finite.

    >>> float(sphere_irradiance([0.0, 0, 0], [0, 1.0, 0], [0.0, 2, 0], 1.0, 4.0) / np.pi)
    1.0
    """
    offset = np.asarray(centre, np.float64) - np.asarray(point, np.float64)
    R = np.maximum(np.asarray(radius, np.float64), 0.0)
    if not (np.all(np.isfinite(centre)) and np.all(np.isfinite(R))):
        raise ValueError("A sphere light has a finite place and a finite radius.")
    distance = np.sqrt(np.sum(offset * offset, axis=-1))
    inside = distance < R
    D = np.where(inside | (distance == 0), 1.0, distance)
    sine = np.where(inside, 0.0, R / D)
    rise = np.sqrt(np.maximum(0.0, (1.0 - sine) * (1.0 + sine)))
    cosine = np.sum(np.asarray(normal, np.float64) * offset, axis=-1) / D
    outside = np.pi * sine * sine * cap_cosine(cosine, sine, rise)
    return _scaled(np.where(inside, np.pi, outside), radiance)


def cap_cosine(cosine: ArrayLike, sine: ArrayLike, rise: ArrayLike) -> Array:
    """Mean of the clamped cosine over a cap, per projected area: irradiance / (pi L sin^2).

    cosine : (...) of the angle between normal and cap's axis.  sine, rise : (...) sine and cosine
    of the cap's half-angle, up to a hemisphere. Returns (...) in [0, 1].

    Snyder's formula is `s^2 c acos(y) + atan(q s / C) - C s q`. Its last terms cancel to order s^3,
    so atan(t) is taken as t - (t - atan(t)) here, and what is left is free of s^2.
    """
    c, s, C = np.broadcast_arrays(*(np.asarray(x, np.float64) for x in (cosine, sine, rise)))
    partly = np.abs(c) < s
    safe = np.where(partly, s, 1.0)
    k = np.where(partly, c / safe, 0.0)
    q = np.sqrt((1.0 - k) * (1.0 + k))
    t = q * safe / np.where(C > 0, C, 1.0)
    near = (t < SERIES) & (C > 0)
    # (t - atan t) / s^2, from Horner's series where t is small
    square, total = np.where(near, t * t, 0.0), np.zeros_like(t)
    for n in range(TERMS - 1, -1, -1):
        total = (-1.0) ** n / (2 * n + 3) + square * total
    q_rise = q / np.where(C > 0, C, 1.0)
    small = safe * q_rise - np.where(near, t * q_rise * q_rise, 0.0) * total
    large = (np.arctan2(q * safe, C) - C * safe * q) / (safe * safe)
    crossing = c * np.arctan2(q, -C * k) + np.where(near, small, large)
    found = np.where(partly, np.clip(crossing / np.pi, 0.0, 1.0), np.maximum(0.0, c))
    return np.asarray(found)


def sphere_solid_angle(point: ArrayLike, centre: ArrayLike, radius: ArrayLike) -> Array:
    """Solid angle of a ball, `2 pi (1 - cos)`; 4 pi from inside. Returns (...) steradians.

    >>> float(sphere_solid_angle([0.0, 0, 0], [0.0, 0, 1], 1.0) / np.pi)
    2.0
    """
    offset = np.asarray(centre, np.float64) - np.asarray(point, np.float64)
    distance = np.sqrt(np.sum(offset * offset, axis=-1))
    R = np.maximum(np.asarray(radius, np.float64), 0.0)
    inside = distance < R
    sine = np.where(inside, 0.0, R / np.where(inside | (distance == 0), 1.0, distance))
    rise = np.sqrt(np.maximum(0.0, (1.0 - sine) * (1.0 + sine)))
    return np.where(inside, 4.0 * np.pi, 2.0 * np.pi * sine * sine / (1.0 + rise))


def _scaled(factor: Array, radiance: ArrayLike) -> Array:
    L = np.asarray(radiance, np.float64)
    return np.asarray(factor * L if L.ndim == 0 else factor[..., None] * L)
