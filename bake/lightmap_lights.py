"""The scene's own lights on texels of cubes: suns, spheres, discs and polygons, by shadow rays.

Each light has as many rays as go along the cosine, spread as `bake.reference_lights` spreads them:
over the cone or solid angle that it fills, a disc over its area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake.lightmap_surface import Surface
from bake.reference_lights import BallSampler, DiscSampler, Sampler, SunSampler
from bake.reference_polygons import PolygonSampler
from formats.errors import InputError
from formats.voxel_state import Place
from formats.voxels import Voxels

Array = NDArray[np.float64]
Float = NDArray[np.float32]

KINDS = ("sun", "sphere", "disc", "polygon")
NEAR = 1 - 2e-5
"""Share of the way to a light that nothing may block."""


@dataclass(frozen=True)
class Lamp:
    """A light at one moment. kind : of `KINDS`.  strength : irradiance of a sun, else radiance.
    place : the middle, metres, or the direction to a sun, unit.  radius : metres, of a sun radians.
    axis : unit, where flat lights face.  corners : of a polygon, metres.  horizon : what of a sun
    is below a ground's horizon does not shine."""

    kind: str
    strength: Place
    place: Place = (0.0, 0.0, 0.0)
    radius: float = 0.0
    axis: Place = (0.0, 1.0, 0.0)
    corners: tuple[Place, ...] = ()
    two_sided: bool = False
    horizon: bool = False

    def check(self) -> None:
        """Raise InputError where numbers are not finite, or a size is below 0."""
        places = np.asarray([self.strength, self.place, self.axis, *self.corners], np.float64)
        if not np.isfinite(places).all() or not 0 <= self.radius < np.inf:
            found = [*places.ravel().tolist(), self.radius]
            raise InputError("lightmap", f"light ({self.kind})", found, "give finite numbers")


class LampRays:
    """The lights of a world as its texels meet them."""

    def __init__(self, lamps: tuple[Lamp, ...], surface: Surface, voxels: Voxels) -> None:
        self._scene = surface.scene
        for lamp in lamps:
            lamp.check()
        origin, size = np.asarray(voxels.origin), voxels.cell_size
        self._lights = [
            sampler(lamp, origin, size) for lamp in lamps if np.any(np.asarray(lamp.strength) > 0)
        ]

    def __len__(self) -> int:
        return len(self._lights)

    def irradiance(self, starts: Float, face: int, number: int, u: Array) -> Array:
        """Return what rays (n,) to light `number` bring, (n, 3), all to faces that look one way.

        starts : (n, 3), unit space of the surface.  u : (n, 2) in [0, 1).
        """
        scene = self._scene
        cells = starts.astype(np.float64) / scene.scale + scene.centre
        found = self._lights[number].sample(cells, u)
        rise = found.direction[:, face // 2] * (-1 if face % 2 else 1)
        light = np.maximum(rise, 0.0)[:, None] * found.weight
        up = np.flatnonzero(light.any(axis=1))
        towards = np.ascontiguousarray(found.direction[up], np.float32)
        if found.distance is None:
            hidden = scene.occluded(starts[up], towards, finite=True)
        else:
            hits = scene.intersect(starts[up], towards, finite=True)
            reach = found.distance[up] * scene.scale * NEAR
            hidden = (hits.face >= 0) & (hits.distance < reach)
        light[up[hidden]] = 0.0
        return np.asarray(light)


def sampler(lamp: Lamp, origin: Array, cell_size: float) -> Sampler:
    """Return what samples a light, in cells. Raises ValueError for a kind that is none."""
    strength = np.asarray(lamp.strength, np.float64)
    axis = np.asarray(lamp.axis, np.float64)
    if lamp.kind == "sun":
        return SunSampler(np.asarray(lamp.place), strength, lamp.radius, lamp.horizon)
    if lamp.kind == "polygon":
        corners = (np.asarray(lamp.corners) - origin) / cell_size
        return PolygonSampler(corners, axis, strength, lamp.two_sided)
    middle, radius = (np.asarray(lamp.place) - origin) / cell_size, lamp.radius / cell_size
    if lamp.kind == "sphere":
        return BallSampler(middle, radius, strength)
    if lamp.kind == "disc":
        return DiscSampler(middle, axis, radius, strength, lamp.two_sided)
    raise ValueError(f"A light is one of {', '.join(KINDS)}, not {lamp.kind}.")
