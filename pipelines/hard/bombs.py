"""Hard cases of small files that promise, or unfold to, gigabytes."""

from __future__ import annotations

import struct
import sys
import time
import zlib
from collections.abc import Callable
from functools import partial

from pipelines.hard.cells import Family, Result, at_most
from pipelines.hard.files import must_refuse, sound

bombs = Family("small files that promise gigabytes")
MOST = 64 << 20  # bytes
SECONDS = 0.5  # of the processor
TEXELS = 16000
"""A side: 1 GB as RGBA8. Every codec takes such a side, and none such a square of so few bytes."""


def _png() -> bytes:
    """A head with its right checksum."""
    data = bytearray(sound("png"))
    data[16:24] = struct.pack(">II", TEXELS, TEXELS)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    return bytes(data)


def _exr() -> bytes:
    data = bytearray(sound("exr"))
    for name in (b"dataWindow\0", b"displayWindow\0"):
        at = data.index(name) + len(name) + len(b"box2i\0") + 4
        data[at : at + 16] = struct.pack("<4i", 0, 0, TEXELS - 1, TEXELS - 1)
    return bytes(data)


def _hdr() -> bytes:
    head, lines = sound("hdr").split(b"-Y 16 +X 16\n")
    return head + f"-Y {TEXELS} +X {TEXELS}\n".encode() + lines


def _ktx2(name: str) -> bytes:
    """Width and height, and what the first level says that it unfolds to."""
    data = bytearray(sound(name))
    data[20:28] = struct.pack("<II", TEXELS, TEXELS)
    data[96:104] = struct.pack("<Q", 4 * TEXELS * TEXELS)
    return bytes(data)


def _unfolding() -> bytes:
    """A level of the right size whose bytes unfold to 256 MiB."""
    import zstandard

    data = bytearray(sound("ktx2, zstd"))
    bomb = zstandard.compress(bytes(1 << 28))
    data[80:96] = struct.pack("<QQ", len(data), len(bomb))
    return bytes(data) + bomb


def _dds() -> bytes:
    data = bytearray(sound("dds"))
    data[12:20] = struct.pack("<II", TEXELS, TEXELS)
    return bytes(data)


def _vox() -> bytes:
    """Three cells in a model of 2^31 - 1 a side, and half as many cells promised."""
    size, cells = struct.pack("<iii", 2, 2, 2), struct.pack("<i", 3)
    data = sound("vox").replace(size, struct.pack("<iii", *3 * (2**31 - 1,)), 1)
    at = data.index(b"XYZI") + 12
    return data[:at] + data[at:].replace(cells, struct.pack("<i", 2**30), 1)


def _xraw() -> bytes:
    data = bytearray(sound("xraw"))
    data[8:20] = struct.pack("<3I", *3 * (2**20,))
    return bytes(data)


def _ply() -> bytes:
    return sound("mesh .ply").replace(b"vertex 4", b"vertex 4000000000")


def _glb(name: str) -> bytes:
    """As long a text, so that no other length is wrong."""
    return sound(name).replace(b'"count":256', b'"count":9e9')


BOMBS: dict[str, Callable[[], bytes]] = {
    "png": _png, "exr": _exr, "hdr": _hdr, "dds": _dds, "ktx2": lambda: _ktx2("ktx2"),
    "ktx2, zstd": lambda: _ktx2("ktx2, zstd"), "ktx2, 256 MiB unfold": _unfolding,
    "vox": _vox, "xraw": _xraw, "glb": lambda: _glb("glb"),
    "mesh .glb": lambda: _glb("mesh .glb"), "mesh .ply": _ply,
}  # fmt: skip

bombs.row("F13", "sizes, counts and compressed parts of gigabytes", "refused",
          f"before they are taken: {SECONDS:g} s and {MOST >> 20} MiB at the most")  # fmt: skip


def _harmless(name: str) -> Result:
    """Refused, in little time of the processor and little memory more than there ever was."""
    codec, data = name.partition(", 256")[0] + (", zstd" if "256" in name else ""), BOMBS[name]()
    if data == sound(codec):
        return Result("failed", said="the file is sound")
    begin, peak = time.process_time(), _peak()
    found = must_refuse(codec, data)
    spent = at_most(time.process_time() - begin, SECONDS, found.said)
    grown = at_most(_peak() - peak, MOST, found.said)
    return next((each for each in (found, spent, grown) if not each.good), found)


def _peak() -> int:
    """Return the most memory that this process ever had, in bytes; 0 where nobody tells."""
    try:
        import resource
    except ImportError:
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most


for _name in BOMBS:
    bombs.add("F13", _name, partial(_harmless, _name))
