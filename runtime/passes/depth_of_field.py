"""The lens of the sprites: a coarser mip level for a wider circle of confusion.

This pass draws nothing itself; where it is called for, the billboard and ground passes compile with
LENS and take its uniforms. Reads and writes no target.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any


class Pass:
    """Hands the lens to whoever blurs by it."""

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def __init__(self, player: Any) -> None:
        self._targets = player.targets  # the camera of each frame carries the lens

    def uniforms(self, camera: Any) -> dict[str, float]:
        """The lens of one frame: f-number, distance of the plane of focus, half a pixel (m)."""
        half_pixel = 0.5 * camera.sensor_height / self._targets.size[1]
        return {
            "f_number": camera.f_number,
            "focus_distance": camera.focus_distance,
            "sharp": half_pixel,
        }

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        return ()

    def draw(self, time: float) -> None:
        """Nothing: sprites blur as they are drawn."""
