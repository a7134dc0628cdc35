"""Damage that gets past a reader's first look: numbers at the edges of their types, chunks moved
and cut with their lengths and checksums made right again, words of text exchanged.

Every mutation is a pure function of (bytes, random.Random) and changes a few places at most, so
that most of the file still makes sense.
"""

from __future__ import annotations

import json
import re
import struct
import zlib
from collections.abc import Callable
from random import Random
from typing import Any

Mutation = Callable[[bytes, Random], bytes]

NUMBERS = (0, 1, 2, 3, 4, 7, 8, 127, 128, 255, 256, 32767, 32768, 65535, 65536)
NUMBERS += ((1 << 20) + 1, (1 << 24) - 1, (1 << 31) - 1, 1 << 31, (1 << 32) - 1, (1 << 32) - 16)
REALS = (0.0, -0.0, 1e-45, -1.0, 65504.0, 1e38, 3.5e38, float("inf"), float("-inf"), float("nan"))
WORDS = (
    b"nan",
    b"inf",
    b"-inf",
    b"1e999",
    b"-1",
    b"0",
    b"1",
    b"99999999999",
    b"4294967296",
    b"0x10",
)
WORDS += (
    b"1e-320",
    b"''",
    b'""',
    b"null",
    b"true",
    b"[]",
    b"{}",
    b"../x",
    b"\xff\xfe",
    b"\0",
    b"a" * 300,
)
VALUES: tuple[Any, ...] = (None, True, False, 0, -1, 1, 2**31, 2**63, 10**400, 1e308, -1e-320, 0.5)
VALUES += ("", "x", "../../etc/passwd", "a" * 1000, [], {}, [[]], [0] * 5, {"a": 1}, "\0", "é")


def flip(data: bytes, rng: Random) -> bytes:
    """Flip a few bits."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        if found:
            found[rng.randrange(len(found))] ^= 1 << rng.randrange(8)
    return bytes(found)


def number(data: bytes, rng: Random) -> bytes:
    """Write an edge of a number's type at a place, more often in the first bytes."""
    width, order = rng.choice((1, 2, 4, 4, 8)), rng.choice("<>")
    if rng.random() < 0.2:
        word = struct.pack(f"{order}{rng.choice('fd')}", *_real(rng))
    else:
        word = (rng.choice(NUMBERS) % (1 << 8 * width)).to_bytes(
            width, "little" if order == "<" else "big"
        )
    at = rng.randrange(max(1, min(len(data), rng.choice((16, 128, len(data) or 1)))))
    at -= at % rng.choice((1, width))
    return data[:at] + word + data[at + len(word) :]


def _real(rng: Random) -> tuple[float]:
    value = rng.choice(REALS)
    return (value if abs(value) < 3.4e38 or value != value or abs(value) == float("inf") else 1e38,)


def cut(data: bytes, rng: Random) -> bytes:
    """End early, or go on."""
    if rng.random() < 0.7:
        return data[: rng.randrange(len(data) + 1)]
    return data + rng.randbytes(rng.choice((1, 4, 100)))


def splice(data: bytes, rng: Random) -> bytes:
    """Move, double or drop a run of bytes."""
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    b = min(b, a + rng.choice((1, 4, 16, 256)))
    at = rng.randrange(len(data) + 1)
    kept = data if rng.random() < 0.5 else data[:a] + data[b:]
    return kept[:at] + data[a:b] * rng.choice((0, 1, 1, 8)) + kept[at:]


def words(data: bytes, rng: Random) -> bytes:
    """Exchange a word or a number of a text, or double, drop, swap or join lines."""
    if rng.random() < 0.7:
        found = list(re.finditer(rb"[^\s,\[\]{}=:\"]+", data))
        if found:
            match = rng.choice(found)
            word = rng.choice(WORDS) if rng.random() < 0.7 else rng.choice(found)[0]
            return data[: match.start()] + word + data[match.end() :]
    lines = data.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    what = rng.randrange(4)
    if what == 0:
        del lines[a]
    elif what == 1:
        lines.insert(a, lines[b])
    elif what == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a] += rng.choice((b"", b" ", b"\r", b"#", b"\\")) + lines[b]
    return b"\n".join(lines)


def tree(data: bytes, rng: Random) -> bytes:
    """Exchange, drop or double a value anywhere in a JSON text."""
    root = json.loads(data)
    places: list[tuple[Any, Any]] = []
    stack = [root]
    while stack:
        node = stack.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node))
        for key in keys:
            places.append((node, key))
            if isinstance(node[key], dict | list):
                stack.append(node[key])
    for _ in range(rng.choice((1, 1, 2))):
        if not places:
            break
        node, key = rng.choice(places)
        other, at = rng.choice(places)
        try:
            what = rng.randrange(4)
            if what == 0:
                del node[key]
            elif what == 1:
                node[key] = json.loads(json.dumps(other[at]))
            else:
                node[key] = rng.choice(VALUES)
        except (IndexError, KeyError, ValueError, RecursionError):
            pass
    return json.dumps(root).encode("utf-8", "surrogatepass")


def png(data: bytes, rng: Random) -> bytes:
    """Damage chunks of a PNG, or pixels before they are packed, and make checksums right."""
    chunks, at = [], 8
    while at + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, at)
        chunks.append([data[at + 4 : at + 8], data[at + 8 : at + 8 + size]])
        at += 12 + size
    chosen = rng.randrange(len(chunks))
    kind, body = chunks[chosen]
    what = rng.randrange(6)
    if what == 0:
        chunks[chosen][1] = rng.choice((flip, number, cut, splice))(body, rng)
    elif what == 1 and kind == b"IDAT":
        raw = rng.choice((flip, cut, splice))(zlib.decompress(body), rng)
        chunks[chosen][1] = zlib.compress(raw, 1)
    elif what == 2:
        chunks.insert(rng.randrange(len(chunks) + 1), list(chunks[chosen]))
    elif what == 3:
        del chunks[chosen]
    elif what == 4:
        chunks[chosen][0] = rng.choice(
            (b"PLTE", b"tRNS", b"gAMA", b"zzzz", b"IEND", b"iCCP", b"acTL")
        )
    else:
        header = bytearray(chunks[0][1])
        if len(header) == 13:
            at = rng.choice((0, 4, 8, 9, 10, 11, 12))
            header[at : at + 1] = bytes([rng.choice((0, 1, 2, 3, 4, 6, 8, 16, 127, 255))])
        chunks[0][1] = bytes(header)
    packed = [
        struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in chunks
    ]
    return data[:8] + b"".join(packed)


def glb(data: bytes, rng: Random) -> bytes:
    """Damage the JSON or the binary of a GLB file and make its lengths right."""
    (size,) = struct.unpack_from("<I", data, 12)
    text, binary = data[20 : 20 + size], data[20 + size + 8 :]
    if rng.random() < 0.8:
        text = tree(text, rng)
    else:
        binary = rng.choice((flip, number, cut, splice))(binary, rng)
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def vox(data: bytes, rng: Random) -> bytes:
    """Damage a chunk of a .vox file, or the order of chunks, and make lengths right."""
    chunks, at = [], 20
    while at + 12 <= len(data):
        size, children = struct.unpack_from("<ii", data, at + 4)
        chunks.append([data[at : at + 4], data[at + 12 : at + 12 + size]])
        at += 12 + size + children
    chosen = rng.randrange(len(chunks))
    what = rng.randrange(5)
    if what <= 2:
        damage = rng.choice((flip, number, number, cut, splice))
        chunks[chosen][1] = damage(chunks[chosen][1], rng)
    elif what == 3:
        chunks.insert(rng.randrange(len(chunks) + 1), list(chunks[chosen]))
    else:
        other = rng.randrange(len(chunks))
        chunks[chosen], chunks[other] = chunks[other], chunks[chosen]
    body = b"".join(k + struct.pack("<ii", len(b), 0) + b for k, b in chunks)
    return data[:12] + struct.pack("<ii", 0, len(body)) + body


BINARY: tuple[Mutation, ...] = (flip, number, number, cut, splice)
TEXT: tuple[Mutation, ...] = (words, words, words, flip, cut, splice)


def mutate(data: bytes, rng: Random, mutations: tuple[Mutation, ...]) -> bytes:
    """Apply one to three mutations; one that cannot be applied to what the others made is left."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        try:
            data = rng.choice(mutations)(data, rng)
        except (ValueError, IndexError, KeyError, struct.error, zlib.error, RecursionError):
            continue
    return data
