"""Writes MagicaVoxel's .vox files: boxes of cells, their places, a palette, what glows.

Axes are the file's: x to the right, y away, z up; cells (z, y, x) uint8 hold palette indices, 0 for
empty.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.files import atomic
from formats.files.vox_nodes import rotation

SIDE = 256  # most cells along a side of a model
UNTURNED = 4


@dataclass(frozen=True, eq=False)
class Part:
    """A box of cells. lowest : (x, y, z) of its lowest corner in the world, as turned. turn :
    packed rotation, as in `vox_nodes.rotation`. layer : number of its layer, or -1.
    """

    cells: NDArray[np.uint8]
    lowest: tuple[int, int, int] = (0, 0, 0)
    name: str = ""
    turn: int = UNTURNED
    layer: int = -1
    hidden: bool = False


@dataclass(frozen=True)
class Glow:
    """How a palette index glows: radiance is its linear colour times weight times 10^flux."""

    weight: float = 1.0
    flux: float = 0.0


def write(
    path: Path,
    parts: Sequence[Part],
    palette: Mapping[int, str],
    glow: Mapping[int, Glow] | None = None,
    *,
    hidden_layers: Sequence[int] = (),
    version: int = 150,
) -> None:
    """Write a file. palette : "#rrggbb" by index from 1 to 255; others are black. Parts of more
    than 256 cells a side become several models, empty ones none."""
    pieces = [piece for part in parts for piece in _pieces(part) if piece.cells.any()]
    body = b"".join(_model(piece.cells) for piece in pieces)
    body += _scene(pieces)
    for layer in hidden_layers:
        body += _chunk("LAYR", _integers(layer) + _table({"_hidden": "1"}) + _integers(-1))
    colours = np.zeros((256, 4), np.uint8)
    for index, text in palette.items():
        colours[index - 1] = [*bytes.fromhex(text.removeprefix("#")), 255]
    body += _chunk("RGBA", colours.tobytes())
    for index, each in (glow or {}).items():
        entries = {"_type": "_emit", "_emit": f"{each.weight:g}", "_flux": f"{each.flux:g}"}
        body += _chunk("MATL", _integers(index) + _table(entries))
    head = b"VOX " + _integers(version) + b"MAIN" + _integers(0, len(body))
    atomic.write_bytes(path, head + body)


def _pieces(part: Part) -> Iterator[Part]:
    """Cut a part into boxes that fit into a model; only parts that are not turned can be cut."""
    if max(part.cells.shape) <= SIDE:
        yield part
        return
    if part.turn != UNTURNED:
        raise ValueError("A part of more than 256 cells a side cannot be turned.")
    depth, height, width = part.cells.shape
    for z in range(0, depth, SIDE):
        for y in range(0, height, SIDE):
            for x in range(0, width, SIDE):
                box = part.cells[z : z + SIDE, y : y + SIDE, x : x + SIDE]
                a, b, c = part.lowest
                corner = (a + x, b + y, c + z)
                yield Part(box, corner, part.name, layer=part.layer, hidden=part.hidden)


def _model(cells: NDArray[np.uint8]) -> bytes:
    z, y, x = np.nonzero(cells)
    listed = np.stack([x, y, z, cells[z, y, x]], axis=1).astype(np.uint8)
    size = _chunk("SIZE", _integers(*cells.shape[::-1]))
    return size + _chunk("XYZI", _integers(len(listed)) + listed.tobytes())


def _scene(pieces: Sequence[Part]) -> bytes:
    """Return node 0, a transform of the group 1, which holds a transform and a shape a piece."""
    children = [2 + 2 * i for i in range(len(pieces))]
    found = _transform(0, 1, {}, -1, {})
    group = _integers(1) + _table({}) + _integers(len(children), *children)
    found += _chunk("nGRP", group)
    for i, piece in enumerate(pieces):
        named = {"_name": piece.name} if piece.name else {}
        named |= {"_hidden": "1"} if piece.hidden else {}
        frame = {"_r": str(piece.turn)} if piece.turn != UNTURNED else {}
        frame["_t"] = " ".join(str(t) for t in _translation(piece))
        found += _transform(children[i], children[i] + 1, named, piece.layer, frame)
        shape = _integers(children[i] + 1) + _table({}) + _integers(1, i) + _table({})
        found += _chunk("nSHP", shape)
    return found


def _translation(piece: Part) -> list[int]:
    """Return where the model's pivot, floor(size / 2), has to go."""
    size = np.array(piece.cells.shape[::-1])
    R = np.array(rotation(piece.turn))
    corners = np.stack([-(size // 2), size - size // 2]) @ R.T
    return [int(t) for t in np.array(piece.lowest) - corners.min(axis=0)]


def _transform(
    number: int, child: int, attributes: dict[str, str], layer: int, frame: dict[str, str]
) -> bytes:
    node = _integers(number) + _table(attributes) + _integers(child, -1, layer, 1)
    return _chunk("nTRN", node + _table(frame))


def _chunk(name: str, content: bytes) -> bytes:
    return name.encode() + _integers(len(content), 0) + content


def _integers(*values: int) -> bytes:
    return struct.pack(f"<{len(values)}i", *values)


def _table(entries: Mapping[str, str]) -> bytes:
    texts = [text.encode() for pair in entries.items() for text in pair]
    return _integers(len(entries)) + b"".join(_integers(len(t)) + t for t in texts)
