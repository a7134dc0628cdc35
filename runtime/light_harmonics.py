"""All lights around points as spherical harmonics of radiance, in the axes of the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from maths import spherical_lights
from maths.spherical_cubature import disc_patches, polygon_patches, total
from maths.spherical_harmonics import turn_zonal
from maths.spherical_projection import cap_factors
from maths.spherical_rotation import rotate
from maths.transforms import rotation
from runtime.lighting import Lights, PolygonState

Array = NDArray[np.float64]

PRECISION = 1e-3
"""Error that a flat light may have, as a share of area / distance^2."""


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
        """Sum over balls: colour enters by one product a band, not ball by ball."""
        shape = spherical_lights.project_sphere(
            points[:, None],
            _rows([ball.position for ball in lights.spheres]),
            np.array([ball.radius for ball in lights.spheres]),
            np.ones(1),
            self.l_max,
        )
        radiance = _rows([ball.radiance for ball in lights.spheres])
        return np.asarray(np.swapaxes(shape[..., 0], 1, 2) @ radiance)

    def _discs(self, lights: Lights, points: Array) -> Array:
        """Sum over discs: few points of those far enough, outlines of the rest."""
        centre, axis, radiance = (
            _rows([getattr(disc, name) for disc in lights.discs])
            for name in ("position", "axis", "radiance")
        )
        radius = np.array([disc.radius for disc in lights.discs])
        two_sided = np.array([disc.two_sided for disc in lights.discs])
        patches = disc_patches(centre, axis, radius, two_sided)
        found, near = total(points, patches, radiance, self.l_max, PRECISION)

        def exact(p: int, rest: NDArray[np.int64]) -> Array:
            place = points[p], centre[rest], axis[rest], radius[rest], np.ones(1), self.l_max
            return spherical_lights.project_disc(
                *place, two_sided=two_sided[rest], precision=PRECISION
            )

        return _add_rest(found, near, radiance, exact)

    def _polygons(self, alike: Sequence[PolygonState], points: Array) -> Array:
        """Sum over polygons of equally many corners, as `_discs`."""
        corners = _rows([polygon.corners for polygon in alike])
        radiance = _rows([polygon.radiance for polygon in alike])
        two_sided = np.array([polygon.two_sided for polygon in alike])
        patches = polygon_patches(corners, two_sided)
        found, near = total(points, patches, radiance, self.l_max, PRECISION)

        def exact(p: int, rest: NDArray[np.int64]) -> Array:
            place = points[p], corners[rest], np.ones(1), self.l_max
            return spherical_lights.project_polygon(
                *place, two_sided=two_sided[rest], precision=PRECISION
            )

        return _add_rest(found, near, radiance, exact)


def _add_rest(
    found: Array,
    near: NDArray[np.bool_],
    radiance: Array,
    exact: Callable[[int, NDArray[np.int64]], Array],
) -> Array:
    """Add to sums (p, K, c) what lights (p, n) too near for few points bring.

    exact : number of a point and of lights (m,) to their coefficients (m, K, 1).
    """
    for p in np.flatnonzero(near.any(axis=1)):
        rest = np.flatnonzero(near[p])
        found[p] += exact(int(p), rest)[..., 0].T @ radiance[rest]
    return found


def _rows(arrays: Sequence[Array]) -> Array:
    """Stack many small arrays of one shape: three times as fast as `np.stack`."""
    return np.concatenate(arrays).reshape(len(arrays), *arrays[0].shape)
