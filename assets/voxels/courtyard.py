"""A courtyard of large cubes: an arch before a passage, stairs, an arcade, a pool, and a chamber
of light behind a door that slides.

Cells are (z, y, x), x to the right, y up, z towards the viewer; 0 is empty, else a palette index.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.uint8]

BONE, CHALK, TERRACOTTA, BRICK, INDIGO, NIGHT, TILE, GLOW, SAND = 1, 2, 3, 4, 5, 6, 7, 8, 9
PALETTE = {
    BONE: (226, 214, 194),
    CHALK: (205, 190, 168),
    TERRACOTTA: (196, 98, 66),
    BRICK: (158, 70, 50),
    INDIGO: (74, 78, 148),
    NIGHT: (42, 46, 98),
    TILE: (58, 110, 142),
    GLOW: (176, 150, 112),
    SAND: (222, 178, 120),
}
SIZE = (60, 26, 46)  # cells along x, y, z
DOOR = (14, 15)  # cells along z and y
DOOR_AT = (48, 1, 15)  # its lowest cell when closed: x, y, z


def courtyard() -> Cells:
    """Everything that stands still."""
    nx, ny, nz = SIZE
    cells = np.zeros((nz, ny, nx), np.uint8)
    _floor(cells)
    _passage(cells)
    _walls(cells)
    _stairs(cells)
    _arcade(cells)
    _chamber(cells)
    # Pedestal: a step and a block
    cells[19:27, 1, 20:28] = CHALK
    cells[20:26, 2:7, 21:27] = BONE
    return cells


def door() -> Cells:
    """The slab that closes the chamber, two cells thick."""
    along, high = DOOR
    cells = np.full((along, high, 1), BRICK, np.uint8)
    cells[::3, :, :] = TERRACOTTA
    return cells


def _floor(cells: Cells) -> None:
    nz, _, nx = cells.shape
    z, x = np.mgrid[:nz, :nx]
    cells[:, 0, :] = np.where((x // 3 + z // 3) % 2, BONE, CHALK)
    # The pool: sunk by its rim, tiled
    pool = (slice(27, 40), slice(6, 18))
    cells[:, 0, :][pool] = TILE
    rim = np.zeros((nz, nx), bool)
    rim[26:41, 5:19] = True
    rim[pool] = False
    cells[:, 1, :][rim] = SAND


def _passage(cells: Cells) -> None:
    """A wall with an arch, and the passage behind it."""
    high = 23
    cells[0:1, 1:high, :48] = BONE
    cells[7:10, 1:high, :48] = TERRACOTTA
    cells[8:10, 1:3, :48] = BRICK
    cells[0:10, high, :48] = TERRACOTTA
    # Round head of the arch
    y, x = np.mgrid[: cells.shape[1], : cells.shape[2]]
    width, spring, middle = 6.0, 11.5, 24.0
    above = (x + 0.5 - middle) ** 2 + (y + 0.5 - spring) ** 2 < width**2
    opening = (np.abs(x + 0.5 - middle) < width) & (y < spring) | above
    ring = (x + 0.5 - middle) ** 2 + (y + 0.5 - spring) ** 2 < (width + 1.6) ** 2
    frame = (np.abs(x + 0.5 - middle) < width + 1.6) & (y < spring) | ring
    wall = cells[7:10]
    wall[:, frame & (y >= 1) & (y < high)] = SAND
    wall[:, opening & (y >= 1)] = 0
    # Small windows high up
    for at in (35, 40):
        cells[7:10, 15:19, at : at + 2] = 0


def _walls(cells: Cells) -> None:
    """Left of bone, right of indigo with the doorway."""
    nz = cells.shape[0]
    cells[:, 1:18, 0:2] = BONE
    cells[:, 1:4, 0:2] = CHALK
    cells[:, 18, 0:2] = SAND
    cells[8:nz, 1:20, 46:48] = INDIGO
    cells[8:nz, 1:3, 46:48] = NIGHT
    cells[8:nz, 20, 46:48] = NIGHT
    along, high = DOOR
    _, _, z = DOOR_AT
    cells[z + 1 : z + along - 1, 1:high, 46:48] = 0


def _stairs(cells: Cells) -> None:
    """Steps along the left wall, up to a landing at the arch's height."""
    for step in range(10):
        z = 26 - 2 * step
        cells[max(z - 2, 10) : z, 1 : 2 + step, 2:8] = BONE if step % 2 else CHALK
    cells[10:12, 1:12, 2:12] = BONE
    # A low wall on the edge of the landing
    cells[10:12, 12, 11] = SAND


def _arcade(cells: Cells) -> None:
    """Four square columns under a beam, before the right wall."""
    for z in (11, 21, 31, 41):
        cells[z : z + 2, 1:12, 39:41] = SAND
        cells[z - 1 : z + 3, 1:2, 38:42] = CHALK
        cells[z - 1 : z + 3, 11:12, 38:42] = CHALK
    cells[10:, 12:14, 38:42] = TERRACOTTA
    cells[10:, 14, 38:47] = BRICK


def _chamber(cells: Cells) -> None:
    """A closed room behind the right wall, whose far side glows."""
    nz, _, nx = cells.shape
    cells[8:nz, 1:20, nx - 1] = NIGHT
    cells[8:nz, 20, 46:nx] = NIGHT
    cells[8:10, 1:20, 46:nx] = NIGHT
    cells[nz - 1, 1:20, 46:nx] = NIGHT
    cells[14:30, 2:16, nx - 2] = GLOW
