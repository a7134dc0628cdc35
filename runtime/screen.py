"""The finished picture on the screen, and another one left of a divider."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from runtime.shader import SCREEN, Programs, set_uniforms

HERE = Path(__file__).parent


class Screen:
    """Shows pictures on the screen of a context."""

    def __init__(self, ctx: Any) -> None:
        self._ctx, self._programs = ctx, Programs(ctx)
        self._array = ctx.vertex_array(self._programs.get(SCREEN, HERE / "screen.frag"), [])
        self._other: Any = None
        self._written: Any = None

    def keep(self, target: Any) -> None:
        """Copy a framebuffer of a finished picture: the other one."""
        self._make(target.size)
        copy = self._ctx.framebuffer([self._other])
        self._ctx.copy_framebuffer(copy, target)
        copy.release()

    def write(self, picture: NDArray[np.uint8]) -> None:
        """Take (h, w, 3), row 0 on top, for the other one."""
        if self._written is picture:
            return
        self._make((picture.shape[1], picture.shape[0]))
        texels = np.full((*picture.shape[:2], 4), 255, np.uint8)
        # A texture starts at the bottom
        texels[..., :3] = picture[::-1]
        self._other.write(texels.tobytes())
        self._written = picture

    def show(
        self, live: Any, size: tuple[int, int], pixels: tuple[int, int], divider: float
    ) -> Any:
        """Fill the lower left `size` of `pixels`; returns the framebuffer of the screen.

        live : texture. divider : share of the width left of which the other picture shows.
        """
        screen = self._ctx.screen
        screen.viewport = (0, 0, *pixels)
        screen.use()
        screen.clear(0.05, 0.05, 0.06, 1.0)
        screen.viewport = (0, 0, *size)
        if self._other is None:
            divider = 0.0
        # Coarse while things move; else a texel is a pixel
        live.filter = moderngl.LINEAR, moderngl.LINEAR
        live.use(0)
        (self._other if divider > 0 else live).use(1)
        set_uniforms(self._array.program, {"live": 0, "other": 1, "divider": divider})
        self._ctx.enable_only(moderngl.NOTHING)
        self._array.render(moderngl.TRIANGLES, vertices=3)
        live.filter = moderngl.NEAREST, moderngl.NEAREST
        screen.viewport = (0, 0, *pixels)
        return screen

    def _make(self, size: tuple[int, int]) -> None:
        """Let the other picture be a texture of a size."""
        self._written = None
        if self._other is not None and self._other.size == tuple(size):
            return
        if self._other is not None:
            self._other.release()
        self._other = self._ctx.texture(size, 4, dtype="f1")
        self._other.repeat_x = self._other.repeat_y = False

    def release(self) -> None:
        """Free what it made."""
        if self._other is not None:
            self._other.release()
        self._array.release()
        self._programs.release()
