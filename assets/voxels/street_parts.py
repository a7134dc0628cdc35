"""What a street of a night market is put together from: colours, boxes, eaves, stalls, signs.

Cells are (z, y, x), x to the right, y up, z towards the viewer; 0 is empty, else a palette index.
Places are metres in the world of the scene; the lowest corner of all cells is at LOWEST.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.uint8]
Span = tuple[float, float]

CELL = 0.125
LOWEST = (-2.5, 0.0, -12.5)
SIZE = (52, 40, 136)  # cells along x, y, z
PLASTER, PATCH, STONE, MOSS, PAVING, SLAB, TIMBER, BEAM, VERMILION, CREAM = range(1, 11)
TILE, RIDGE, WINDOW, PAPER, SIGN, BEYOND, CAP, WARES, HAZE, DIM, DUSK, BOARD, COAL = range(11, 24)
PALETTE = {
    PLASTER: (158, 148, 158),
    PATCH: (142, 128, 134),
    STONE: (80, 82, 98),
    MOSS: (72, 80, 88),
    PAVING: (92, 88, 100),
    SLAB: (74, 72, 88),
    TIMBER: (66, 42, 34),
    BEAM: (104, 60, 40),
    VERMILION: (178, 46, 30),
    CREAM: (138, 108, 76),
    TILE: (50, 58, 104),
    RIDGE: (72, 82, 132),
    WINDOW: (230, 190, 120),
    PAPER: (224, 120, 60),
    SIGN: (70, 170, 170),
    BEYOND: (230, 180, 110),
    CAP: (40, 28, 26),
    WARES: (176, 112, 44),
    HAZE: (200, 140, 90),
    DIM: (160, 100, 80),
    DUSK: (120, 80, 70),
    BOARD: (58, 52, 66),
    COAL: (150, 60, 30),
}
# Marks on a sign, three cells a side, from the top
GLYPHS = ("111.1.111", "1.1111.1.", ".1.111.11", "11..1.111")


def cell(metres: float, axis: int) -> int:
    """The cell whose lower side is nearest to a place along an axis: 0 x, 1 y, 2 z."""
    return int(np.floor((metres - LOWEST[axis]) / CELL + 0.5))


def box(cells: Cells, colour: int, x: Span, y: Span, z: Span) -> None:
    """Fill all cells between two corners, metres; what lies outside is cut off."""
    spans = [
        slice(*np.clip([cell(edge, axis) for edge in span], 0, None))
        for axis, span in ((2, z), (1, y), (0, x))
    ]
    cells[tuple(spans)] = colour


def chance(*keys: NDArray[np.int64] | int) -> NDArray[np.float64]:
    """A number in [0, 1) for whole numbers, by mixing their bits."""
    mixed = np.uint64(0x9E3779B97F4A7C15)
    with np.errstate(over="ignore"):
        for key in keys:
            mixed = (np.asarray(key).astype(np.uint64) ^ mixed) * np.uint64(0xBF58476D1CE4E5B9)
            mixed = mixed ^ (mixed >> np.uint64(29))
    return (mixed >> np.uint64(11)).astype(np.float64) * 2.0**-53


def sign(cells: Cells, left: float, low: float, z: float) -> None:
    """A dark board across the street's edge, its marks glowing."""
    box(cells, CAP, (left, left + 0.625), (low, low + 2.0), (z, z + CELL))
    for k, glyph in enumerate(GLYPHS):
        for i, mark in enumerate(glyph):
            if mark == "1":
                y = cell(low, 1) + 14 - 4 * k - i // 3
                cells[cell(z, 2), y, cell(left, 0) + 1 + i % 3] = SIGN


def eave(cells: Cells, wall: float, side: int, z: Span, y: float, reach: int) -> None:
    """A tiled roof over the street, whose edge and ends curve upwards. side : 1 right, -1 left.
    reach : cells from the house's wall to the edge."""
    first, last = (cell(edge, 2) for edge in z)
    for k in range(last - first):
        # The last four cells to each end rise
        end = max(0.0, 1.0 - min(k, last - first - 1 - k) / 4.0)
        for out in range(-6, reach + 1):
            s = (out + 6) / (reach + 6)
            fall = 5.5 * (1.0 - s) ** 1.6 + 1.6 * max(0.0, s - 0.7) / 0.3 * end
            x = cell(wall, 0) + (-out - 1 if side > 0 else out)
            base = cell(y, 1) + round(fall)
            if 0 <= x < cells.shape[2]:
                cells[first + k, base : base + 2, x] = RIDGE if k % 3 == 0 else TILE


def stall(cells: Cells, front: float, back: float, z: Span, floor: float = 0.0) -> None:
    """A counter with wares on the right side of the street, under an awning in stripes."""
    low, high = z
    box(cells, TIMBER, (front + 0.25, back), (floor, floor + 0.875), (low + 0.25, high - 0.25))
    top = floor + 0.875
    box(cells, BEAM, (front + 0.125, back), (top, top + 0.125), (low + 0.125, high - 0.125))
    for k in range(6):
        at = low + 0.375 + 0.375 * k
        tall = CELL * (1 + int(chance(k, 11) * 2.5))
        colour = (WARES, VERMILION, CREAM)[int(chance(k, 5) * 3)]
        span = (floor + 1.0, floor + 1.0 + tall)
        box(cells, colour, (front + 0.375, front + 0.75), span, (at, at + 0.25))
    # The awning rises towards the house, its front edge hangs down by a cell
    for k in range(round((back - front) / CELL)):
        x, y = front + CELL * k, floor + 2.125 + 0.75 * (k / 8) ** 0.8
        for i in range(round((high - low) / CELL)):
            colour = VERMILION if i // 3 % 2 == 0 else CREAM
            at = low + CELL * i
            thick = CELL if k else 2 * CELL
            box(cells, colour, (x, x + CELL), (y - thick, y), (at, at + CELL))
    for at in (low, high - CELL):
        box(cells, TIMBER, (front + 0.125, front + 0.25), (floor, floor + 2.125), (at, at + CELL))


def lantern(cells: Cells, x: float, y: float, z: float) -> None:
    """A paper lantern that hangs still, with its cap; x, y, z : its lowest corner."""
    box(cells, PAPER, (x, x + 0.25), (y, y + 0.25), (z, z + 0.25))
    box(cells, CAP, (x, x + 0.25), (y + 0.25, y + 0.375), (z, z + 0.25))
