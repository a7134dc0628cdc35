"""Render targets made on first use, pass timing, and the counters behind `Player.profile`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl

from formats.errors import MachineError

SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software")


class Frame:
    """Everything of one player that lives on the card besides its programs.

    Targets are named; the first pass that asks for one makes it. `colour` is RGBA16F scene-linear
    radiance, `depth` 24-bit with 1 at infinity. Times are wall clock between `finish` calls on
    software drivers, whose timer queries do not add up, and timer queries elsewhere; `timing`
    says which.
    """

    def __init__(self, ctx: Any, size: tuple[int, int]) -> None:
        self.ctx, self.size = ctx, size
        self._textures: dict[str, Any] = {}
        self._buffers: dict[tuple[str | None, ...], Any] = {}
        self._adopted: dict[int, tuple[Any, int]] = {}
        self.draw_calls = 0
        self.milliseconds: dict[str, float] = {}
        renderer = str(ctx.info["GL_RENDERER"]).lower()
        self.software = any(name in renderer for name in SOFTWARE)
        self.timing = "wall clock between finish calls" if self.software else "timer queries"
        self._query = None if self.software else ctx.query(time=True)

    # targets

    def texture(self, name: str, components: int = 4, dtype: str = "f2") -> Any:
        """Return the named full-size target texture; the name `depth` gives a depth texture."""
        if name not in self._textures:
            if name == "depth":
                made = self.ctx.depth_texture(self.size)
                made.compare_func = ""
                made.filter = (moderngl.NEAREST, moderngl.NEAREST)
                self.adopt(made, 4 * self.size[0] * self.size[1])
            else:
                made = self.ctx.texture(self.size, components, dtype=dtype)
                made.filter = (moderngl.NEAREST, moderngl.NEAREST)
                made.repeat_x = made.repeat_y = False
                width = {"f1": 1, "f2": 2, "f4": 4}[dtype]
                self.adopt(made, width * components * self.size[0] * self.size[1])
            self._textures[name] = made
        return self._textures[name]

    def target(self, colour: str, depth: str | None = None, **kind: Any) -> Any:
        """Return the framebuffer that writes a named colour target, with or without depth."""
        key = (colour, depth)
        if key not in self._buffers:
            try:
                attachment = self.texture(depth) if depth else None
                made = self.ctx.framebuffer([self.texture(colour, **kind)], attachment)
            except moderngl.Error as error:
                asked = "{}x{} pixels".format(*self.size)
                raise MachineError("OpenGL", colour, asked, "ask for a smaller picture") from error
            self._buffers[key] = made
        return self._buffers[key]

    # counters

    def adopt(self, texture: Any, size: int) -> Any:
        """Count a texture of `size` bytes as this player's; returns it."""
        self._adopted[texture.glo] = texture, size
        return texture

    def drop(self, texture: Any) -> None:
        """Release a texture that was adopted."""
        self._adopted.pop(texture.glo, None)
        texture.release()

    @property
    def texture_count(self) -> int:
        """Textures alive, targets included."""
        return len(self._adopted)

    @property
    def texture_bytes(self) -> int:
        """Bytes of all textures alive."""
        return sum(size for _, size in self._adopted.values())

    def draw(self, array: Any, **how: Any) -> None:
        """Render a vertex array and count it."""
        self.draw_calls += 1
        array.render(**how)

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Measure the milliseconds of a pass into `milliseconds[name]`."""
        if self._query is not None:
            with self._query:
                yield
            self.milliseconds[name] = self._query.elapsed * 1e-6
            return
        start = time.perf_counter()
        yield
        self.ctx.finish()
        self.milliseconds[name] = 1e3 * (time.perf_counter() - start)

    def resize(self, size: tuple[int, int]) -> None:
        """Change the picture's size: targets are made anew when they are next asked for."""
        if size != self.size:
            self._release_targets()
            self.size = size

    def release(self) -> None:
        """Free targets, framebuffers and every texture that was adopted."""
        self._release_targets()
        for texture, _ in list(self._adopted.values()):
            self.drop(texture)

    def _release_targets(self) -> None:
        # moderngl binds the last framebuffer again after making one: let that not be a freed one
        self.ctx.screen.use()
        for buffer in self._buffers.values():
            buffer.release()
        for texture in self._textures.values():
            self.drop(texture)
        self._buffers.clear()
        self._textures.clear()
