"""Nodes of a .vox file's scene: transforms, groups and shapes (MagicaVoxel's extension).

A transform maps a point p of its child to R p + t, in cells, z up; R has one entry of 1 or -1 a row
and column, mirrors included. Of animations the first frame counts.
"""

from __future__ import annotations

from dataclasses import dataclass

from formats.files.vox_chunks import Cursor

MAX_FRAMES = 1 << 16
MAX_SHIFT = 1 << 20
"""Largest translation of one transform, cells."""

Row = tuple[int, int, int]
Rotation = tuple[Row, Row, Row]

UNTURNED: Rotation = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass(frozen=True)
class Transform:
    """Places one node. layer : -1 where it lies in none. frames : of its animation."""

    child: int
    layer: int = -1
    hidden: bool = False
    rotation: Rotation = UNTURNED
    translation: Row = (0, 0, 0)
    frames: int = 1
    name: str = ""


@dataclass(frozen=True)
class Group:
    """Several nodes."""

    children: tuple[int, ...]
    hidden: bool = False


@dataclass(frozen=True)
class Shape:
    """One model; frames : models of its animation, of which `model` is the first."""

    model: int
    frames: int = 1
    hidden: bool = False


Node = Transform | Group | Shape


def transform(cursor: Cursor) -> tuple[int, Transform]:
    """Read a chunk nTRN: the number of the node, and the node."""
    number, attributes = cursor.integer(), cursor.table()
    child, _, layer, count = cursor.integers(4)
    if not 0 <= count <= MAX_FRAMES:
        raise ValueError(f"a transform has {count} frames")
    frames = [cursor.table() for _ in range(count)]
    first = min(frames, key=_frame, default={})
    node = Transform(
        child,
        layer,
        hidden(attributes),
        rotation(int(first.get("_r", "4"))),
        _translation(first.get("_t", "0 0 0")),
        max(count, 1),
        attributes.get("_name", ""),
    )
    return number, node


def group(cursor: Cursor) -> tuple[int, Group]:
    """Read a chunk nGRP."""
    number, attributes = cursor.integer(), cursor.table()
    children = cursor.integers(max(0, cursor.integer()))
    return number, Group(children, hidden(attributes))


def shape(cursor: Cursor) -> tuple[int, Shape]:
    """Read a chunk nSHP."""
    number, attributes = cursor.integer(), cursor.table()
    count = cursor.integer()
    if not 1 <= count <= MAX_FRAMES:
        raise ValueError(f"a shape has {count} models")
    models = [(cursor.integer(), cursor.table()) for _ in range(count)]
    first = min(models, key=lambda model: _frame(model[1]))
    return number, Shape(first[0], count, hidden(attributes))


def layer(cursor: Cursor) -> tuple[int, bool]:
    """Read a chunk LAYR: the number of the layer, and whether it is hidden."""
    return cursor.integer(), hidden(cursor.table())


def hidden(attributes: dict[str, str]) -> bool:
    """Whether a node or layer is not to be seen."""
    return attributes.get("_hidden", "0").strip() == "1"


def rotation(code: int) -> Rotation:
    """Unpack a rotation; ValueError where it is none.

    Bits 0 and 1 are the column of the first row's entry, 2 and 3 that of the second, the third
    takes the column left; bits 4 to 6 are set for rows with -1.

    >>> rotation(0b1101001)
    ((0, 1, 0), (0, 0, -1), (-1, 0, 0))
    """
    first, second = code & 3, code >> 2 & 3
    if not 0 <= code < 128 or first == second or 3 in (first, second):
        raise ValueError(f"{code} is not a rotation")
    rows = []
    for row, column in enumerate((first, second, 3 - first - second)):
        sign = -1 if code >> (4 + row) & 1 else 1
        rows.append((sign * (column == 0), sign * (column == 1), sign * (column == 2)))
    return rows[0], rows[1], rows[2]


def _translation(text: str) -> Row:
    x, y, z = (int(part) for part in text.split())
    if max(abs(x), abs(y), abs(z)) > MAX_SHIFT:
        raise ValueError(f"a translation of {text} cells is out of range")
    return x, y, z


def _frame(attributes: dict[str, str]) -> int:
    return int(attributes.get("_f", "0"))
