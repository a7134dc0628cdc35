"""The light of a world of cubes as rays read it: alpha says solid, rgb is emission over a scale.

Linear and premultiplied, in BC1 blocks of 4 x 4 cells of a slice, or as RGBA8. Most blocks hold no
glowing cell: those are coded by a table of the 2^16 ways to be solid.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.files.texture import BC1, RGBA8, Texture
from maths import bc1

SLAB = 8  # slices coded at a time

Bytes = NDArray[np.uint8]
Cells = NDArray[np.uint16]
Float = NDArray[np.float32]


def codes(emission: Float, scale: float) -> Bytes:
    """Return the texels (P, 4) of the rows of a palette (P, 3); row 0 is empty."""
    texels = np.full((len(emission), 4), 255, np.uint8)
    texels[:, :3] = np.rint(emission / np.float32(scale) * np.float32(255))
    texels[0] = 0
    return texels


def stored(cells: Cells, emission: Float, scale: float) -> tuple[Texture, dict[str, Any]]:
    """Return the volume (nz, ny, nx) as it is stored, and what the report says of it.

    emission : (P, 3), row 0 for empty cells.  The blocks are those of `bc1.encode_volume` with
    exact black.  Told are the format; how many cells that do not glow would not be black in BC1,
    which makes it RGBA8; and the error of both forms, RMS over glowing cells, as a share of their
    RMS.

    Memory: half a byte a cell, 5 in RGBA8, and 200 bytes a cell of `SLAB` slices.
    """
    texels, exact = codes(emission, scale), emission.astype(np.float64)
    shines, glows = np.asarray(np.any(texels[:, :3], axis=1)), np.asarray(np.any(emission, axis=1))
    dim = glows & ~shines
    alike = np.unique(texels, axis=0, return_inverse=True)[1].reshape(-1).astype(np.uint16)
    depth, height, width = cells.shape
    blocks = np.empty((depth, -(-height // 4), -(-width // 4), 8), np.uint8)
    wrong, squares = 0, np.zeros(3)
    for start in range(0, depth, SLAB):
        tiles, inside = _tiled(cells[start : start + SLAB])
        lit = shines[tiles].any(axis=(1, 2))
        coded = np.empty((len(tiles), 8), np.uint8)
        coded[lit] = _lit_blocks(tiles[lit], texels, alike)
        coded[~lit] = dark_blocks(tiles[~lit] > 0)
        blocks[start : start + SLAB] = coded.reshape(blocks[start : start + SLAB].shape)
        # Compare what glows, and what should not
        decoded, rows = bc1.decode(coded[lit])[inside[lit]], tiles[lit][inside[lit]]
        dark = ~shines[rows]
        wrong += int(np.count_nonzero((decoded[dark] != texels[rows[dark]]).any(axis=1)))
        truth = exact[rows]
        forms = (0 * truth, decoded[:, :3] / 255 * scale, texels[rows, :3] / 255 * scale)
        squares += [np.sum((form - truth)[glows[rows]] ** 2) for form in forms]
        # Add what is too dim for a code, all of which is lost
        if dim.any():
            rows = tiles[~lit][inside[~lit]]
            squares += np.sum(exact[rows[dim[rows]]] ** 2)
    errors = np.sqrt(squares[1:] / squares[0]).tolist() if squares[0] else [0.0, 0.0]
    told = {
        "format": RGBA8.name if wrong else BC1.name,
        "wrong_dark_cells": wrong,
        "error_bc1": errors[0],
        "error_rgba8": errors[1],
    }
    if wrong:
        return Texture((texels[cells],), "volume"), told
    return Texture((blocks,), "volume", extent=(width, height)), told


def dark_blocks(solid: NDArray[np.bool_]) -> Bytes:
    """Return blocks (n, 8) of cells (n, 4, 4) that do not glow, each pattern coded once."""
    bits = np.packbits(solid.reshape(-1, 16), axis=1, bitorder="little")
    patterns, number = np.unique(bits.view("<u2")[:, 0], return_inverse=True)
    unpacked = np.unpackbits(patterns[:, None].view(np.uint8), axis=1, bitorder="little")
    texels = np.zeros((len(patterns), 4, 4, 4), np.uint8)
    texels[..., 3] = 255 * unpacked.reshape(-1, 4, 4)
    return bc1.encode(texels, exact_black=True)[number]


def _lit_blocks(tiles: Cells, texels: Bytes, alike: Cells) -> Bytes:
    """Return blocks (n, 8) of cells (n, 4, 4), those of equal texels coded once.

    alike : (P,) the same number for rows of the same texels (P, 4).
    """
    keys = np.ascontiguousarray(alike[tiles.reshape(-1, 16)]).view("V32")[:, 0]
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    return bc1.encode(texels[tiles[first]], exact_black=True)[number]


def texels(light: Texture) -> Bytes:
    """Return the texels (nz, ny, nx, 4) of a stored volume, either form."""
    level = light.levels[0]
    if light.extent is None:
        return level
    found = np.empty((*light.size, 4), np.uint8)
    for start in range(0, len(found), SLAB):
        found[start : start + SLAB] = bc1.decode_image(level[start : start + SLAB], light.extent)
    return found


def _tiled(cells: Cells) -> tuple[Cells, NDArray[np.bool_]]:
    """Cut slices (z, y, x) into blocks (n, 4, 4), edges repeated; which cells are no repetition."""
    depth, height, width = cells.shape
    pad = ((0, 0), (0, -height % 4), (0, -width % 4))
    inside = np.pad(np.ones(cells.shape, np.bool_), pad)
    padded = np.pad(cells, pad, mode="edge")
    shape = (depth, -(-height // 4), 4, -(-width // 4), 4)
    tiles, parts = (
        each.reshape(shape).swapaxes(2, 3).reshape(-1, 4, 4) for each in (padded, inside)
    )
    return tiles, parts
