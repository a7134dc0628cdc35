"""Light of a world of cubes in which nothing changes, as it was baked; no draw.

Reads and writes no target.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import moderngl
import numpy as np

from runtime import cubes


class Pass:
    """Puts the lightmap on the card."""

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def __init__(self, player: Any) -> None:
        world = cubes.of(player)
        texels = np.minimum(world.baked.padded(), 65504.0).astype(np.float16)
        height, width = texels.shape[:2]
        made = player.ctx.texture((width, height), 4, texels, alignment=1, dtype="f2")
        made.filter = (moderngl.LINEAR, moderngl.LINEAR)
        made.repeat_x = made.repeat_y = False
        world.light = player.targets.adopt(made, texels.nbytes)

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        return ()

    def draw(self, time: float) -> None:
        """Nothing: the light stays."""
