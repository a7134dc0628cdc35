"""What a gather writes to, and where its texels lie: textures of the size of the atlas.

Sums are RGBA32F and double: a pass reads one and writes the other.
"""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats.errors import MachineError
from formats.lightmap_faces import Faces
from formats.lightmap_rectangles import NONE, face_number
from runtime.voxel_world import Adopt

NAMES = (
    *("texels", "direct_sum", "indirect_sum", "latest", "before", "source", "sent", "page_of"),
    *("rows", "palette", "pages", "world", "gaps", "lamps", "destinations", "sky"),
)
UNITS = {name: unit for unit, name in enumerate(NAMES)}
"""Texture unit of each sampler of the shaders."""
PAGES_WIDTH = 256
"""Rows of `pages` side by side, six texels each."""


class Targets:
    """The textures of one layout. lightmap : RGBA16F, bilinear."""

    def __init__(self, ctx: Any, faces: Faces, adopt: Adopt) -> None:
        self._ctx, self._adopt, self._size = ctx, adopt, faces.size
        self._made: list[Any] = []
        self._buffers: dict[tuple[int, ...], Any] = {}
        self._now, self._then = 0, 0
        try:
            self._make(faces)
        except moderngl.Error as error:
            asked = "{}x{} texels".format(*faces.size)
            raise MachineError("OpenGL", "atlas", asked, "bake fewer texels a cell side") from error

    def _make(self, faces: Faces) -> None:
        w, h = self._size
        self._fixed = {
            "texels": self._texture((w, h), 4, "u2", texel_places(faces)),
            "source": self._texture((w, h), 2, "i2", faces.source()),
        }
        pages = page_textures(self._ctx, faces, self._adopt)
        self._fixed["page_of"], self._fixed["pages"] = pages
        self._made += pages
        self._sums = [[self._texture((w, h), 4, "f4") for _ in range(3)] for _ in range(2)]
        self._before = [self._texture((w, h), 4, "f2") for _ in range(2)]
        self._fixed["sent"] = self._texture((w, h), 4, "f4")
        self.lightmap = self._texture((w, h), 4, "f2")
        self.lightmap.filter = moderngl.LINEAR, moderngl.LINEAR
        self.lightmap_buffer = self._ctx.framebuffer([self.lightmap])
        self.sent_buffer = self._ctx.framebuffer([self._fixed["sent"]])
        self._exact: Any = None
        sums = (*self._sums[0], *self._sums[1])
        for texture in (*sums, *self._before, self._fixed["sent"], self.lightmap):
            self._clear(texture)

    @property
    def has_sky(self) -> bool:
        """Whether there is a map of the environment."""
        return "sky" in self._fixed

    def set_sky(self, radiance: NDArray[np.float32]) -> bool:
        """Take a lat-long map (h, w, 3) of the environment; returns whether it is the first one."""
        h, w, _ = radiance.shape
        data = np.ones((h, w, 4), np.float32)
        data[..., :3] = radiance
        first = not self.has_sky
        if not first and self._fixed["sky"].size == (w, h):
            self._fixed["sky"].write(data.tobytes())
            return False
        made = self._texture((w, h), 4, "f4", data)
        made.filter, made.repeat_x = (moderngl.LINEAR, moderngl.LINEAR), True
        self._fixed["sky"] = made
        return first

    # drawing

    def use(self) -> None:
        """Bind what shaders read: the sums as they are now."""
        for name, texture in self._fixed.items():
            texture.use(UNITS[name])
        for name, texture in zip(
            ("direct_sum", "indirect_sum", "latest"), self._sums[self._now], strict=True
        ):
            texture.use(UNITS[name])
        self._before[self._then].use(UNITS["before"])

    def turned(self) -> Any:
        """Return the framebuffer of the other sums, which are those of now from here on."""
        self._now = 1 - self._now
        return self._buffer((self._now,), self._sums[self._now])

    def changed(self) -> Any:
        """Return the framebuffer of the other sums and of what was shown before."""
        self._now, self._then = 1 - self._now, 1 - self._then
        textures = [*self._sums[self._now], self._before[self._then]]
        return self._buffer((self._now, self._then), textures)

    def exact_buffer(self) -> Any:
        """Return a framebuffer of RGBA32F for the lightmap in full precision."""
        if self._exact is None:
            self._exact = self._ctx.framebuffer([self._texture(self._size, 4, "f4")])
        return self._exact

    def read_sums(self) -> tuple[NDArray[np.float32], ...]:
        """Return mean irradiance (h, w, 3), difference of both sets (h, w), passes (h, w), and of
        the irradiance what surfaces handed on, with its rays (h, w)."""
        direct, indirect, latest = (self._read(texture) for texture in self._sums[self._now])
        light = direct[..., :3] / np.maximum(direct[..., 3:], np.float32(1))
        handed = indirect[..., :3] / np.maximum(indirect[..., 3:], np.float32(1e-6))
        return light + handed, latest[..., 3], direct[..., 3], handed, indirect[..., 3]

    def release(self) -> None:
        """Free all textures and framebuffers."""
        self._ctx.screen.use()
        buffers = [*self._buffers.values(), self.lightmap_buffer, self.sent_buffer, self._exact]
        for made in (*filter(None, buffers), *self._made):
            made.release()

    # pieces

    def _read(self, texture: Any) -> NDArray[np.float32]:
        w, h = self._size
        return np.frombuffer(texture.read(), np.float32).reshape(h, w, 4)

    def _buffer(self, key: tuple[int, ...], textures: list[Any]) -> Any:
        if key not in self._buffers:
            self._buffers[key] = self._ctx.framebuffer(textures)
        return self._buffers[key]

    def _clear(self, texture: Any) -> None:
        buffer = self._ctx.framebuffer([texture])
        buffer.clear(0.0, 0.0, 0.0, 0.0)
        self._ctx.screen.use()
        buffer.release()

    def _texture(self, size: tuple[int, int], components: int, dtype: str, data: Any = None) -> Any:
        raw = None if data is None else np.ascontiguousarray(data).tobytes()
        made = self._ctx.texture(size, components, raw, alignment=1, dtype=dtype)
        return self._keep(made, int(dtype[1]) * components * size[0] * size[1])

    def _keep(self, texture: Any, size: int) -> Any:
        texture.filter = moderngl.NEAREST, moderngl.NEAREST
        texture.repeat_x = texture.repeat_y = False
        self._made.append(texture)
        return self._adopt(texture, size)


def texel_places(faces: Faces) -> NDArray[np.uint16]:
    """Return x, y, z of the cell of interior texels, and face * 4096 + v * 64 + u of the texel on
    it, (h, w, 4); NONE elsewhere."""
    rows, tu, tv, x, y = faces.interior
    n, r = faces.texels, faces.rectangles
    # Of each rectangle: cell of its first texel, steps along u and v, and face
    one = np.eye(4, dtype=np.int32)
    axis, behind = r["axis"], r["plane"] - (r["sign"] > 0)
    u, v = one[(axis + 1) % 3], one[(axis + 2) % 3]
    first = behind[:, None] * one[axis] + r["u"][:, None] * u + r["v"][:, None] * v
    first[:, 3] = face_number(r) * 4096
    cu, cv = tu // n, tv // n
    texel = first[rows] + cu[:, None] * u[rows] + cv[:, None] * v[rows]
    texel[:, 3] += (tv - cv * n) * 64 + tu - cu * n
    found = np.full((faces.size[1], faces.size[0], 4), NONE, np.uint16)
    found[y, x] = texel
    return found


def page_textures(ctx: Any, faces: Faces, adopt: Adopt) -> tuple[Any, Any]:
    """Return the textures by which the end of a ray finds its texel: row of `pages` of each cell
    (R32UI volume), and the first texel of six faces a row (RG16UI)."""
    nx, ny, nz = faces.grid
    page_of = ctx.texture3d((nx, ny, nz), 1, faces.page_of.tobytes(), alignment=1, dtype="u4")
    rows = -(-len(faces.pages) // PAGES_WIDTH)
    data = np.full((rows * PAGES_WIDTH, 6, 2), NONE, np.uint16)
    data[: len(faces.pages)] = faces.pages
    pages = ctx.texture((6 * PAGES_WIDTH, rows), 2, data.tobytes(), alignment=1, dtype="u2")
    for made in (page_of, pages):
        made.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return adopt(page_of, faces.page_of.nbytes), adopt(pages, data.nbytes)
