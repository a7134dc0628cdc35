"""Chunks of a .vox file, and the whole numbers, texts and tables in them. Little-endian."""

from __future__ import annotations

import struct
from collections.abc import Iterator

MAX_CHUNKS = 1 << 18
"""Largest number of chunks in a file."""

_CHUNK = struct.Struct("<4sii")
_INTEGER = struct.Struct("<i")


class Cursor:
    """Reads one value after another; ValueError where the bytes end before the value does."""

    def __init__(self, data: memoryview, name: str) -> None:
        self._data, self._name, self._at = data, name, 0

    def integer(self) -> int:
        """Read a signed number of 32 bits."""
        return int(_INTEGER.unpack(self.bytes(4))[0])

    def integers(self, count: int) -> tuple[int, ...]:
        """Read `count` signed numbers of 32 bits."""
        return struct.unpack(f"<{count}i", self.bytes(4 * count))

    def real(self) -> float:
        """Read a float of 32 bits."""
        return float(struct.unpack("<f", self.bytes(4))[0])

    def bytes(self, count: int) -> memoryview:
        """Read `count` bytes."""
        piece = self._data[self._at : self._at + count]
        if count < 0 or len(piece) < count:
            raise ValueError(f"the chunk {self._name} ends too early")
        self._at += count
        return piece

    def rest(self) -> memoryview:
        """Read all that is left."""
        return self.bytes(len(self._data) - self._at)

    def text(self) -> str:
        """Read a text; bytes that are no UTF-8 become replacement characters."""
        return bytes(self.bytes(self.integer())).decode(errors="replace")

    def table(self) -> dict[str, str]:
        """Read a table of texts; of a key that comes twice, the last value."""
        found = {}
        count = self.integer()
        if count < 0:
            raise ValueError(f"the chunk {self._name} holds a table of {count} entries")
        for _ in range(count):
            key = self.text()
            found[key] = self.text()
        return found


def chunks(data: bytes) -> Iterator[tuple[str, Cursor]]:
    """Yield name and content of the chunks inside MAIN, which starts after the 8 bytes of the head.

    Children of a chunk follow its content, as if they stood beside it. Raises ValueError where
    chunks are cut off, before the first is yielded if the file is shorter than MAIN says.
    """
    if len(data) < 8 + _CHUNK.size:
        raise ValueError("the file ends before its first chunk")
    name, content, children = _CHUNK.unpack_from(data, 8)
    at = 8 + _CHUNK.size + content
    end = at + children
    if name != b"MAIN" or content < 0 or children < 0:
        raise ValueError("the first chunk is not MAIN")
    if end > len(data):
        raise ValueError(f"it has {len(data)} bytes where MAIN ends at {end}")
    view = memoryview(data)
    for _ in range(MAX_CHUNKS):
        if at == end:
            return
        if at + _CHUNK.size > end:
            raise ValueError("the last chunk is cut off")
        name, content, _ = _CHUNK.unpack_from(data, at)
        at += _CHUNK.size
        if content < 0 or at + content > end:
            raise ValueError(f"the chunk {name!r} is cut off")
        label = name.decode("latin-1")
        yield label, Cursor(view[at : at + content], label)
        at += content
    raise ValueError(f"it has more than {MAX_CHUNKS} chunks")
