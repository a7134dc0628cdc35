"""Environment maps for lighting: coefficients of the sprites, ambient of the ground; no draw.

Reads and writes no target.
"""

from __future__ import annotations

from typing import Any

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
        player.sprite_lighting.take(self.maps)

    def ambient(self, lights: Any) -> Any:
        """Irradiance (3,) of all maps on a level plane."""
        return lighting.ambient(self._from_above, lights.environments)

    def draw(self, time: float) -> None:
        """Nothing: the maps only light."""
