"""Lights of a scene as samplers: a direction towards each, and radiance over density along it.

Suns and balls are sampled over the cone that they fill, polygons over their solid angle, discs over
their area; environments and glowing triangles are in `bake.reference_emission`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bake import environment
from bake.reference_emission import EmitterSampler, EnvironmentSampler, Sample
from bake.reference_polygons import PolygonSampler
from bake.reference_world import World
from formats.lights import Disc, EnvironmentLight, Polygon, Rectangle, Sphere, Sun
from formats.scene import Scene
from maths.sampling import concentric_disc, orthonormal_basis, uniform_cone

Array = NDArray[np.float64]


class Sampler(Protocol):
    """A light at one moment."""

    def sample(self, points: Array, u: Array) -> Sample:
        """Sample light on points (n, 3) by random numbers u (n, 3), the first two well spread."""


@dataclass(frozen=True, eq=False)
class SunSampler:
    """A disc at infinity; what of it is below the horizon of the ground does not shine."""

    to_light: Array
    irradiance: Array
    radius: float
    horizon: bool

    def sample(self, points: Array, u: Array) -> Sample:
        """Sample the disc: a mean radiance of E / (pi sin^2) over the cone's solid angle."""
        cone = uniform_cone(u[:, :2], self.radius)
        a, b = orthonormal_basis(self.to_light)
        direction = cone @ np.stack([a, b, self.to_light])
        weight = np.tile(self.irradiance * 2 / (1 + np.cos(self.radius)), (len(points), 1))
        if self.horizon:
            weight[direction[:, 1] <= 0] = 0
        return Sample(direction, weight)


@dataclass(frozen=True, eq=False)
class BallSampler:
    """A ball; from inside, light from all around."""

    centre: Array
    radius: float
    radiance: Array

    def sample(self, points: Array, u: Array) -> Sample:
        """Sample the cone that the ball fills."""
        offset = self.centre - points
        distance = np.linalg.norm(offset, axis=1)
        inside = distance <= self.radius
        safe = np.where(distance > 0, distance, 1.0)
        axis = np.where((distance > 0)[:, None], offset / safe[:, None], [0.0, 1.0, 0.0])
        sine = np.where(inside, 1.0, self.radius / np.where(inside, 1.0, safe))
        angle = np.where(inside, np.pi, np.arcsin(sine))
        cone = uniform_cone(u[:, :2], angle)
        a, b = orthonormal_basis(axis)
        direction = cone[:, :1] * a + cone[:, 1:2] * b + cone[:, 2:] * axis
        along = distance * cone[:, 2]
        across = np.maximum(distance * distance - along * along, 0)
        entry = along - np.sqrt(np.maximum(self.radius**2 - across, 0))
        solid = 4 * np.pi * np.sin(angle / 2) ** 2
        reach = np.where(inside, 0.0, np.maximum(entry, 0))
        return Sample(direction, solid[:, None] * self.radiance, reach)


@dataclass(frozen=True, eq=False)
class DiscSampler:
    """A flat disc, sampled over its area. axis : (3,) unit, towards its front."""

    centre: Array
    axis: Array
    radius: float
    radiance: Array
    two_sided: bool

    def sample(self, points: Array, u: Array) -> Sample:
        """Sample a point of the disc: radiance times its solid angle per area, cos / d^2."""
        a, b = orthonormal_basis(self.axis)
        flat = self.radius * concentric_disc(u[:, :2])
        offset = self.centre + flat[:, :1] * a + flat[:, 1:2] * b - points
        distance = np.sqrt(np.maximum(np.einsum("ij,ij->i", offset, offset), 1e-60))
        direction = offset / distance[:, None]
        cosine = -(direction @ self.axis)
        cosine = np.abs(cosine) if self.two_sided else np.maximum(cosine, 0)
        weight = np.pi * self.radius**2 * cosine / distance**2
        return Sample(direction, weight[:, None] * self.radiance, distance)


@dataclass(frozen=True, eq=False)
class Lights:
    """Every light of a scene at one moment that shines at all."""

    plain: tuple[Sampler, ...]
    environments: tuple[EnvironmentSampler, ...] = ()
    emitters: EmitterSampler | None = None

    @property
    def all(self) -> tuple[Sampler, ...]:
        """All of them, in a fixed order."""
        found = (*self.plain, *self.environments)
        return found if self.emitters is None else (*found, self.emitters)


def at(scene: Scene, time: float, world: World, *, shadows: bool = True) -> Lights:
    """Return the lights of a scene at `time` seconds.

    shadows : without them glowing meshes light nothing else, as in the player. Raises InputError
    for an environment that cannot be read.
    """
    plain: list[Sampler] = []
    maps: list[EnvironmentSampler] = []
    for light in scene.lights:
        if isinstance(light, EnvironmentLight):
            radiance = environment.load(light.source) * light.factor(time)
            if radiance.any():
                maps.append(EnvironmentSampler.of_map(radiance, np.radians(light.rotate)))
            continue
        shine = light.irradiance if isinstance(light, Sun) else light.radiance
        strength = np.asarray(shine.at(time), np.float64)
        if strength.any():
            plain.append(_sampler(light, time, strength, scene.ground is not None))
    emitters = EmitterSampler(world) if shadows and world.glowing else None
    return Lights(tuple(plain), tuple(maps), emitters if emitters else None)


def _sampler(
    light: Sun | Sphere | Disc | Rectangle | Polygon, time: float, strength: Array, horizon: bool
) -> Sampler:
    if isinstance(light, Sun):
        radius = float(np.radians(light.angular_diameter) / 2)
        return SunSampler(light.direction(time), strength, radius, horizon)
    if isinstance(light, Sphere):
        return BallSampler(np.asarray(light.position.at(time)), light.radius, strength)
    if isinstance(light, Disc):
        centre = np.asarray(light.position.at(time), np.float64)
        return DiscSampler(centre, light.axis(time), light.radius, strength, light.two_sided)
    return PolygonSampler(light.corners(time), light.axis(time), strength, light.two_sided)
