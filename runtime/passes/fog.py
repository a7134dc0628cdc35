"""Fog over what is opaque; the billboard pass applies the same function to each sprite.

The sky drowns at the horizon only, by design: an endless uniform fog would leave no sky at all, so
towards the sky it counts as a layer that clears within a few degrees. Reads depth, writes colour.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from runtime import reuse
from runtime.shader import SCREEN, set_uniforms

HERE = Path(__file__).parent
RISE = float(
    np.sin(np.radians(3.0))
)  # elevation at which a uniform fog lets 1 - 1/e of the sky through


class Pass:
    """Lays fog between the camera and the opaque picture."""

    reads = ("depth",)
    writes = ("colour",)

    def __init__(self, player: Any) -> None:
        self._player = player
        self._array = player.vertex_array(player.programs.get(SCREEN, HERE / "fog.frag"))

    @property
    def _fog(self) -> Any:
        return self._player.scene.picture.fog

    def uniforms(self, time: float) -> dict[str, Any]:
        """The fog of `time` seconds, as the sprites' shader calls it."""
        return {
            "fog_radiance": tuple(self._fog.radiance.at(time)),
            "extinction": 0.0 if "fog" in self._player.off else self._fog.extinction.at(time),
            "falloff": self._fog.falloff,
            "fog_base": 0.0,
        }

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        return reuse.camera(self._player.view), reuse.frozen(self.uniforms(time))

    def draw(self, time: float) -> None:
        """Draw the fog of `time` seconds."""
        player = self._player
        values = {
            **player.view.uniforms(player.targets.size),
            **self.uniforms(time),
            "rise": RISE,
            "opaque_depth": 0,
        }
        set_uniforms(self._array.program, values)
        player.targets.texture("depth").use(0)
        player.targets.target("colour").use()
        player.ctx.enable_only(moderngl.BLEND)
        player.ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        player.targets.draw(self._array, mode=moderngl.TRIANGLES, vertices=3)
