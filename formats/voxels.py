"""A world of cubes: which cells are solid, their colour, and the light that they send out.

Two volumes lie in a folder: `cells.ktx2` (R16_UINT), the number of each cell's row in the palettes
of `report.json`, without loss; and `light.ktx2`, what rays need: alpha says solid, rgb is emission
over `scale`, linear and premultiplied. That is BC1 with 1-bit alpha, unless a cell that does not
glow would come out of it other than exactly black: then RGBA8.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report, seal, voxel_light
from formats.errors import DamagedError, InputError
from formats.files import ktx2
from formats.files.reading import read_bytes
from formats.files.texture import BC1, R16UI, RGBA8, Texture
from formats.material import BRIGHTEST

FORMAT = 1
KIND, CELLS, LIGHT = "voxels", "cells.ktx2", "light.ktx2"
AGAIN = "bake the voxels again"
MAX_SIDE = 512
"""Most cells along a side."""
MAX_ROWS = 1 << 16
"""Most rows of the palettes."""
ALBEDO_LIMIT = 0.98
"""Largest albedo: light in a closed room of albedo 1 would never end."""
LARGEST = 1e6
"""Largest cell, and largest coordinate of the origin, metres."""
SMALLEST = 1e-6
"""Smallest cell, metres."""

Float = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Voxels:
    """A volume of cells.

    cells : (nz, ny, nx) uint16, 0 for empty, else a row of the palettes. albedo : (P, 3) float32
    linear, 0 to `ALBEDO_LIMIT`. emission : (P, 3) float32 radiance from every side of a cell,
    W/(m2 sr), from 0 to `BRIGHTEST`. Row 0 of both is 0. cell_size : metres. origin : (x, y, z)
    metres of the lowest corner: cell (i, j, k) covers origin + cell_size [i, i + 1) and so on.
    """

    cells: NDArray[np.uint16]
    albedo: Float
    emission: Float
    cell_size: float = 1.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quality: dict[str, Any] = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int, int]:
        """(nx, ny, nz) cells."""
        nz, ny, nx = self.cells.shape
        return nx, ny, nz

    @property
    def solid(self) -> NDArray[np.bool_]:
        """Which cells (nz, ny, nx) are not empty."""
        return np.asarray(self.cells > 0)

    @property
    def glowing(self) -> NDArray[np.bool_]:
        """Which cells (nz, ny, nx) send out light."""
        return np.asarray(np.any(self.emission, axis=1))[self.cells]

    @property
    def scale(self) -> float:
        """Radiance that full codes of the stored light stand for; 1 where nothing glows."""
        return float(self.emission.max(initial=0.0)) or 1.0

    def checked(self, where: object = "voxels") -> Voxels:
        """Return the volume with arrays of the declared types, contiguous, native byte order.

        Raises InputError for arrays of wrong shape, type or size, cells without a row, a row 0 that
        is not 0, and numbers that are not finite or out of range; `where` names it.
        """
        cells = np.asarray(self.cells)
        if cells.ndim != 3 or cells.dtype.kind not in "iu" or not _fits(cells.shape):
            remedy = f"give (nz, ny, nx) whole numbers of 1 to {MAX_SIDE} cells a side"
            raise InputError(where, "cells", f"{cells.dtype} {cells.shape}", remedy)
        rows = len(np.atleast_1d(self.albedo))
        if not 1 <= rows <= MAX_ROWS or cells.min() < 0 or cells.max() >= rows:
            remedy = f"number rows of a palette of at most {MAX_ROWS}, here {rows}"
            raise InputError(where, "cells", f"{cells.min()} to {cells.max()}", remedy)
        arrays: dict[str, Any] = {"cells": np.ascontiguousarray(cells, np.uint16)}
        for name, limit in (("albedo", ALBEDO_LIMIT), ("emission", BRIGHTEST)):
            palette = np.asarray(getattr(self, name))
            if palette.shape != (rows, 3) or palette.dtype.kind not in "fiu":
                remedy = f"give ({rows}, 3) numbers"
                raise InputError(where, name, f"{palette.dtype} {palette.shape}", remedy)
            # The limit as float32 has it
            if not np.all((palette >= 0) & (palette <= np.float32(limit))) or palette[0].any():
                remedy = f"give numbers from 0 to {limit:g}, and 0 in row 0"
                raise InputError(where, name, "out of range", remedy)
            arrays[name] = np.ascontiguousarray(palette, np.float32)
        if not SMALLEST <= self.cell_size <= LARGEST:
            remedy = f"choose from {SMALLEST:g} to {LARGEST:g} metres"
            raise InputError(where, "cell_size", self.cell_size, remedy)
        if len(self.origin) != 3 or not all(abs(x) <= LARGEST for x in self.origin):
            remedy = f"give three numbers of at most {LARGEST:g} metres"
            raise InputError(where, "origin", self.origin, remedy)
        return replace(self, **arrays)

    def save(self, folder: Path) -> None:
        """Write both volumes and `report.json` into an existing folder.

        Raises InputError for what `checked` refuses.
        """
        voxels = self.checked(folder)
        texture, told = voxel_light.stored(voxels.cells, voxels.emission, voxels.scale)
        ktx2.write(Path(folder) / CELLS, Texture((voxels.cells[..., None],), "volume"))
        ktx2.write(Path(folder) / LIGHT, texture)
        layout = {
            "size": voxels.size,
            "cell_size": float(voxels.cell_size),
            "origin": [float(x) for x in voxels.origin],
            "scale": voxels.scale,
            "albedo": voxels.albedo,
            "emission": voxels.emission,
        }
        data = {"format": FORMAT, "kind": KIND, "layout": layout, "light": told}
        report.write(folder, data | {"quality": voxels.quality})

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Voxels:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data, layout = _read(folder)
        level = _volume(folder, CELLS, layout).levels[0]
        if level.dtype != R16UI.dtype:
            raise DamagedError(Path(folder) / CELLS, "type", str(level.dtype), AGAIN)
        x, y, z = layout["origin"]
        return cls(
            cells=level[..., 0],
            albedo=np.asarray(layout["albedo"], np.float32).reshape(-1, 3),
            emission=np.asarray(layout["emission"], np.float32).reshape(-1, 3),
            cell_size=layout["cell_size"],
            origin=(x, y, z),
            quality=data["quality"],
        ).checked(folder)


def load_light(folder: Path) -> tuple[Texture, float]:
    """Read what rays need: a volume of BC1 blocks or RGBA8 texels, and the radiance of full codes.

    Raises DamagedError as `Voxels.load`.
    """
    _, layout = _read(folder)
    texture = _volume(folder, LIGHT, layout)
    if texture.format not in (BC1, RGBA8):
        raise DamagedError(Path(folder) / LIGHT, "type", texture.format.name, AGAIN)
    return texture, layout["scale"]


def _fits(shape: tuple[int, ...]) -> bool:
    return all(0 < side <= MAX_SIDE for side in shape)


def _read(folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    data = report.read(folder)
    if data.get("kind") != KIND or data.get("format") != FORMAT:
        found = f"{data.get('kind')} of format {data.get('format')}"
        raise DamagedError(folder, "kind", found, AGAIN)
    return data, data["layout"]


def _volume(folder: Path, name: str, layout: dict[str, Any]) -> Texture:
    path = Path(folder) / name
    sealed = seal.is_sealed(folder)
    data = seal.read_bytes(folder, name) if sealed else read_bytes(path, ktx2.MAX_BYTES)
    texture = ktx2.decode(data, str(path))
    if texture.kind != "volume" or list(texture.size[::-1]) != layout["size"]:
        raise DamagedError(path, "size", str(texture.size), AGAIN)
    return texture
