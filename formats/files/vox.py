"""MagicaVoxel's .vox, versions 150 and 200: models, scene, palette, materials.

Axes are the file's own: x to the right, y away, z up. Read are SIZE with XYZI (or TDCZ, the packed
cells of Teardown), PACK, RGBA, IMAP, MATL, MATT, nTRN, nGRP, nSHP and LAYR; other chunks are left
out.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files import vox_nodes, vox_palette
from formats.files.reading import read_bytes, refusing
from formats.files.vox_chunks import Cursor, chunks
from formats.files.vox_nodes import Node
from formats.files.vox_palette import COLOURS, Material

MAX_FILE_BYTES = 1 << 28
"""Largest file."""
MAX_SIDE = 256
"""Largest side of a model, cells: its coordinates are bytes."""
MAX_MODELS = 1 << 16
"""Largest number of models."""
VERSIONS = (150, 200)


@dataclass(frozen=True, eq=False)
class Model:
    """size : (x, y, z) cells. cells : (n, 4) uint8, x, y, z and palette index, none of index 0; of
    cells at one place, the last counts."""

    size: tuple[int, int, int]
    cells: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class VoxFile:
    """models : in file order. nodes : the scene by number, empty in old files. hidden_layers :
    numbers of layers. palette : (256, 4) uint8 sRGB and alpha, by palette index as the editor shows
    it. materials : 256, by palette index. notes : what a user should know of what was read. name :
    what errors call it.
    """

    version: int
    models: tuple[Model, ...]
    nodes: dict[int, Node]
    hidden_layers: frozenset[int]
    palette: NDArray[np.uint8]
    materials: tuple[Material, ...]
    notes: tuple[str, ...] = ()
    name: str = "scene"


def read(path: Path) -> VoxFile:
    """Read a file; InputError as in `decode`, and where it is missing or over `MAX_FILE_BYTES`."""
    return decode(read_bytes(path, MAX_FILE_BYTES), str(path))


def decode(data: bytes, name: str) -> VoxFile:
    """Read the bytes of a file; `name` is what errors call it.

    Raises InputError for other versions, for what is cut off, for cells outside of their model, for
    nodes that are not there, and for numbers out of range.
    """
    with refusing(name, ".vox file"):
        if data[:4] != b"VOX ":
            raise ValueError("it does not start with VOX")
        (version,) = struct.unpack_from("<i", data, 4)
        if version not in VERSIONS:
            raise InputError(name, "version", version, "save it with MagicaVoxel 0.98 or later")
        parts = _Parts()
        for kind, cursor in chunks(data):
            parts.take(kind, cursor)
        return parts.whole(version, name)


@dataclass
class _Parts:
    """What the chunks that have been read hold."""

    models: list[Model] = field(default_factory=list)
    size: tuple[int, int, int] | None = None
    nodes: dict[int, Node] = field(default_factory=dict)
    hidden_layers: set[int] = field(default_factory=set)
    palette: NDArray[np.uint8] = field(default_factory=vox_palette.default)
    shown: NDArray[np.uint8] | None = None
    materials: dict[int, Material] = field(default_factory=dict)
    old_materials: dict[int, Material] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def take(self, kind: str, cursor: Cursor) -> None:
        """Read one chunk."""
        if kind == "SIZE":
            self.size = _size(cursor.integers(3))
        elif kind in ("XYZI", "TDCZ"):
            if self.size is None:
                raise ValueError(f"a chunk {kind} comes without SIZE")
            if len(self.models) == MAX_MODELS:
                raise ValueError(f"it has more than {MAX_MODELS} models")
            cells = _listed(cursor) if kind == "XYZI" else _packed(cursor, self.size)
            self.models.append(_model(self.size, cells))
            self.size = None
        elif kind == "RGBA":
            self.palette = vox_palette.colours(cursor)
        elif kind == "IMAP":
            self.shown = vox_palette.shown(cursor)
            if self.shown is None:
                self.notes.append("the palette's order (IMAP) is no reordering: left out")
        elif kind == "LAYR":
            number, hidden = vox_nodes.layer(cursor)
            (self.hidden_layers.add if hidden else self.hidden_layers.discard)(number)
        else:
            self._take_table(kind, cursor)

    def _take_table(self, kind: str, cursor: Cursor) -> None:
        """Read a chunk that defines a numbered thing; other chunks are left out."""
        if kind == "MATL":
            index, material = vox_palette.material(cursor)
            self.materials[index] = material
        elif kind == "MATT":
            index, material = vox_palette.old_material(cursor)
            self.old_materials[index] = material
        elif kind in _NODES:
            number, node = _NODES[kind](cursor)
            if number in self.nodes:
                raise ValueError(f"two nodes have the number {number}")
            self.nodes[number] = node

    def whole(self, version: int, name: str) -> VoxFile:
        """Put the parts together, by the palette indices that the editor shows."""
        if not self.models:
            raise ValueError("it holds no model")
        palette, models = self.palette, tuple(self.models)
        stored = self.materials or self.old_materials
        order = np.arange(COLOURS)
        if self.shown is not None:
            order = self.shown.astype(np.intp)
            palette = palette[order]
            models = tuple(_renumbered(model, order) for model in models)
        return VoxFile(
            version,
            models,
            self.nodes,
            frozenset(self.hidden_layers),
            palette,
            tuple(stored.get(int(index), Material()) for index in order),
            tuple(self.notes),
            name,
        )


_NODES: dict[str, Callable[[Cursor], tuple[int, Node]]] = {
    "nTRN": vox_nodes.transform,
    "nGRP": vox_nodes.group,
    "nSHP": vox_nodes.shape,
}


def _size(sides: tuple[int, ...]) -> tuple[int, int, int]:
    if not all(0 < side <= MAX_SIDE for side in sides):
        raise ValueError(f"a model of {sides} cells: each side must be 1 to {MAX_SIDE}")
    return sides[0], sides[1], sides[2]


def _listed(cursor: Cursor) -> NDArray[np.uint8]:
    """Read cells one by one."""
    count = cursor.integer()
    return np.frombuffer(cursor.bytes(4 * count), np.uint8).reshape(-1, 4)


def _packed(cursor: Cursor, size: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Read a box of palette indices, x fastest, then y; zlib's end mark is often missing."""
    if cursor.integers(3) != size:
        raise ValueError("the packed cells are not of their model's size")
    expected = size[0] * size[1] * size[2]
    box = zlib.decompressobj().decompress(cursor.rest(), expected + 1)
    if len(box) != expected:
        raise ValueError(f"a model packs {len(box)} cells or more where {expected} belong")
    indices = np.frombuffer(box, np.uint8).reshape(size[::-1])
    z, y, x = np.nonzero(indices)
    return np.stack([x, y, z, indices[z, y, x]], axis=1).astype(np.uint8)


def _model(size: tuple[int, int, int], cells: NDArray[np.uint8]) -> Model:
    if np.any(cells[:, :3].astype(np.int32) >= size):
        raise ValueError(f"a cell lies outside of its model of {size} cells")
    return Model(size, cells[cells[:, 3] > 0])


def _renumbered(model: Model, order: NDArray[np.intp]) -> Model:
    """Turn stored indices into those that the editor shows."""
    shown = np.zeros(COLOURS, np.uint8)
    shown[order] = np.arange(COLOURS)
    cells = model.cells.copy()
    cells[:, 3] = shown[cells[:, 3]]
    return replace(model, cells=cells)
