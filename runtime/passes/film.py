"""The last step: exposure, vignette, tone curve, sRGB, grain, and a dither of half an 8-bit code.

The vignette is the natural one of a lens, cos^4 of the angle off axis, in the amount asked for. The
grain (`maths.grain`) is the same in all channels and another in every frame.
Reads colour, writes picture (RGBA8).
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from runtime.shader import SCREEN, set_uniforms

HERE = Path(__file__).parent


class Pass:
    """Develops the linear picture."""

    reads = ("colour",)
    writes = ("picture",)

    def __init__(self, player: Any) -> None:
        self._player = player
        self._arrays: dict[tuple[bool, bool], Any] = {}
        self._array()

    @property
    def _film(self) -> Any:
        return self._player.scene.picture.film

    def _array(self) -> Any:
        """What draws the film as it is described now."""
        kind = self._film.tonemap == "filmic", self._film.grain > 0.0
        if kind not in self._arrays:
            defines = dict(zip(("FILMIC", "GRAIN"), kind, strict=True))
            program = self._player.programs.get(SCREEN, HERE / "film.frag", defines, {})
            self._arrays[kind] = self._player.vertex_array(program)
        return self._arrays[kind]

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        return self._film.exposure.at(time), self._frame_number(time)

    def _frame_number(self, time: float) -> int:
        """Number that dither and grain of `time` seconds are drawn by: another in every frame."""
        return round(time * self._player.scene.time.frame_rate) & 0x7FFFFFFF

    def draw(self, time: float) -> None:
        """Develop the frame of `time` seconds."""
        player = self._player
        width, height = player.targets.size
        values = {
            "colour_target": 0,
            "exposure": 2.0 ** self._film.exposure.at(time),
            "vignette": self._film.vignette,
            "grain_codes": self._film.grain,
            "half_size": tuple(np.array([width, height]) / np.hypot(width, height)),
            "frame_number": self._frame_number(time),
        }
        array = self._array()
        set_uniforms(array.program, values)
        player.targets.texture("colour").use(0)
        player.targets.target("picture", dtype="f1").use()
        player.ctx.enable_only(moderngl.NOTHING)
        player.targets.draw(array, mode=moderngl.TRIANGLES, vertices=3)
