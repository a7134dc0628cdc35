"""Render targets made on first use, pass timing, and the counters behind `Player.profile`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import moderngl

from formats.errors import MachineError
from runtime import upload
from runtime.shader import SCREEN, Programs, set_uniforms

HERE = Path(__file__).parent
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software")


class Frame:
    """Everything of one player that lives on the card besides its programs.

    Targets are named; the first pass that asks for one makes it. `colour` is RGBA16F scene-linear
    radiance, `depth` 24-bit with 1 at infinity. Times are wall clock between `finish` calls on
    software drivers, whose timer queries do not add up, and timer queries elsewhere; `timing`
    says which. samples : a pixel of the opaque picture, 1 or more; the card may offer fewer.
    unresolved : something was drawn on the samples that `resolve` has not averaged.
    milliseconds : of each pass when it last ran.
    programs : of the same context; without them it links its own.
    owner : what textures made and draws issued now are counted for, such as the name of a pass.
    generation : how often the targets were given up; what was drawn before is gone.
    """

    def __init__(
        self, ctx: Any, size: tuple[int, int], samples: int = 1, programs: Programs | None = None
    ) -> None:
        self.ctx, self.size = ctx, size
        self.samples = min(samples, int(ctx.max_samples))
        self._own = Programs(ctx) if programs is None else None
        self._programs = programs or self._own
        self._sampled: Any = None
        self._averaged: Any = None
        self.unresolved = False
        self._textures: dict[str, Any] = {}
        self._buffers: dict[tuple[str | None, ...], Any] = {}
        self._adopted: dict[int, tuple[Any, int, str]] = {}
        self.owner, self.generation = "start", 0
        self.calls: dict[str, int] = {}
        self.milliseconds: dict[str, float] = {}
        renderer = str(ctx.info["GL_RENDERER"]).lower()
        self.software = any(name in renderer for name in SOFTWARE)
        self.timing = "wall clock between finish calls" if self.software else "timer queries"
        self._query = None if self.software else ctx.query(time=True)
        self._measuring = False

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
                width = {"f1": 1, "f2": 2, "f4": 4, "i4": 4}[dtype]
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

    def targets(self, names: tuple[tuple[str, int, str], ...], depth: str | None) -> Any:
        """Return the framebuffer that writes several targets, each (name, components, dtype)."""
        key = (*(name for name, _, _ in names), depth)
        if key not in self._buffers:
            made = [self.texture(*each) for each in names]
            attachment = self.texture(depth) if depth else None
            self._buffers[key] = self.ctx.framebuffer(made, attachment)
        return self._buffers[key]

    def layers(self, names: tuple[str, ...], size: tuple[int, int], levels: int = 1) -> Any:
        """Return the framebuffer that writes RGBA16F targets of a size of their own, bilinear."""
        if names not in self._buffers:
            for name in names:
                made = self.ctx.texture(size, 4, dtype="f2")
                made.repeat_x = made.repeat_y = False
                upload.allocate_levels(self.ctx, made, levels)
                mipmapped = moderngl.LINEAR_MIPMAP_NEAREST if levels > 1 else moderngl.LINEAR
                made.filter = (mipmapped, moderngl.LINEAR)
                texels = sum((size[0] >> i) * (size[1] >> i) for i in range(levels))
                self._textures[name] = self.adopt(made, 8 * texels)
            self._buffers[names] = self.ctx.framebuffer([self._textures[n] for n in names])
        return self._buffers[names]

    def coarser(self, names: tuple[str, ...], level: int) -> Any:
        """Return the framebuffer that writes one level, from 1, of such targets made before."""
        key = (*names, str(level))
        if key not in self._buffers:
            made = upload.level_buffer(self.ctx, [self._textures[name] for name in names], level)
            self._buffers[key] = made
        return self._buffers[key]

    def copied(self, colour: str, depth: str) -> Any:
        """Return a framebuffer of a colour and a depth target to copy `colour` and `depth` to."""
        if depth not in self._textures:
            made = self.ctx.depth_texture(self.size)
            made.compare_func = ""
            made.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._textures[depth] = self.adopt(made, 4 * self.size[0] * self.size[1])
        return self.target(colour, depth)

    # opaque things

    def opaque(self) -> Any:
        """Return the framebuffer of what is opaque: colour and depth, or samples of both.

        What is drawn there reaches the targets `colour` and `depth` when `resolve` is called.
        """
        if self.samples <= 1:
            return self.target("colour", "depth")
        if self._sampled is None:
            how = {"samples": self.samples}
            made = []
            try:
                made.append(self.ctx.texture(self.size, 4, dtype="f2", **how))
                made.append(self.ctx.depth_texture(self.size, **how))
                self._sampled = (self.ctx.framebuffer([made[0]], made[1]), *made)
            except moderngl.Error as error:
                for buffer in made:
                    buffer.release()
                asked = "{}x{} pixels".format(*self.size)
                raise MachineError(
                    "OpenGL", "samples", asked, "ask for a smaller picture"
                ) from error
        self.unresolved = True
        return self._sampled[0]

    def resolve(self) -> None:
        """Average the samples of what is opaque into `colour`; `depth` takes one of them.

        Once after the last call of `opaque`; nothing otherwise.
        """
        if not self.unresolved:
            return
        if self._averaged is None:
            # Drivers compile the program of a blit of samples in every process, ours are kept
            defines = {"SAMPLES": self.samples}
            program = self._programs.get(SCREEN, HERE / "samples.frag", defines, {})
            self._averaged = self.ctx.vertex_array(program, [])
        for unit, texture in enumerate(self._sampled[1:]):
            texture.use(unit)
        set_uniforms(self._averaged.program, {"colours": 0, "depths": 1})
        target = self.target("colour", "depth")
        target.use()
        # Depth is written, whatever it was
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        self.ctx.depth_func = "1"
        self.draw(self._averaged, mode=moderngl.TRIANGLES, vertices=3)
        self.unresolved = False

    # copies

    def keep(self, depth: bool) -> None:
        """Copy `colour`, and `depth` where asked, for `restore` to bring back."""
        self._copy("colour", "kept", depth)

    def restore(self, depth: bool) -> None:
        """Bring back what `keep` copied, bit for bit."""
        self._copy("kept", "colour", depth)

    def _copy(self, source: str, target: str, depth: bool) -> None:
        def buffer(name: str) -> Any:
            if name == "colour" or not depth:
                return self.target(name, "depth" if depth else None)
            return self.copied(name, "kept_depth")

        self.ctx.copy_framebuffer(buffer(target), buffer(source))

    # counters

    def adopt(self, texture: Any, size: int) -> Any:
        """Count a texture of `size` bytes as this player's; returns it."""
        self._adopted[texture.glo] = texture, size, self.owner
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
        """Bytes of all textures alive, and of the samples of what is opaque."""
        return sum(size for _, size in self.textures.values())

    @property
    def textures(self) -> dict[str, tuple[int, int]]:
        """Owner -> (count, bytes) of the textures alive; samples are no textures but have bytes."""
        found: dict[str, tuple[int, int]] = {}
        for _, size, owner in self._adopted.values():
            count, total = found.get(owner, (0, 0))
            found[owner] = count + 1, total + size
        if self._sampled is not None:
            count, total = found.get("start", (0, 0))
            found["start"] = count, total + self.samples * 12 * self.size[0] * self.size[1]
        return found

    @property
    def objects(self) -> int:
        """Textures, framebuffers and renderbuffers alive."""
        return len(self._adopted) + len(self._buffers) + len(self._sampled or ())

    @property
    def draw_calls(self) -> int:
        """Draws of the last frame."""
        return sum(self.calls.values())

    def begin(self) -> None:
        """Count the calls of a new frame."""
        self.calls.clear()

    def draw(self, array: Any, **how: Any) -> None:
        """Render a vertex array and count it."""
        self.calls[self.owner] = self.calls.get(self.owner, 0) + 1
        array.render(**how)

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Measure the milliseconds of a pass into `milliseconds[name]`, and own what it makes.

        Inside another `timed` nothing is measured: timer queries do not nest.
        """
        owner, outside, self.owner = self.owner, self._measuring, name
        try:
            if outside:
                yield
                return
            self._measuring = True
            start = time.perf_counter()
            with self._query or nullcontext():
                yield
            if self._query is None:
                self.ctx.finish()
            spent = 1e3 * (time.perf_counter() - start)
            self.milliseconds[name] = spent if self._query is None else self._query.elapsed * 1e-6
        finally:
            self.owner, self._measuring = owner, outside

    def resize(self, size: tuple[int, int]) -> None:
        """Change the picture's size: targets are made anew when they are next asked for."""
        if size != self.size:
            self._release_targets()
            self.size = size

    def release(self) -> None:
        """Free targets, framebuffers and every texture that was adopted."""
        self._release_targets()
        if self._averaged is not None:
            self._averaged.release()
        if self._own is not None:
            self._own.release()
        for texture, _, _ in list(self._adopted.values()):
            self.drop(texture)

    def _release_targets(self) -> None:
        # moderngl binds the last framebuffer again after making one: let that not be a freed one
        self.ctx.screen.use()
        for buffer in (*self._buffers.values(), *(self._sampled or ())):
            buffer.release()
        self._sampled, self.unresolved = None, False
        self.generation += 1
        for texture in self._textures.values():
            self.drop(texture)
        self._buffers.clear()
        self._textures.clear()
