"""Drawn or painted pictures as sources of sprites: how large they are, without decoding a pixel."""

import struct
from pathlib import Path

from formats.errors import InputError

SUFFIXES = (".png", ".exr")
MAGIC = b"\x76\x2f\x31\x01"
MAX_HEADER = 1 << 16  # bytes
MOST_TEXELS = 4096  # of the longer side of what is baked


def is_picture(source: Path) -> bool:
    """Tell whether a source is a picture by its name."""
    return source.suffix.lower() in SUFFIXES


def size(source: Path) -> tuple[int, int]:
    """(width, height) in texels. InputError where it is no picture."""
    if source.suffix.lower() == ".exr":
        return _size_of_exr(source)
    from PIL import Image

    from formats.files.reading import refusing

    with refusing(str(source), "PNG picture"), Image.open(source, formats=("PNG",)) as picture:
        return picture.size


def baked_size(source: Path, resolution: int) -> tuple[int, int]:
    """(width, height) after shrinking the longer side to `resolution` texels, 0 for not at all.

    Raises InputError where it is no picture or more than MOST_TEXELS are left.
    """
    width, height = size(source)
    longer = max(width, height)
    if 0 < resolution < longer:
        shares = (n * resolution / longer for n in (width, height))
        width, height = (max(1, round(n)) for n in shares)
    if max(width, height) > MOST_TEXELS:
        remedy = f"write resolution = {MOST_TEXELS} or less in the set, which shrinks it"
        raise InputError(source, "size", f"{width} x {height}", remedy)
    return width, height


def _size_of_exr(source: Path) -> tuple[int, int]:
    """Read dataWindow in the header of the first part: attributes of name, type, size, bytes."""
    from formats.files.reading import refusing

    with refusing(str(source), "OpenEXR picture"), source.open("rb") as file:
        data = file.read(MAX_HEADER)
        if data[:4] != MAGIC:
            raise ValueError("it does not start as one")
        at = 8
        while data[at : at + 1] != b"\0":
            name, kind, rest = data[at:].split(b"\0", 2)
            start = len(data) - len(rest)
            (length,) = struct.unpack_from("<i", data, start)
            if name == b"dataWindow" and kind == b"box2i":
                left, top, right, bottom = struct.unpack_from("<4i", data, start + 4)
                if right >= left and bottom >= top:
                    return right - left + 1, bottom - top + 1
            if length < 0:
                break
            at = start + 4 + length
        raise ValueError("its header names no size")
