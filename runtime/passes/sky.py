"""A gradient sky with the first sun's glow, behind what is opaque. Reads depth, writes colour."""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from runtime import reuse
from runtime.shader import SCREEN, set_uniforms

HERE = Path(__file__).parent
DISC = 2.0  # radiance of the disc over its glow: more makes hard specks between leaves


class Pass:
    """Fills the picture wherever no opaque thing stands."""

    reads = ("depth",)
    writes = ("colour",)
    opaque = True

    def __init__(self, player: Any) -> None:
        self._player = player
        self._glow = self._sky.glow is not None and any(
            light.type == "sun" for light in player.scene.lights
        )
        self._array = player.vertex_array(
            player.programs.get(SCREEN, HERE / "sky.frag", {"GLOW": self._glow}, {})
        )

    @property
    def _sky(self) -> Any:
        return self._player.scene.picture.sky

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        player = self._player
        return reuse.camera(player.view), reuse.frozen(self._look(time))

    def draw(self, time: float) -> None:
        """Draw the sky of `time` seconds."""
        player = self._player
        values = {**player.view.uniforms(player.targets.size), **self._look(time)}
        set_uniforms(self._array.program, values)
        player.targets.opaque().use()
        # The screen triangle lies at infinity: only untouched depth lets it through
        player.ctx.enable_only(moderngl.DEPTH_TEST)
        player.ctx.depth_func = "<="
        player.targets.draw(self._array, mode=moderngl.TRIANGLES, vertices=3)

    def _look(self, time: float) -> dict[str, Any]:
        """Uniforms of gradient and glow at `time` seconds."""
        values: dict[str, Any] = {
            "zenith": tuple(self._sky.zenith.at(time)),
            "horizon": tuple(self._sky.horizon.at(time)),
        }
        if self._glow:
            sun = self._player.lights.suns[0]
            values |= {
                "glow": tuple(self._sky.glow.at(time)),
                "to_sun": tuple(sun.to_light),
                "sun_radius": max(sun.radius, np.radians(0.53) / 2),
                "disc": DISC,
            }
        return values
