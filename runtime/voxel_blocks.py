"""Worlds of cubes as BC1 blocks on the card: a border of solid blocks, and compressed slices.

moderngl uploads no compressed textures; what it lacks is called through the context's own loader.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import voxel_light
from formats.errors import InputError
from maths import bc1
from runtime.capture import loader
from runtime.upload import TEXTURE_2D_ARRAY, RawGL

RGBA_S3TC_DXT1 = 0x83F1
NUM_COMPRESSED_FORMATS, COMPRESSED_FORMATS = 0x86A2, 0x86A3
TEXTURE_MIN_FILTER, TEXTURE_MAG_FILTER, NEAREST = 0x2801, 0x2800, 0x2600
_INT, _POINTER = ctypes.c_int, ctypes.c_void_p

Bytes = NDArray[np.uint8]


def blocks_of(texels: Bytes) -> Bytes:
    """Code cells (z, y, x, 4) as blocks (z, y / 4, x / 4, 8), rounded up; what fills the last ones
    is solid and dark."""
    depth, height, width, _ = texels.shape
    pads = ((0, 0), (0, -height % 4), (0, -width % 4), (0, 0))
    padded = np.pad(texels, pads)
    padded[:, height:, :, 3] = padded[:, :, width:, 3] = 255
    shape = depth, padded.shape[1] // 4, 4, padded.shape[2] // 4, 4, 4
    tiles = np.moveaxis(padded.reshape(shape), 3, 2)
    flat = tiles.reshape(-1, 4, 4, 4)
    lit = flat[..., :3].any(axis=(1, 2, 3))
    blocks = np.empty((len(flat), 8), np.uint8)
    blocks[lit] = bc1.encode(flat[lit], exact_black=True)
    blocks[~lit] = voxel_light.dark_blocks(flat[~lit][..., 3] > 0)
    return blocks.reshape(*tiles.shape[:3], 8)


def bordered(blocks: Bytes) -> Bytes:
    """Put solid dark blocks around a volume (z, y, x, 8): one more at each end of each axis."""
    found = np.empty((*np.add(blocks.shape[:3], 2), 8), np.uint8)
    found[:] = voxel_light.dark_blocks(np.ones((1, 4, 4), np.bool_))[0]
    found[1:-1, 1:-1, 1:-1] = blocks
    return found


def whole_blocks(
    low: tuple[int, ...], high: tuple[int, ...], size: tuple[int, int, int]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Widen a box of cells to blocks along x and y, inside of a world of `size` cells."""
    first = (low[0] // 4 * 4, low[1] // 4 * 4, low[2])
    last = (min(-(-high[0] // 4) * 4, size[0]), min(-(-high[1] // 4) * 4, size[1]), high[2])
    return first, last


class CompressedSlices:
    """BC1 texture arrays of one context. Raises InputError where the card has none."""

    def __init__(self, ctx: Any) -> None:
        self._ctx, self._gl = ctx, RawGL(ctx)
        count = self._gl.integer(NUM_COMPRESSED_FORMATS)
        known = (ctypes.c_int * max(count, 1))()
        self._gl.glGetIntegerv(COMPRESSED_FORMATS, known)
        if RGBA_S3TC_DXT1 not in known and not _has_s3tc(ctx):
            remedy = "choose rgba8 or bc1: this machine decodes no BC1"
            raise InputError("voxels", "storage", "bc1_array", remedy)
        load = loader(ctx)
        image = (*(_INT,) * 8, _POINTER)
        part = (*(_INT,) * 10, _POINTER)
        self._image = ctypes.CFUNCTYPE(None, *image)(load("glCompressedTexImage3D"))
        self._part = ctypes.CFUNCTYPE(None, *part)(load("glCompressedTexSubImage3D"))

    def make(self, blocks: Bytes) -> Any:
        """Return a texture array of slices of blocks (z, y, x, 8)."""
        layers, rows, columns, _ = blocks.shape
        # moderngl makes the name; the level is defined anew
        made = self._ctx.texture_array((4, 4, 1), 4)
        data = np.ascontiguousarray(blocks)
        self._gl.glBindTexture(TEXTURE_2D_ARRAY, made.glo)
        size = (4 * columns, 4 * rows, layers)
        self._image(TEXTURE_2D_ARRAY, 0, RGBA_S3TC_DXT1, *size, 0, data.nbytes, data.ctypes.data)
        for name in (TEXTURE_MIN_FILTER, TEXTURE_MAG_FILTER):
            self._gl.glTexParameteri(TEXTURE_2D_ARRAY, name, NEAREST)
        self._gl.glBindTexture(TEXTURE_2D_ARRAY, 0)
        return made

    def write(self, texture: Any, blocks: Bytes, place: tuple[int, int, int]) -> None:
        """Replace blocks (z, y, x, 8), the first one at (x, y, z) blocks."""
        layers, rows, columns, _ = blocks.shape
        data = np.ascontiguousarray(blocks)
        corner = (4 * place[0], 4 * place[1], place[2])
        size = (4 * columns, 4 * rows, layers)
        self._gl.glBindTexture(TEXTURE_2D_ARRAY, texture.glo)
        self._part(
            TEXTURE_2D_ARRAY, 0, *corner, *size, RGBA_S3TC_DXT1, data.nbytes, data.ctypes.data
        )
        self._gl.glBindTexture(TEXTURE_2D_ARRAY, 0)


def _has_s3tc(ctx: Any) -> bool:
    return "GL_EXT_texture_compression_s3tc" in ctx.extensions
