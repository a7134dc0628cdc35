"""Bytes of .vox files, chunk by chunk, as the format describes them."""

import struct
from collections.abc import Sequence


def integers(*values: int) -> bytes:
    return struct.pack(f"<{len(values)}i", *values)


def table(**entries: str) -> bytes:
    texts = [text.encode() for pair in entries.items() for text in pair]
    return integers(len(entries)) + b"".join(integers(len(t)) + t for t in texts)


def chunk(name: str, content: bytes = b"", children: bytes = b"") -> bytes:
    return name.encode() + integers(len(content), len(children)) + content + children


def model(size: Sequence[int], cells: Sequence[Sequence[int]]) -> bytes:
    """SIZE and XYZI; cells : x, y, z, index."""
    listed = b"".join(bytes(cell) for cell in cells)
    return chunk("SIZE", integers(*size)) + chunk("XYZI", integers(len(cells)) + listed)


def transform(
    number: int, child: int, frames: Sequence[bytes] = (), *, layer: int = -1, **attributes: str
) -> bytes:
    frames = frames or [table()]
    node = integers(number) + table(**attributes) + integers(child, -1, layer, len(frames))
    return chunk("nTRN", node + b"".join(frames))


def group(number: int, *children: int, **attributes: str) -> bytes:
    node = integers(number) + table(**attributes)
    return chunk("nGRP", node + integers(len(children), *children))


def shape(number: int, *models: int, **attributes: str) -> bytes:
    node = integers(number) + table(**attributes) + integers(len(models))
    return chunk("nSHP", node + b"".join(integers(m) + table() for m in models))


def colours(*palette: tuple[int, int, int]) -> bytes:
    """RGBA of 256 colours, black after those given."""
    stored = b"".join(bytes([*rgb, 255]) for rgb in palette)
    return chunk("RGBA", stored + bytes(1024 - len(stored)))


def material(index: int, **entries: str) -> bytes:
    return chunk("MATL", integers(index) + table(**entries))


def whole(*parts: bytes, version: int = 150) -> bytes:
    return b"VOX " + integers(version) + chunk("MAIN", b"", b"".join(parts))


ONE = model((1, 1, 1), [(0, 0, 0, 1)])
"""A model of one cell."""
