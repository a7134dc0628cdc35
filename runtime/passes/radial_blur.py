"""Streaks towards a point, as of a lens that zooms while the shutter is open.

Each pixel is the mean of the picture on the way from it towards the centre. The steps of that way
start elsewhere in every pixel (R2, the same in every frame). Reads colour, writes colour.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl

from runtime.shader import SCREEN, set_uniforms

HERE = Path(__file__).parent


class Pass:
    """Blurs towards the centre."""

    reads = ("colour",)
    writes = ("colour",)

    def __init__(self, player: Any) -> None:
        self._player = player
        self._array = player.vertex_array(player.programs.get(SCREEN, HERE / "radial_blur.frag"))

    @property
    def _blur(self) -> Any:
        return self._player.scene.picture.radial_blur

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on besides the picture."""
        return (self._blur.strength.at(time),)

    def draw(self, time: float) -> None:
        """Blur the frame of `time` seconds."""
        frame, strength = self._player.targets, self._blur.strength.at(time)
        if strength == 0.0:
            return
        (width, height), (x, y) = frame.size, self._blur.centre
        before = frame.layers(("radial_blur_before",), frame.size)
        picture = frame.target("colour")
        frame.ctx.copy_framebuffer(before, picture)
        values = {
            "before": 0,
            "centre": (x * width, (1.0 - y) * height),
            "strength": strength,
            "samples": self._blur.samples,
        }
        set_uniforms(self._array.program, values)
        frame.texture("radial_blur_before").use(0)
        picture.use()
        frame.ctx.enable_only(moderngl.NOTHING)
        frame.draw(self._array, mode=moderngl.TRIANGLES, vertices=3)
