"""An endless level ground under every light, with the sprites' shadows and contact.

Writes shade, colour and depth; reads nothing. Shadows take the sun's share only, so they keep the
colour of the sky.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from runtime import light_uniforms, reuse
from runtime.ground_shadows import GroundShadows
from runtime.shader import SCREEN, set_uniforms

HERE = Path(__file__).parent


class Pass:
    """Draws the plane y = height."""

    reads: tuple[str, ...] = ()
    writes = ("colour", "depth")
    opaque = True

    def __init__(self, player: Any) -> None:
        self._player = player
        # Drawn sharp where the gather blurs all that is opaque
        self._lens = "depth_of_field" in player.called and "defocus" not in player.called
        defines = {
            **light_uniforms.counts(player.scene),
            "LENS": self._lens,
        }
        self._array = player.vertex_array(
            player.programs.get(SCREEN, HERE / "ground.frag", defines, {})
        )
        self._shadows = GroundShadows(player, self._lens)

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        view, lights = self._player.view, self._player.lights
        return reuse.camera(view, self._lens), reuse.frozen(lights)

    def draw(self, time: float) -> None:
        """Draw the ground of `time` seconds."""
        player, ground = self._player, self._player.scene.ground
        lens = player.passes["depth_of_field"].uniforms(player.view) if self._lens else {}
        self._shadows.draw(ground.height, lens)
        values = {
            **player.view.uniforms(player.targets.size),
            **lens,
            **self._lights(),
            "height": ground.height,
            "albedo": tuple(ground.albedo),
            "accent": tuple(ground.accent),
            "scale": ground.scale,
            "shade": 0,
        }
        set_uniforms(self._array.program, values)
        player.targets.texture("shade").use(0)
        player.targets.opaque().use()
        player.ctx.enable_only(moderngl.DEPTH_TEST)
        player.ctx.depth_func = "<="
        player.targets.draw(self._array, mode=moderngl.TRIANGLES, vertices=3)

    def _lights(self) -> dict[str, Any]:
        lights, passes = self._player.lights, self._player.passes
        ambient = passes["environment"].ambient(lights) if "environment" in passes else np.zeros(3)
        return {"ambient": tuple(ambient), **light_uniforms.of(lights)}
