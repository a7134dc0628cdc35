"""Environment maps for lighting: coefficients of the sprites, ambient of the ground; no draw.

Reads and writes no target.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np

from formats.environment import Environment
from runtime import lighting


class Pass:
    """Loads the maps that the scene's environment lights name."""

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def __init__(self, player: Any) -> None:
        maps = {
            index: Environment.load(folder).radiance
            for index, folder in player.folders("environment").items()
        }
        self.maps = {int(index): radiance for index, radiance in maps.items()}
        self._from_above = {
            index: lighting.irradiance_from_above(radiance) for index, radiance in self.maps.items()
        }
        self._harmonics: dict[int, Any] = {}
        player.sprite_lighting.take(self.maps)

    def ambient(self, lights: Any) -> Any:
        """Irradiance (3,) of all maps on a level plane."""
        return lighting.ambient(self._from_above, lights.environments)

    def irradiance_harmonics(self, lights: Any) -> Any:
        """Harmonics (9, 3) of the irradiance of all maps, for any normal."""
        from maths import environment_irradiance
        from maths.spherical_rotation import rotate
        from maths.transforms import rotation

        found = np.zeros((9, 3))
        for state in lights.environments:
            if state.index not in self.maps:
                continue
            if state.index not in self._harmonics:
                even = environment_irradiance.irradiance_harmonics(self.maps[state.index])
                self._harmonics[state.index] = rotate(even, rotation("y", state.rotate))
            found += self._harmonics[state.index] * state.factor
        return found

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        return ()

    def draw(self, time: float) -> None:
        """Nothing: the maps only light."""
