"""Baked mip levels into texture arrays. Everything that needs raw OpenGL lives here.

moderngl 5.13 cannot write a level of a texture array, so level 0 is made by moderngl and the others
by glTexImage3D through the context's own loader.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from runtime.capture import loader

TEXTURE_2D, TEXTURE_2D_ARRAY = 0x0DE1, 0x8C1A
FRAMEBUFFER, COLOR_ATTACHMENT0 = 0x8D40, 0x8CE0
RGBA = 0x1908
UNPACK_ALIGNMENT, PACK_ALIGNMENT = 0x0CF5, 0x0D05
TEXTURE_BASE_LEVEL, TEXTURE_MAX_LEVEL = 0x813C, 0x813D
MAX_TEXTURE_SIZE, MAX_ARRAY_TEXTURE_LAYERS = 0x0D33, 0x88FF
# dtype -> moderngl's name, internal format, type of a component
FORMATS = {
    np.dtype(np.uint8): ("f1", 0x8058, 0x1401),  # RGBA8, UNSIGNED_BYTE
    np.dtype(np.float16): ("f2", 0x881A, 0x140B),  # RGBA16F, HALF_FLOAT
}

_INT, _POINTER = ctypes.c_int, ctypes.c_void_p
_SIGNATURES: dict[str, tuple[Any, ...]] = {
    "glBindTexture": (_INT, _INT),
    "glPixelStorei": (_INT, _INT),
    "glTexParameteri": (_INT, _INT, _INT),
    "glTexImage2D": (*(_INT,) * 8, _POINTER),
    "glTexImage3D": (*(_INT,) * 9, _POINTER),
    "glBindFramebuffer": (_INT, _INT),
    "glFramebufferTexture2D": (_INT,) * 5,
    "glGetTexImage": (*(_INT,) * 4, _POINTER),
    "glGetIntegerv": (_INT, _POINTER),
}


class RawGL:
    """The handful of entry points that moderngl does not cover, bound to one context."""

    def __init__(self, ctx: Any) -> None:
        load = loader(ctx)
        for name, arguments in _SIGNATURES.items():
            setattr(self, name, ctypes.CFUNCTYPE(None, *arguments)(load(name)))

    def integer(self, name: int) -> int:
        """Return one integer limit of the driver."""
        value = ctypes.c_int(0)
        self.glGetIntegerv(name, ctypes.byref(value))
        return value.value


def texture_array(ctx: Any, levels: Sequence[NDArray[Any]], name: str = "texture") -> Any:
    """Return a trilinear, edge-clamped `moderngl.TextureArray` that holds baked levels.

    levels : (layers, h, w, 4) uint8 or float16 each, level n of size max(1, size >> n), any number.
    Raises InputError where the levels do not fit together or this machine has no room for them.
    """
    gl = RawGL(ctx)
    layers, height, width = _checked(gl, levels, name)
    kind, internal, component = FORMATS[levels[0].dtype]
    texture = ctx.texture_array(
        (width, height, layers), 4, np.ascontiguousarray(levels[0]), alignment=1, dtype=kind
    )
    gl.glPixelStorei(UNPACK_ALIGNMENT, 1)
    gl.glBindTexture(TEXTURE_2D_ARRAY, texture.glo)
    for n, level in enumerate(levels[1:], start=1):
        data = np.ascontiguousarray(level)
        size = (level.shape[2], level.shape[1], layers)
        gl.glTexImage3D(TEXTURE_2D_ARRAY, n, internal, *size, 0, RGBA, component, data.ctypes.data)
    gl.glTexParameteri(TEXTURE_2D_ARRAY, TEXTURE_BASE_LEVEL, 0)
    gl.glTexParameteri(TEXTURE_2D_ARRAY, TEXTURE_MAX_LEVEL, len(levels) - 1)
    gl.glBindTexture(TEXTURE_2D_ARRAY, 0)
    texture.filter = (ctx.LINEAR_MIPMAP_LINEAR, ctx.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture


def read_level(ctx: Any, texture: Any, level: int) -> NDArray[Any]:
    """Return one level of a texture array as the card holds it: (layers, h, w, 4)."""
    gl = RawGL(ctx)
    dtype = next(d for d, f in FORMATS.items() if f[0] == texture.dtype)
    shape = (texture.layers, max(1, texture.height >> level), max(1, texture.width >> level), 4)
    data = np.empty(shape, dtype)
    gl.glPixelStorei(PACK_ALIGNMENT, 1)
    gl.glBindTexture(TEXTURE_2D_ARRAY, texture.glo)
    gl.glGetTexImage(TEXTURE_2D_ARRAY, level, RGBA, FORMATS[dtype][2], data.ctypes.data)
    gl.glBindTexture(TEXTURE_2D_ARRAY, 0)
    return data


def allocate_levels(ctx: Any, texture: Any, levels: int) -> None:
    """Give a two-dimensional RGBA16F texture so many mip levels, what they hold is not defined."""
    if levels <= 1:
        return
    gl = RawGL(ctx)
    _, internal, component = FORMATS[np.dtype(np.float16)]
    gl.glBindTexture(TEXTURE_2D, texture.glo)
    for n in range(1, levels):
        size = (max(1, texture.width >> n), max(1, texture.height >> n))
        gl.glTexImage2D(TEXTURE_2D, n, internal, *size, 0, RGBA, component, None)
    gl.glTexParameteri(TEXTURE_2D, TEXTURE_BASE_LEVEL, 0)
    gl.glTexParameteri(TEXTURE_2D, TEXTURE_MAX_LEVEL, levels - 1)
    gl.glBindTexture(TEXTURE_2D, 0)


def level_buffer(ctx: Any, textures: Sequence[Any], level: int) -> Any:
    """Return a `moderngl.Framebuffer` that writes one mip level of textures of one size."""
    gl, made = RawGL(ctx), ctx.framebuffer(list(textures))
    gl.glBindFramebuffer(FRAMEBUFFER, made.glo)
    for n, texture in enumerate(textures):
        place = COLOR_ATTACHMENT0 + n
        gl.glFramebufferTexture2D(FRAMEBUFFER, place, TEXTURE_2D, texture.glo, level)
    width, height = textures[0].size
    made.viewport = (0, 0, max(1, width >> level), max(1, height >> level))
    made.use()
    return made


def byte_count(levels: Sequence[NDArray[Any]]) -> int:
    """Return the bytes that levels take on the card."""
    return sum(level.nbytes for level in levels)


def _checked(gl: RawGL, levels: Sequence[NDArray[Any]], name: str) -> tuple[int, int, int]:
    layers, height, width, _ = levels[0].shape
    if levels[0].dtype not in FORMATS:
        raise InputError(name, "dtype", levels[0].dtype, "store uint8 or float16")
    for n, level in enumerate(levels):
        expected = (layers, max(1, height >> n), max(1, width >> n), 4)
        if level.shape != expected or level.dtype != levels[0].dtype:
            raise InputError(name, f"level {n}", level.shape, f"expected {expected}; bake it again")
    limit = gl.integer(MAX_TEXTURE_SIZE)
    if max(width, height) > limit:
        remedy = f"this machine takes {limit} texels a side: bake at a lower resolution"
        raise InputError(name, "size", f"{width}x{height}", remedy)
    if layers > (limit := gl.integer(MAX_ARRAY_TEXTURE_LAYERS)):
        remedy = f"this machine takes {limit} layers: bake fewer views or terms"
        raise InputError(name, "layers", layers, remedy)
    return layers, height, width
