"""All lights around points as spherical harmonics of radiance, in the axes of the world."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from maths import spherical_lights
from maths.spherical_harmonics import turn_zonal
from maths.spherical_projection import cap_factors
from maths.spherical_rotation import rotate
from maths.transforms import rotation
from runtime.lighting import Lights, PolygonState

Array = NDArray[np.float64]

PRECISION = 1e-3
"""Error that a flat light may have, as a share of area / distance^2: it costs a third or less."""


class LightsAtPoints:
    """Projects every light at points; keeps the harmonics of the environments.

    maps : number among the scene's lights -> lat-long radiance (h, w, 3).  l_max : highest band.
    """

    def __init__(self, maps: dict[int, NDArray[np.floating]], l_max: int) -> None:
        self.l_max = l_max
        self._maps = {
            index: spherical_lights.project_environment(radiance, l_max)
            for index, radiance in maps.items()
        }

    def project(self, lights: Lights, points: Array) -> Array:
        """Coefficients of radiance (n, K, 3), world axes, at points (n, 3) metres."""
        l_max = self.l_max
        shared = np.zeros(((l_max + 1) ** 2, 3))
        if lights.suns:
            directions = np.stack([sun.to_light for sun in lights.suns])
            irradiance = np.stack([sun.irradiance for sun in lights.suns])
            cosine = np.cos([sun.radius for sun in lights.suns])
            zonal = cap_factors(cosine, l_max) / np.pi
            shared += turn_zonal(zonal, directions).T @ irradiance
        for state in lights.environments:
            if state.index in self._maps:
                turned = rotate(self._maps[state.index], rotation("y", state.rotate))
                shared += turned * state.factor
        found = np.repeat(shared[None], len(points), axis=0)
        if lights.spheres:
            found += self._spheres(lights, points)
        if lights.discs:
            found += self._discs(lights, points)
        for count in {len(polygon.corners) for polygon in lights.polygons}:
            alike = [polygon for polygon in lights.polygons if len(polygon.corners) == count]
            found += self._polygons(alike, points)
        return found

    def _spheres(self, lights: Lights, points: Array) -> Array:
        """Sum over balls: colour enters by one product, not ball by ball."""
        centres = np.stack([ball.position for ball in lights.spheres])
        radii = np.array([ball.radius for ball in lights.spheres])
        radiance = np.stack([ball.radiance for ball in lights.spheres])
        shape = spherical_lights.project_sphere(
            points[:, None], centres, radii, np.ones(1), self.l_max
        )
        return np.asarray(np.swapaxes(shape[..., 0], 1, 2) @ radiance)

    def _discs(self, lights: Lights, points: Array) -> Array:
        shape = spherical_lights.project_disc(
            points[:, None],
            np.stack([disc.position for disc in lights.discs]),
            np.stack([disc.axis for disc in lights.discs]),
            np.array([disc.radius for disc in lights.discs]),
            np.ones(1),
            self.l_max,
            two_sided=np.array([disc.two_sided for disc in lights.discs]),
            precision=PRECISION,
        )
        radiance = np.stack([disc.radiance for disc in lights.discs])
        return np.asarray(np.swapaxes(shape[..., 0], 1, 2) @ radiance)

    def _polygons(self, alike: Sequence[PolygonState], points: Array) -> Array:
        """Sum over polygons of equally many corners."""
        shape = spherical_lights.project_polygon(
            points[:, None],
            np.stack([polygon.corners for polygon in alike]),
            np.ones(1),
            self.l_max,
            two_sided=np.array([polygon.two_sided for polygon in alike]),
            precision=PRECISION,
        )
        radiance = np.stack([polygon.radiance for polygon in alike])
        return np.asarray(np.swapaxes(shape[..., 0], 1, 2) @ radiance)
