"""A world of cubes at a moment: its own cells, parts that stand elsewhere, and lamps' light.

Parts snap to cells; where two meet, the later one in the scene stays. Gathered light takes a lamp
as a cube of its own among the cells. Baked light, and the talk's way of gathering, share its light
out among the empty cells that it overlaps, by the share of it in each (for one cell a side that is
trilinear); those cells then stop rays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from formats.errors import InputError
from formats.voxel_world import VoxelLamp
from formats.voxels import MAX_ROWS, MAX_SIDE, Voxels

Array = NDArray[np.float64]
Cells = NDArray[np.uint16]
Offset = tuple[int, int, int]
Place = tuple[float, float, float]
Reach = tuple[Place, Place, int]
"""Lowest and highest place of a lamp's middle, metres, and its cells along a side."""
MOST_CELLS = 1 << 25
"""Of a world with the room that lamps take."""
ROUNDING = 1e-6  # cells


@dataclass(frozen=True, eq=False)
class Glow:
    """A lamp's light among the cells.

    cells : (k, 3) of x, y, z.  share : (k,) of the lamp in each.  radiance : (3,).
    """

    cells: NDArray[np.int64]
    share: Array
    radiance: Array


class World:
    """The cells of a world with parts that move.

    position : (x, y, z) of the middle of its underside, metres.  reaches : of lamps: the world has
    empty cells as far as they go.  voxels : of the world itself, where it stands, with the palettes
    of world and parts joined. Raises InputError where those have too many rows, or lamps go too
    far.
    """

    def __init__(
        self,
        world: Voxels,
        bodies: Sequence[Voxels] = (),
        position: Place = (0.0, 0.0, 0.0),
        reaches: Sequence[Reach] = (),
    ) -> None:
        placed = _with_room(at_floor(world, position), reaches)
        first, tables = len(placed.albedo), [placed]
        self._bodies: list[Cells] = []
        for body in bodies:
            # Row 0 stays empty
            self._bodies.append(np.where(body.cells > 0, body.cells + (first - 1), 0).astype("u2"))
            first += len(body.albedo) - 1
            tables.append(body)
        albedo = np.concatenate([t.albedo[i > 0 :] for i, t in enumerate(tables)])
        emission = np.concatenate([t.emission[i > 0 :] for i, t in enumerate(tables)])
        if len(albedo) > MAX_ROWS:
            remedy = f"use fewer colours: world and parts together have at most {MAX_ROWS:,}"
            raise InputError("voxels", "bodies", f"{len(albedo):,} colours", remedy)
        self.voxels = replace(placed, albedo=albedo, emission=emission)

    def offsets(self, positions: Sequence[Place]) -> tuple[Offset, ...]:
        """Lowest cell (x, y, z) of each part whose underside has its middle there, in metres; it
        may lie outside."""
        found = []
        for position, cells in zip(positions, self._bodies, strict=True):
            nz, _, nx = cells.shape
            corner = (np.asarray(position) - self.voxels.origin) / self.voxels.cell_size
            low = np.rint(corner - np.array([nx / 2, 0.0, nz / 2]))
            x, y, z = (int(v) for v in np.clip(low, -(1 << 20), 1 << 20))
            found.append((x, y, z))
        return tuple(found)

    def cells(self, offsets: Sequence[Offset]) -> Cells:
        """Cells (nz, ny, nx) with the parts at these places."""
        found = self.voxels.cells.copy()
        for cells, offset in zip(self._bodies, offsets, strict=True):
            inside, own = _overlap(found.shape, cells.shape, offset)
            part = cells[own]
            np.copyto(found[inside], part, where=part > 0)
        return found

    def states(self, moments: Sequence[Sequence[Place]]) -> list[tuple[Offset, ...]]:
        """Every set of cells that parts at these positions take, each once, in order."""
        return list(dict.fromkeys(self.offsets(positions) for positions in moments))

    def outside(self, states: Sequence[Sequence[Offset]]) -> list[int]:
        """Return the numbers of parts of which no cell is ever within the world."""
        shape = self.voxels.cells.shape
        found = []
        for number, cells in enumerate(self._bodies):
            inside = (_overlap(shape, cells.shape, state[number])[1] for state in states)
            if not any(cells[own].any() for own in inside):
                found.append(number)
        return found

    def snapped(self, middle: ArrayLike, side: int) -> Array:
        """Return the place (3,), metres, next to `middle` at which a lamp fills whole cells."""
        v = self.voxels
        low = np.rint((np.asarray(middle, np.float64) - v.origin) / v.cell_size - side / 2)
        return np.asarray(v.origin + (low + side / 2) * v.cell_size)

    def glow(self, lamp: VoxelLamp, cells: Cells, time: float) -> Glow:
        """The light of a lamp at `time` seconds in a world of these cells."""
        nz, ny, nx = cells.shape
        middle = (lamp.position.at(time) - self.voxels.origin) / self.voxels.cell_size
        low = np.clip(middle - lamp.side / 2, -(1 << 20), 1 << 20)
        # A lamp that fills cells must not touch the next by rounding
        low = np.where(np.abs(low - np.rint(low)) < ROUNDING, np.rint(low), low)
        first = np.floor(low).astype(np.int64)
        # Share of the cube within each of side + 1 cells along each axis
        along = [overlaps(low[axis] - first[axis], lamp.side) for axis in range(3)]
        z, y, x = np.meshgrid(*(np.arange(lamp.side + 1),) * 3, indexing="ij")
        share = along[2][z] * along[1][y] * along[0][x]
        at = np.stack([x, y, z], axis=-1).reshape(-1, 3) + first
        inside = np.all((at >= 0) & (at < (nx, ny, nz)), axis=1) & (share.ravel() > 0)
        at, share = at[inside], share.ravel()[inside]
        empty = cells[at[:, 2], at[:, 1], at[:, 0]] == 0
        return Glow(at[empty], share[empty], np.asarray(lamp.radiance.at(time)))


def overlaps(start: float, side: int) -> Array:
    """Share (side + 1,) of each cell that a segment of `side` cells covers from `start`, 0 to 1.

    >>> overlaps(0.25, 2).tolist()
    [0.75, 1.0, 0.25]
    """
    found = np.ones(side + 1)
    found[0], found[-1] = 1.0 - start, start
    return found


def at_floor(voxels: Voxels, position: Sequence[float]) -> Voxels:
    """Place a volume so that the middle of its underside is at `position` (x, y, z), metres."""
    nx, _, nz = voxels.size
    x, y, z = (float(v) for v in position)
    half = voxels.cell_size / 2
    return replace(voxels, origin=(x - nx * half, y, z - nz * half))


def _with_room(voxels: Voxels, reaches: Sequence[Reach]) -> Voxels:
    """Add empty cells on every side, as far as lamps reach. InputError where that is too far."""
    low, high = np.zeros(3), np.array(voxels.size, np.float64)
    for lowest, highest, side in reaches:
        first, last = (
            (np.asarray(place) - voxels.origin) / voxels.cell_size for place in (lowest, highest)
        )
        low = np.minimum(low, np.floor(first - side / 2 + ROUNDING))
        high = np.maximum(high, np.ceil(last + side / 2 - ROUNDING))
    sides = high - low
    if sides.max() > MAX_SIDE or sides.prod() > max(MOST_CELLS, voxels.cells.size):
        size = " x ".join(f"{side:.0f}" for side in sides)
        remedy = (
            f"keep them near: the world grows to hold them, to at most {MAX_SIDE} cells a side and "
            f"{MOST_CELLS:,} cells"
        )
        raise InputError("voxels", "lamps", f"{size} cells", remedy)
    before, after = (-low).astype(int), (high - voxels.size).astype(int)
    if not before.any() and not after.any():
        return voxels
    cells = np.pad(voxels.cells, list(zip(before[::-1], after[::-1], strict=True)))
    x, y, z = (float(v) for v in np.asarray(voxels.origin) + low * voxels.cell_size)
    return replace(voxels, cells=cells, origin=(x, y, z))


def _overlap(
    world: tuple[int, ...], part: tuple[int, ...], offset: Offset
) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Slices (z, y, x) of a world and of a part in it that are the same cells."""
    inside, own = [], []
    for size, length, low in zip(world, part, offset[::-1], strict=True):
        start, stop = min(max(low, 0), size), min(max(low + length, 0), size)
        inside.append(slice(start, stop))
        own.append(slice(start - low, stop - low) if stop > start else slice(0, 0))
    return tuple(inside), tuple(own)
