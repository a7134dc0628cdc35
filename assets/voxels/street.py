"""A narrow street of a night market: on the left a quiet wall behind a low one, on the right
stalls, a balcony and curved eaves; steps that rise to a gate with a glow beyond."""

from __future__ import annotations

import numpy as np
from street_parts import (
    BEAM,
    BEYOND,
    BOARD,
    CAP,
    CELL,
    COAL,
    DIM,
    DUSK,
    HAZE,
    LOWEST,
    MOSS,
    PATCH,
    PAVING,
    PLASTER,
    RIDGE,
    SIZE,
    SLAB,
    STONE,
    TILE,
    TIMBER,
    VERMILION,
    WINDOW,
    Cells,
    box,
    cell,
    chance,
    eave,
    lantern,
    sign,
    stall,
)


def street() -> Cells:
    """Everything that stands still."""
    nx, ny, nz = SIZE
    cells = np.zeros((nz, ny, nx), np.uint8)
    for part in (_floor, _quiet_wall, _left, _right, _tall_house, _far_right, _gate, _low_wall):
        part(cells)
    return cells


def _floor(cells: Cells) -> None:
    """Paving, and steps that rise to the gate, their edges lighter."""
    nz, _, nx = cells.shape
    z, x = np.mgrid[:nz, :nx]
    row = z // 3
    tone = chance((x + 2 * (row % 2)) // 4, row, 7)
    cells[:, 0, :] = np.where(tone < 0.45, SLAB, PAVING)
    for step in range(7):
        y, edge = CELL * (step + 1), -5.5 - 0.75 * step
        box(cells, SLAB, (-0.375, 2.75), (y, y + CELL), (-12.5, edge))
        box(cells, STONE, (-0.375, 2.75), (y, y + CELL), (edge - CELL, edge))


def _quiet_wall(cells: Cells) -> None:
    """Plaster between dark beams, for the shadow to fall on; boards round the corner."""
    box(cells, PLASTER, (-2.5, -0.5), (0.0, 5.0), (1.625, 2.0))
    box(cells, BOARD, (-1.0, -0.5), (0.0, 5.0), (-3.0, 1.875))
    bare = ((-1.875, 2.25, 3, 1), (-1.75, 2.125, 2, 1), (-2.0, 1.5, 2, 2))
    for x, y, wide, high in bare:
        box(cells, PATCH, (x, x + CELL * wide), (y, y + CELL * high), (1.875, 2.0))
    box(cells, TIMBER, (-2.5, -0.375), (2.75, 3.0), (1.875, 2.125))
    box(cells, TIMBER, (-0.625, -0.375), (0.0, 2.75), (1.75, 2.0))
    box(cells, TILE, (-2.5, -0.25), (3.0, 3.125), (1.625, 2.375))


def _left(cells: Cells) -> None:
    """Houses behind the first, seen along their fronts: a sign and eaves stand out from them."""
    box(cells, PATCH, (-1.0, -0.625), (0.0, 4.25), (-7.0, -3.0))
    box(cells, PLASTER, (-0.875, -0.375), (0.0, 4.5), (-12.5, -7.0))
    sign(cells, -0.5, 2.25, -1.75)
    eave(cells, -0.625, -1, (-7.0, -3.0), 4.125, 5)
    eave(cells, -0.375, -1, (-12.0, -7.25), 3.75, 6)
    box(cells, WINDOW, (-0.5, -0.375), (1.0, 2.25), (-5.5, -4.75))
    lantern(cells, 0.25, 3.125, -4.0)
    lantern(cells, 0.375, 3.25, -8.0)


def _right(cells: Cells) -> None:
    """The first stall before its house, coals on its counter."""
    box(cells, BEAM, (2.75, 3.25), (0.0, 3.25), (-1.5, 3.0))
    box(cells, WINDOW, (2.75, 2.875), (1.0, 2.25), (-1.25, 1.75))
    for z in (-1.25, -0.5, 0.25, 1.0, 1.75):
        box(cells, TIMBER, (2.625, 2.75), (0.0, 2.75), (z, z + CELL))
    stall(cells, 1.75, 2.75, (-1.25, 1.5))
    box(cells, CAP, (1.875, 2.25), (1.0, 1.25), (0.375, 1.0))
    box(cells, COAL, (2.0, 2.125), (1.125, 1.25), (0.5, 0.875))
    eave(cells, 2.75, 1, (-1.75, 3.0), 3.0, 7)
    lantern(cells, 1.75, 1.75, -0.75)


def _tall_house(cells: Cells) -> None:
    """A house with a balcony over the street."""
    box(cells, PATCH, (2.5, 3.0), (0.0, 5.0), (-5.5, -1.875))
    box(cells, TIMBER, (1.875, 2.5), (2.75, 2.875), (-5.25, -2.125))
    box(cells, BEAM, (1.875, 2.0), (3.375, 3.5), (-5.25, -2.125))
    for k in range(9):
        z = -5.25 + 0.375 * k
        box(cells, BEAM, (1.875, 2.0), (2.875, 3.375), (z, z + CELL))
    for z in (-4.75, -3.25):
        box(cells, WINDOW, (2.5, 2.625), (3.0, 4.25), (z, z + 0.75))
        box(cells, TIMBER, (2.375, 2.5), (3.0, 4.25), (z + 0.375, z + 0.5))
    for z in (-2.25, -5.25):
        box(cells, TIMBER, (1.875, 2.0), (0.0, 2.75), (z, z + CELL))
    box(cells, VERMILION, (2.0, 2.125), (1.25, 2.5), (-2.5, -2.375))
    eave(cells, 2.5, 1, (-5.75, -1.875), 4.625, 7)
    lantern(cells, 1.0, 3.0, -4.0)
    lantern(cells, 1.75, 2.875, -4.0)


def _far_right(cells: Cells) -> None:
    """Another stall, half-way up the steps, before the last house."""
    box(cells, BEAM, (2.625, 3.125), (0.0, 4.0), (-12.5, -5.5))
    box(cells, WINDOW, (2.625, 2.75), (1.5, 2.5), (-8.5, -6.25))
    stall(cells, 1.875, 2.75, (-8.75, -6.0), 0.5)
    eave(cells, 2.625, 1, (-12.0, -6.0), 3.875, 6)
    for x, y, z in ((1.125, 3.125, -8.0), (1.875, 3.25, -8.0), (1.75, 2.25, -6.5)):
        lantern(cells, x, y, z)


def _gate(cells: Cells) -> None:
    """The end: a wall with a round arch under a curved roof, and a glow behind it."""
    box(cells, STONE, (-0.5, 2.75), (0.0, 4.25), (-12.0, -11.5))
    _, ny, nx = cells.shape
    y, x = np.mgrid[:ny, :nx]
    aside = np.abs(LOWEST[0] + CELL * (x + 0.5) - 1.125)
    above = LOWEST[1] + CELL * (y + 0.5) - 2.25
    inside = np.where(above > 0, np.hypot(aside, above), aside)
    inside[:8] = np.inf
    gate = cells[cell(-12.0, 2) : cell(-11.5, 2)]
    gate[:, inside < 1.0625] = BEAM
    gate[:, inside < 0.8125] = 0
    for colour, low, high in ((BEYOND, 8, 14), (HAZE, 14, 17), (DIM, 17, 20), (DUSK, 20, 26)):
        cells[0:2, low:high, 20:38] = colour
    far = cell(-12.0, 2)
    for x in range(14, 44):
        rise = 34 + round(3.0 * (abs(x - 29) / 15) ** 3)
        cells[far - 1 : far + 6, rise, x] = RIDGE if x % 3 == 0 else TILE
        cells[far : far + 4, rise + 1, x] = TILE
        cells[far + 1 : far + 3, rise + 2, x] = RIDGE


def _low_wall(cells: Cells) -> None:
    """The wall on which the cat sits, stepped at its end, with moss."""
    box(cells, STONE, (-2.5, -0.125), (0.0, 1.25), (2.0, 2.125))
    box(cells, STONE, (-2.5, 0.0), (1.25, 1.375), (2.0, 2.25))
    box(cells, STONE, (-0.125, 0.125), (0.0, 0.875), (2.0, 2.125))
    box(cells, STONE, (0.125, 0.375), (0.0, 0.5), (2.0, 2.125))
    z, y, x = np.nonzero(cells == STONE)
    mossy = (z > 112) & (chance(x, y, z) < 0.16 + 0.3 * (y < 4))
    cells[z[mossy], y[mossy], x[mossy]] = MOSS
