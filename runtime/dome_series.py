"""How sprites under a dome count light; imported only where a scene has such a set."""

from __future__ import annotations

from math import isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maths import hemispherical_lights

Array = NDArray[np.float64]


class DomeSeries:
    """Hemispherical harmonics, and the colours by which the channels of one dome count.

    The members are those of `lighting.RingSeries`. asset : formats.dome.Dome.
    """

    turns = False

    def __init__(self, asset: Any) -> None:
        self._bands = isqrt(asset.components.shape[1])
        self.rows = asset.channels
        self.length = self._bands**2
        self.key: tuple[Any, ...] = ("dome", self._bands)
        self.mirror = hemispherical_lights.mirror_signs(self._bands)
        self.constants = asset.constants

    def sun(self, direction: Array, irradiance: Array) -> Array:
        """Series (K, 3) of a sun towards `direction`, sprite's frame."""
        return hemispherical_lights.project_sun(direction, irradiance, self._bands)

    def sphere(self, offsets: Array, radius: float, radiance: Array) -> Array:
        """Series (n, K, 3) of a ball whose centre is at `offsets` (n, 3) from the sprites."""
        return hemispherical_lights.project_sphere(offsets, radius, radiance, self._bands)

    def environment(self, radiance: Array, yaw: float) -> Array:
        """Series (K, 3) of a lat-long map seen by a sprite turned by `yaw`."""
        return hemispherical_lights.project_environment(radiance, self._bands, yaw=yaw)

    def directions(self, directions: Array) -> Array:
        """Series (..., K) of radiance 1 W/(m2 sr) a steradian from unit directions (..., 3)."""
        return hemispherical_lights.evaluate_direction(directions, self._bands) / np.pi
