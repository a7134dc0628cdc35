"""All light that reaches points: the scene's lights, and what a world of cubes sends there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.light_harmonics import LightsAtPoints

Array = NDArray[np.float64]


class Incident:
    """Light of one player as harmonics up to a band. l_max : highest band."""

    def __init__(self, player: Any, l_max: int) -> None:
        self._player, self.l_max = player, l_max
        self._probe = player.passes.get("probe")
        environment = player.passes.get("environment")
        # Cubes may hide the environment: the probe looks past them
        seen = environment is not None and self._probe is None
        self._lights = LightsAtPoints(environment.maps if seen else {}, l_max)

    def project(self, points: Array, time: float) -> Array:
        """Return coefficients of radiance (n, K, 3), world axes, at points (n, 3), metres."""
        lights = self._player.lights
        if self._probe is None:
            return self._lights.project(lights, points)
        # Only worlds of cubes need it
        from runtime import light_sights

        found: Array = self._probe.project(points, self.l_max, time)
        seen = self._probe.around(points, time).lights
        for number, one in enumerate(light_sights.one_by_one(lights)):
            found += seen[:, number, None, None] * self._lights.project(one, points)
        return found
