"""Glowing faces of a world of cubes as an alias table on the card: one fetch chooses one by power.

A face counts where what lies in front of it is empty; those at the sides of the world send light
nowhere. All have one area, so a face's chance is its luminance over the sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from maths.alias_sweep import sweep
from maths.colour import luminance
from maths.texel_sequences import texel_dither, unit
from runtime.voxel_world import Adopt, Change, VoxelVolume

WIDTH = 1024
"""Entries a row."""
PAGE = 64
"""Destinations along a side of the page of mode `talk`."""

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class FreeLamp:
    """A glowing cube among the cells. middle : (x, y, z), in cells. half_side : in cells.
    radiance : (3,) of every side, W/(m2 sr)."""

    middle: tuple[float, float, float]
    half_side: float
    radiance: tuple[float, float, float]

    @property
    def change(self) -> Change:
        """What changes where it comes or goes."""
        low, high = (np.asarray(self.middle) + way * self.half_side for way in (-1, 1))
        first, last = np.floor(low).astype(int).tolist(), np.ceil(high).astype(int).tolist()
        return Change(tuple(first), tuple(last), max(self.radiance))


class Lamps:
    """The glowing faces of a volume as they are now.

    table : RGBA32UI texels (a face, its part of the bin as bits of a float, the face that the rest
    stands for, 0); a face is x, y, z in 9 bits each and its number in 3. count : of faces. power :
    sum of their luminances. destinations : RGBA32F page of glowing cells, x, y, z of the middle and
    the chance that one was chosen by; None unless asked for. aim : False lists no faces.
    """

    def __init__(
        self, ctx: Any, adopt: Adopt, *, destinations: bool = False, aim: bool = True
    ) -> None:
        self._ctx, self._adopt, self._aim_at = ctx, adopt, aim
        self.count, self.power = 0, 0.0
        self.table: Any = None
        self.destinations: Any = None
        if destinations:
            self.destinations = self._texture((PAGE, PAGE), "f4")

    def update(self, volume: VoxelVolume) -> None:
        """List the faces of a volume anew."""
        cells, radiance = volume.glowing()
        power = np.asarray(luminance(radiance)).reshape(-1)
        # A view: the whole volume would take longer than all lamps
        faces, owner = exposed(cells if self._aim_at else cells[:0], volume.texels[..., 3])
        self.count, self.power = len(faces), float(power[owner].sum())
        height = max(1, -(-self.count // WIDTH))
        if self.table is None or self.table.height < height:
            # Who adopted the old one may free it later
            self.table = self._texture((WIDTH, 2 * height if self.table else height), "u4")
        if self.count:
            table = sweep(power[owner])
            data = np.zeros((height * WIDTH, 4), np.uint32)
            data[: self.count, 0] = faces
            data[: self.count, 1] = table.stay.astype(np.float32).view(np.uint32)
            data[: self.count, 2] = faces[table.alias]
            self.table.write(data.tobytes(), viewport=(0, 0, WIDTH, height))
        if self.destinations is not None:
            self._aim(cells, power)

    def _aim(self, cells: Indices, power: NDArray[np.float64]) -> None:
        """Choose the page of cells: neighbours on the page are far apart in the list."""
        data = np.zeros((PAGE * PAGE, 4), np.float32)
        if len(cells):
            y, x = np.divmod(np.arange(PAGE * PAGE), PAGE)
            place = np.stack([x, y, np.zeros_like(x)], axis=-1)
            table = sweep(power)
            # Equal steps through the table, in the order of the dither
            rank = np.argsort(np.argsort(unit(texel_dither(place)[:, 0]), kind="stable"))
            share = np.cumsum(table.share)
            chosen = np.searchsorted(share, (rank + 0.5) / len(rank), side="right")
            chosen = np.minimum(chosen, len(cells) - 1)
            data[:, :3], data[:, 3] = cells[chosen] + 0.5, table.share[chosen]
        self.destinations.write(data.tobytes())

    def release(self) -> None:
        """Free the textures."""
        for texture in (self.table, self.destinations):
            if texture is not None:
                texture.release()

    def _texture(self, size: tuple[int, int], dtype: str) -> Any:
        made = self._ctx.texture(size, 4, dtype=dtype)
        made.filter = moderngl.NEAREST, moderngl.NEAREST
        return self._adopt(made, 16 * size[0] * size[1])


def exposed(cells: Indices, solid: NDArray[Any]) -> tuple[NDArray[np.uint32], Indices]:
    """Return the faces (f,) of cells (k, 3) with an empty cell in front, and the row of each.

    solid : (nz, ny, nx), 0 for empty.
    """
    nz, ny, nx = solid.shape
    found, owner = [np.zeros(0, np.uint32)], [np.zeros(0, np.int64)]
    x, y, z = cells.T
    packed = (x | y << 9 | z << 18).astype(np.uint32)
    for face in range(6):
        front = cells.copy()
        front[:, face // 2] += 1 - 2 * (face % 2)
        inside = np.all((front >= 0) & (front < (nx, ny, nz)), axis=1)
        fx, fy, fz = np.where(inside[:, None], front, 0).T
        free = np.flatnonzero(inside & (solid[fz, fy, fx] == 0))
        found.append(packed[free] | np.uint32(face << 27))
        owner.append(free)
    return np.concatenate(found), np.concatenate(owner)
