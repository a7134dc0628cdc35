"""What camera rays meet besides surfaces: sky, fog, and the mottling of the ground.

Twins of the functions of the same names in `runtime/glsl/sky.glsl`, `fog.glsl` and `mottle.glsl`,
in float64. The mottling is that of a point: no footprint is averaged over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.scene import Scene, Sun
from maths.noise import value_noise

Array = NDArray[np.float64]

DISC = 2.0
"""Radiance of the sun's disc in the sky over that of its glow, as the player draws it."""
RISE = float(np.sin(np.radians(3.0)))
"""Sine of the elevation at which a uniform fog lets 1 - 1/e of the sky through in the player."""
OCTAVES = 6
LEAST_SUN = float(np.radians(0.53) / 2)


@dataclass(frozen=True, eq=False)
class Air:
    """Sky and fog at one moment; radiances (3,), None for what the scene does not call for."""

    zenith: Array | None = None
    horizon: Array | None = None
    glow: Array | None = None
    to_sun: Array | None = None
    sun_radius: float = 0.0
    fog: Array | None = None
    extinction: float = 0.0
    falloff: float = 0.0

    def sky(self, directions: Array) -> Array:
        """Radiance (n, 3) of the sky along unit directions (n, 3); black without a sky."""
        if self.zenith is None or self.horizon is None:
            return np.zeros((len(directions), 3))
        radiance = sky_gradient(directions[:, 1], self.zenith, self.horizon)
        if self.glow is not None and self.to_sun is not None:
            shine = sky_glow(directions, self.to_sun)
            shine += DISC * sky_disc(directions, self.to_sun, self.sun_radius)
            radiance = radiance + shine[:, None] * self.glow
        return radiance

    def lay(self, radiance: Array, start: Array, directions: Array, distance: Array) -> Array:
        """Lay fog over radiance (n, 3) seen from start (n, 3) along unit directions (n, 3) at a
        distance (n,) in metres, infinite for the sky."""
        if self.fog is None:
            return radiance
        seen = np.isfinite(distance)
        passing = fog_sky(start[:, 1], directions[:, 1], self.extinction, self.falloff, RISE)
        rise = directions[seen, 1] * distance[seen]
        passing[seen] = fog_transmittance(
            start[seen, 1], rise, distance[seen], self.extinction, self.falloff
        )
        return np.asarray(radiance * passing[:, None] + self.fog * (1 - passing[:, None]))


def at(scene: Scene, time: float) -> Air:
    """Return the sky and the fog of a scene at `time` seconds."""
    sky, fog = scene.picture.sky, scene.picture.fog
    found: dict[str, Any] = {}
    if sky is not None:
        found |= {"zenith": _rgb(sky.zenith, time), "horizon": _rgb(sky.horizon, time)}
        sun = next((light for light in scene.lights if isinstance(light, Sun)), None)
        if sky.glow is not None and sun is not None:
            radius = max(np.radians(sun.angular_diameter) / 2, LEAST_SUN)
            found |= {"glow": _rgb(sky.glow, time), "to_sun": sun.direction(time)}
            found["sun_radius"] = float(radius)
    if fog is not None:
        found |= {"fog": _rgb(fog.radiance, time), "falloff": fog.falloff}
        found["extinction"] = float(fog.extinction.at(time))
    return Air(**found)


def _rgb(keyed: Any, time: float) -> Array:
    return np.asarray(keyed.at(time), np.float64)


def smoothstep(low: float, high: float, x: Array) -> Array:
    """Hermite step from 0 at `low` to 1 at `high`. x : (...)."""
    share = np.clip((x - low) / (high - low), 0, 1)
    return np.asarray(share * share * (3 - 2 * share))


def sky_gradient(sine: Array, zenith: Array, horizon: Array) -> Array:
    """Radiance (n, 3) by the sine (n,) of the elevation; zenith, horizon (3,)."""
    share = np.exp(-5.5 * np.maximum(sine, 0))[:, None]
    return np.asarray(zenith * (1 - share) + horizon * share)


def sky_glow(direction: Array, to_sun: Array) -> Array:
    """Glow (n,) about the sun, 1 at it. direction : (n, 3) unit. to_sun : (3,) unit."""
    near = 1 - direction @ to_sun
    rise = direction[:, 1] - to_sun[1]
    return np.asarray(0.45 * np.exp(-near / 0.006) + 0.55 * np.exp(-near / 0.16 - 40 * rise * rise))


def sky_disc(direction: Array, to_sun: Array, radius: float) -> Array:
    """Coverage (n,) of the sun's disc of `radius` radians, its limb softened."""
    half = 0.5 * np.linalg.norm(direction - to_sun, axis=1)
    return 1 - smoothstep(0.8 * radius, 1.2 * radius, 2 * np.arcsin(np.clip(half, 0, 1)))


def fog_transmittance(
    start: Array, rise: Array, distance: Array, extinction: float, falloff: float
) -> Array:
    """Share (n,) of light that passes a segment from height `start` (n,) that climbs `rise` (n,)
    over `distance` (n,), all metres; extinction and falloff in 1/m."""
    # Beyond +-80 nothing of it shows, and exp stays finite
    steep = np.clip(falloff * rise, -80, 80)
    level = np.abs(steep) < 1e-3
    safe = np.where(level, 1.0, steep)
    mean = np.where(level, 1 - 0.5 * steep, -np.expm1(-safe) / safe)
    depth = extinction * distance * np.exp(np.clip(-falloff * start, -80, 80)) * mean
    return np.exp(-np.minimum(depth, 80))


def fog_sky(start: Array, sine: Array, extinction: float, falloff: float, rise: float) -> Array:
    """Share (n,) of the sky's radiance that passes, by the sine (n,) of the elevation, seen from
    height `start` (n,) metres; a uniform fog counts as a layer seen over `rise`."""
    up = np.maximum(sine, 1e-4)
    if falloff <= 0:
        return 1 - np.exp(-up / rise) if extinction > 0 else np.ones_like(up)
    layer = extinction * np.exp(np.clip(-falloff * start, -80, 80)) / (falloff * up)
    return np.exp(-np.minimum(layer, 80))


def mottle(place: Array) -> Array:
    """Mix 0..1 (n,) of two colours at places (n, 2), in units of the mottling's size."""
    total, weight, amplitude, frequency = np.zeros(len(place)), 0.0, 1.0, 0.31
    for octave in range(OCTAVES):
        c, s = np.cos(2.39996323 * octave), np.sin(2.39996323 * octave)
        turned = place @ np.array([[c, s], [-s, c]]) * frequency
        total += amplitude * value_noise(turned, octave)
        weight += amplitude
        amplitude, frequency = amplitude * 0.62, frequency * 2.17
    return smoothstep(0.22, 0.78, total / weight)
