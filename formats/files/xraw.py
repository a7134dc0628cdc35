"""XRAW, MagicaVoxel's raw export: a box of palette indices, or of colours. Little-endian.

The header has 24 bytes: XRAW; type of a channel (0: whole numbers from 0), channels, bits of a
channel, bits of an index (0: colours are stored in place); width x, depth y, height z; number of
colours. Then come the cells, x fastest, then y, z up, then the palette. Empty are index 0 of 8
bits, the largest index of 16, and colours of alpha 0.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files.reading import read_bytes, refusing

MAX_FILE_BYTES = 1 << 30
"""Largest file."""
MAX_SIDE = 512
"""Largest side, cells."""
MAX_COLOURS = (1 << 16) - 1
"""Most colours."""

_HEADER = struct.Struct("<4s4B4I")


@dataclass(frozen=True, eq=False)
class XrawFile:
    """cells : (z, y, x) uint16, 0 empty, z up. palette : (P, 4) uint8 sRGB and alpha, row 0 unused;
    row i is index i of the file, or i - 1 where it has 16 bits."""

    cells: NDArray[np.uint16]
    palette: NDArray[np.uint8]


def read(path: Path) -> XrawFile:
    """Read a file; InputError as in `decode`, and where it is missing or over `MAX_FILE_BYTES`."""
    return decode(read_bytes(path, MAX_FILE_BYTES), str(path))


def decode(data: bytes, name: str) -> XrawFile:
    """Read the bytes of a file; `name` is what errors call it.

    Raises InputError for colours that are not RGB or RGBA of 8 bits, for sides beyond `MAX_SIDE`,
    for indices without a colour, and for what is cut off.
    """
    with refusing(name, "XRAW file"):
        magic, kind, channels, bits, index_bits, x, y, z, count = _HEADER.unpack_from(data)
        if magic != b"XRAW":
            raise ValueError("it does not start with XRAW")
        if kind != 0 or channels not in (3, 4) or bits != 8 or index_bits not in (0, 8, 16):
            value = f"type {kind}, {channels} channels of {bits} bits, indices of {index_bits}"
            raise InputError(name, "colours", value, "export it as RGBA of 8 bits")
        if not all(0 < side <= MAX_SIDE for side in (x, y, z)):
            raise InputError(name, "size", (x, y, z), f"use sides of 1 to {MAX_SIDE} cells")
        width = channels if index_bits == 0 else index_bits // 8
        count = count if index_bits else 0
        middle = _HEADER.size + x * y * z * width
        if count > MAX_COLOURS or middle + count * channels > len(data):
            raise ValueError(f"{len(data)} bytes do not hold {x * y * z} cells, {count} colours")
        cells = np.frombuffer(data[_HEADER.size : middle], np.uint8).reshape(z, y, x, width)
        if index_bits == 0:
            return _coloured(name, _opaque(cells))
        stored = np.frombuffer(data[middle : middle + count * channels], np.uint8)
        return _indexed(cells, _opaque(stored.reshape(-1, channels)))


def _opaque(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return colours (..., 4), alpha 255 where they have none."""
    if colours.shape[-1] == 4:
        return colours
    return np.concatenate([colours, np.full_like(colours[..., :1], 255)], axis=-1)


def _indexed(cells: NDArray[np.uint8], palette: NDArray[np.uint8]) -> XrawFile:
    if cells.shape[-1] == 1:
        indices = cells[..., 0].astype(np.uint16)
    else:
        # The largest index, empty, becomes 0, and 0 becomes 1
        indices = np.ascontiguousarray(cells).view("<u2")[..., 0] + np.uint16(1)
        palette = np.concatenate([np.zeros((1, 4), np.uint8), palette])
    if indices.max() >= max(len(palette), 1):
        raise ValueError(f"an index of {indices.max()} into {len(palette)} colours")
    return XrawFile(indices.astype(np.uint16), palette)


def _coloured(name: str, cells: NDArray[np.uint8]) -> XrawFile:
    """Number the colours of cells (z, y, x, 4)."""
    codes = np.ascontiguousarray(cells).view("<u4")[..., 0]
    codes = np.where(cells[..., 3] > 0, codes, 0)
    found, inverse = np.unique(np.append(codes.reshape(-1), np.uint32(0)), return_inverse=True)
    if len(found) > MAX_COLOURS:
        remedy = f"export it with a palette of at most {MAX_COLOURS}"
        raise InputError(name, "colours", len(found), remedy)
    palette = np.ascontiguousarray(found, "<u4")[:, None].view(np.uint8)
    return XrawFile(inverse[:-1].reshape(codes.shape).astype(np.uint16), palette)
