"""A world of cubes on the card: what rays read of each cell, and updates of boxes that change.

Three ways to hold solid and emission, all with a border of solid cells around the world at which
rays stop: `rgba8`, a volume of 4 bytes a cell; `bc1`, blocks of half a byte a cell as integers,
which the shader decodes; `bc1_array`, the same blocks as compressed slices that the card decodes.
OpenGL has no BC1 volumes. Beside them are the palette row of each cell, and where asked the field
of distances.

The copy `texels` holds what the shader reads, errors of BC1 included, so that what is sampled is
what is found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats import voxel_light
from formats.errors import InputError
from formats.voxels import Voxels
from maths import bc1
from maths.voxel_traversal import REACH, distances
from runtime import voxel_blocks

STORAGES = ("rgba8", "bc1", "bc1_array")
PALETTE_WIDTH = 256

Bytes = NDArray[np.uint8]
Adopt = Callable[[Any, int], Any]
Box = tuple[tuple[int, int, int], tuple[int, int, int]]


def adopt_nothing(texture: Any, size: int) -> Any:
    """Return a texture, and count it for nobody."""
    return texture


class Glow(Protocol):
    """A lamp's light among the cells, as `formats.voxel_state.Glow`."""

    @property
    def cells(self) -> NDArray[np.int64]:
        """(k, 3) x, y, z."""

    @property
    def share(self) -> NDArray[np.float64]:
        """(k,) of the lamp in each."""

    @property
    def radiance(self) -> NDArray[np.float64]:
        """(3,), W/(m2 sr)."""


@dataclass(frozen=True)
class Change:
    """A box of cells, low up to and without high (x, y, z), and the largest radiance that what
    changed there can add to or take from a ray."""

    low: tuple[int, int, int]
    high: tuple[int, int, int]
    radiance: float


class VoxelVolume:
    """The textures of one world.

    brightest : the largest radiance that lamps will take: with the palette's it sets what a full
    code stands for. gaps : also hold the field of distances. adopt : called with each texture and
    its bytes, such as `Frame.adopt`. Raises InputError for a storage that is unknown, or that this
    machine does not have.
    """

    def __init__(
        self,
        ctx: Any,
        voxels: Voxels,
        *,
        storage: str = "rgba8",
        brightest: float = 0.0,
        gaps: bool = False,
        adopt: Adopt = adopt_nothing,
    ) -> None:
        if storage not in STORAGES:
            raise InputError("voxels", "storage", storage, f"choose from {', '.join(STORAGES)}")
        self.ctx, self.storage, self._adopt = ctx, storage, adopt
        self.size, self.cells = voxels.size, voxels.cells.copy()
        self.cell_size, self.origin, self.albedo = voxels.cell_size, voxels.origin, voxels.albedo
        self.scale = max(float(voxels.emission.max(initial=0.0)), brightest) or 1.0
        self._codes = voxel_light.codes(voxels.emission, self.scale)
        self.texels: Bytes = self._codes[self.cells]
        self._glow_cells = np.zeros((0, 3), np.int64)
        self._glow_codes = np.zeros((0, 4), np.uint8)
        self._glow_boxes: list[tuple[Box, float]] = []
        self.uploaded = 0
        self.world = self._make_world()
        nx, ny, nz = self.size
        self.rows = self._volume((nx, ny, nz), 1, "u2", self.cells)
        self.palette = self._make_palette(voxels.albedo)
        self.gaps = None
        if gaps:
            field = distances(np.pad(self.solid, 1, constant_values=True))
            self.gaps = self._volume((nx + 2, ny + 2, nz + 2), 1, "u1", field)
        flat = self.texels[..., :3].any(axis=-1).ravel()
        self._glowing = np.flatnonzero(flat)

    @property
    def solid(self) -> NDArray[np.bool_]:
        """Which cells (nz, ny, nx) stop rays, those of lamps included."""
        return np.asarray(self.texels[..., 3] > 0)

    @property
    def defines(self) -> dict[str, int]:
        """What the shaders have to know."""
        return {"STORAGE": STORAGES.index(self.storage)}

    def glowing(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return glowing cells (k, 3) x, y, z and their radiance (k, 3) as the shader reads it."""
        nx, ny, _ = self.size
        at = self._glowing
        cells = np.stack([at % nx, at // nx % ny, at // (nx * ny)], axis=-1).astype(np.int64)
        codes = self.texels.reshape(-1, 4)[at, :3].astype(np.float64)
        return cells, codes * (self.scale / 255.0)

    # changes

    def set_cells(self, cells: NDArray[Any], boxes: Sequence[Box]) -> list[Change]:
        """Take over the cells (nz, ny, nx) of some boxes; returns what changed."""
        found = []
        for box in boxes:
            low, high, inside = self._inside(box)
            if inside is None:
                continue
            old, new = self.cells[inside], np.asarray(cells[inside], np.uint16)
            if np.array_equal(old, new):
                continue
            self.cells[inside] = new
            self.rows.write(_raw(new), viewport=(*low, *np.subtract(high, low)), alignment=1)
            self.uploaded += new.nbytes
            self._write(low, high)
            found.append(Change(low, high, self.scale))
        return found

    def set_glow(self, glows: Sequence[Glow]) -> list[Change]:
        """Let these lamps shine, and no others; returns what changed."""
        nx, ny, nz = self.size
        empty: list[Any] = [np.zeros((0, 3), np.int64)]
        cells = np.concatenate(empty + [np.asarray(g.cells, np.int64) for g in glows])
        light = [np.outer(g.share, g.radiance) for g in glows]
        values = np.concatenate([np.zeros((0, 3)), *light])
        inside = np.all((cells >= 0) & (cells < (nx, ny, nz)), axis=1)
        places, number = np.unique(cells[inside], axis=0, return_inverse=True)
        total = np.zeros((len(places), 3))
        np.add.at(total, number.ravel(), values[inside])
        codes = np.full((len(places), 4), 255, np.uint8)
        codes[:, :3] = np.rint(np.minimum(total / self.scale, 1.0) * 255)
        if np.array_equal(places, self._glow_cells) and np.array_equal(codes, self._glow_codes):
            return []
        old = self._glow_boxes
        self._glow_cells, self._glow_codes = places, codes
        self._glow_boxes = []
        for glow in glows:
            inside = np.all((glow.cells >= 0) & (glow.cells < self.size), axis=1)
            if inside.any():
                box = _around(glow.cells[inside])
                self._glow_boxes.append((box, float(np.max(glow.radiance))))
        changes = _joined([*old, *self._glow_boxes])
        for change in changes:
            self._write(change.low, change.high)
        return changes

    def _write(self, low: tuple[int, ...], high: tuple[int, ...]) -> None:
        """Bring the card up to date with the cells of a box, and lamps in it."""
        if self.storage != "rgba8":
            low, high = voxel_blocks.whole_blocks(low, high, self.size)
        inside = _slices(low, high)
        part = self._codes[self.cells[inside]]
        within = np.all((self._glow_cells >= low) & (self._glow_cells < high), axis=1)
        x, y, z = (self._glow_cells[within] - low).T
        free = part[z, y, x, 3] == 0
        part[z[free], y[free], x[free]] = self._glow_codes[within][free]
        self.texels[inside] = part
        if self.storage == "rgba8":
            corner = [a + 1 for a in low]
            self.world.write(_raw(part), viewport=(*corner, *np.subtract(high, low)), alignment=1)
            self.uploaded += part.nbytes
        else:
            blocks = voxel_blocks.blocks_of(part)
            self.texels[inside] = _decoded(blocks, part.shape)
            place = (low[0] // 4 + 1, low[1] // 4 + 1, low[2] + 1)
            self.uploaded += blocks.nbytes
            if self.storage == "bc1":
                extent = blocks.shape[2], blocks.shape[1], blocks.shape[0]
                words = np.ascontiguousarray(blocks).view("<u4")
                self.world.write(words.tobytes(), viewport=(*place, *extent), alignment=1)
            else:
                self._compressed.write(self.world, blocks, place)
        self._write_gaps(low, high)
        self._list_glowing(low, high)

    def _write_gaps(self, low: tuple[int, ...], high: tuple[int, ...]) -> None:
        if self.gaps is None:
            return
        # What lies further away than the field reaches changes nothing
        sides = np.array(self.size) + 2
        first, last = np.maximum(np.array(low) + 1 - REACH, 0), np.array(high) + 1 + REACH
        last = np.minimum(last, sides)
        wide, end = np.maximum(first - REACH, 0), np.minimum(last + REACH, sides)
        inner = np.clip(wide - 1, 0, self.size), np.clip(end - 1, 0, self.size)
        solid = np.ones((end - wide)[::-1], np.bool_)
        solid[_slices(*(side + 1 - wide for side in inner))] = (
            self.texels[_slices(*inner)][..., 3] > 0
        )
        field = distances(solid)[_slices(first - wide, last - wide)]
        self.gaps.write(_raw(field), viewport=(*first, *(last - first)), alignment=1)
        self.uploaded += field.nbytes

    def _list_glowing(self, low: tuple[int, ...], high: tuple[int, ...]) -> None:
        nx, ny, _ = self.size
        at = self._glowing
        place = np.stack([at % nx, at // nx % ny, at // (nx * ny)], axis=-1)
        kept = at[~np.all((place >= low) & (place < high), axis=1)]
        z, y, x = np.nonzero(self.texels[_slices(low, high)][..., :3].any(axis=-1))
        added = ((z + low[2]) * ny + y + low[1]) * nx + x + low[0]
        self._glowing = np.union1d(kept, added)

    # textures

    def _make_world(self) -> Any:
        nx, ny, nz = self.size
        if self.storage == "rgba8":
            padded = np.zeros((nz + 2, ny + 2, nx + 2, 4), np.uint8)
            padded[..., 3] = 255
            padded[1:-1, 1:-1, 1:-1] = self.texels
            return self._volume((nx + 2, ny + 2, nz + 2), 4, "f1", padded)
        blocks = voxel_blocks.bordered(voxel_blocks.blocks_of(self.texels))
        inner = blocks[1:-1, 1:-1, 1:-1]
        self.texels = _decoded(inner, self.texels.shape)
        size = blocks.shape[2], blocks.shape[1], blocks.shape[0]
        if self.storage == "bc1":
            return self._volume(size, 2, "u4", blocks.view("<u4"))
        self._compressed = voxel_blocks.CompressedSlices(self.ctx)
        self.uploaded += blocks.nbytes
        return self._adopt(self._compressed.make(blocks), blocks.nbytes)

    def _make_palette(self, albedo: NDArray[np.float32]) -> Any:
        height = -(-len(albedo) // PALETTE_WIDTH)
        data = np.zeros((height * PALETTE_WIDTH, 4), np.float32)
        data[: len(albedo), :3] = albedo
        made = self.ctx.texture((PALETTE_WIDTH, height), 4, data.tobytes(), dtype="f4")
        made.filter = moderngl.NEAREST, moderngl.NEAREST
        return self._adopt(made, data.nbytes)

    def _volume(self, size: tuple[int, ...], components: int, dtype: str, data: Any) -> Any:
        made = self.ctx.texture3d(size, components, _raw(data), alignment=1, dtype=dtype)
        made.filter = moderngl.NEAREST, moderngl.NEAREST
        self.uploaded += data.nbytes
        return self._adopt(made, data.nbytes)

    def _inside(self, box: Box) -> tuple[Any, Any, tuple[slice, ...] | None]:
        low = np.clip(box[0], 0, self.size)
        high = np.clip(box[1], 0, self.size)
        if np.any(high <= low):
            return box[0], box[1], None
        return tuple(low.tolist()), tuple(high.tolist()), _slices(low, high)

    def release(self) -> None:
        """Free all textures; not for those that somebody adopted."""
        for texture in (self.world, self.rows, self.palette, self.gaps):
            if texture is not None:
                texture.release()


def _slices(low: Any, high: Any) -> tuple[slice, ...]:
    return tuple(slice(int(a), int(b)) for a, b in zip(low[::-1], high[::-1], strict=True))


def _raw(data: NDArray[Any]) -> bytes:
    return np.ascontiguousarray(data).tobytes()


def _decoded(blocks: Bytes, shape: tuple[int, ...]) -> Bytes:
    return bc1.decode_image(blocks, (shape[2], shape[1]))


def _around(cells: NDArray[np.int64]) -> Box:
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    return (int(low[0]), int(low[1]), int(low[2])), (int(high[0]), int(high[1]), int(high[2]))


def _joined(boxes: Sequence[tuple[Box, float]]) -> list[Change]:
    """Boxes that touch become one, as long as that does not cost much more cells."""
    found: list[Change] = []
    for (low, high), radiance in boxes:
        for i, other in enumerate(found):
            a, b = np.minimum(low, other.low), np.maximum(high, other.high)
            both = np.prod(np.subtract(high, low)) + np.prod(np.subtract(other.high, other.low))
            if np.prod(b - a) <= 2 * both:
                joint = Change(_triple(a), _triple(b), max(radiance, other.radiance))
                found[i] = joint
                break
        else:
            found.append(Change(low, high, radiance))
    return found


def _triple(values: Any) -> tuple[int, int, int]:
    x, y, z = (int(v) for v in values)
    return x, y, z
