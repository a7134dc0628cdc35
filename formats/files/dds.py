"""DDS textures: 2D, 2D array and 3D; BC1 and RGBA8, linear (Microsoft, DDS Programming Guide).

Headers of both ages are read, by FourCC or masks and DX10; writing takes either. Layers follow each
other with all their levels; a level of a volume holds all its slices. Everything is little-endian.
"""

from __future__ import annotations

import struct
from math import prod
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files import atomic, texture
from formats.files.reading import read_bytes, refusing
from formats.files.texture import BC1, MAX_BYTES, RGBA8, Format, Kind, Texture

__all__ = ["MAX_BYTES", "Texture", "decode", "encode", "read", "write"]

# Magic; size, flags, height, width, pitch, depth, mips, 11 reserved; pixel format (size, flags,
# FourCC, bits, 4 masks); caps, caps2, caps3, caps4, reserved
_HEADER = struct.Struct("<4s7I44s2I4s5I5I")
_DX10 = struct.Struct("<5I")  # DXGI format, dimension, misc flags, array size, misc flags 2
_CAPS, _HEIGHT, _WIDTH, _PITCH, _FORMAT = 0x1, 0x2, 0x4, 0x8, 0x1000
_MIPS, _LINEAR_SIZE, _DEPTH = 0x20000, 0x80000, 0x800000
_ALPHA, _FOURCC, _RGB = 0x1, 0x4, 0x40  # of the pixel format
_COMPLEX, _TEXTURE, _MIPMAP = 0x8, 0x1000, 0x400000  # caps
_CUBE, _VOLUME = 0xFE00, 0x200000  # caps2
_DIMENSION = {"array": 3, "volume": 4}
_PREMULTIPLIED = 2  # in misc flags 2
_DXGI = {28: RGBA8, 71: BC1}  # R8G8B8A8_UNORM, BC1_UNORM
_RGBA = (0xFF, 0xFF00, 0xFF0000, 0xFF000000)
_BGRA = (0xFF0000, 0xFF00, 0xFF, 0xFF000000)


def write(path: Path, content: Texture, *, header: Literal["dx10", "fourcc"] = "dx10") -> None:
    """Write a texture atomically.

    header : "dx10" says the format and how many layers; "fourcc" is what older tools read, and has
    no layers. Raises InputError for other formats than BC1 and RGBA8, and as `texture.check` does.
    Metadata is not kept: DDS has none.
    """
    atomic.write_bytes(path, encode(content, header=header, name=str(path)))


def read(path: Path) -> Texture:
    """Read a texture; InputError as in `decode`."""
    return decode(read_bytes(path, MAX_BYTES), str(path))


def encode(
    content: Texture, *, header: Literal["dx10", "fourcc"] = "dx10", name: str = "texture"
) -> bytes:
    """Bytes of a DDS file; see `write`."""
    texture.check(name, content)
    form, (layers, height, width) = content.format, content.size
    volume, count = content.kind == "volume", len(content.levels)
    if form not in _DXGI.values():
        raise InputError(name, "format", form.name, "use BC1 or RGBA8")
    if header not in ("dx10", "fourcc"):
        raise InputError(name, "header", header, "use dx10 or fourcc")
    if header == "fourcc" and not volume and layers > 1:
        raise InputError(name, "layers", layers, "write arrays with the DX10 header")
    flags = _CAPS | _HEIGHT | _WIDTH | _FORMAT | (_MIPS if count > 1 else 0)
    flags |= (_LINEAR_SIZE if form is BC1 else _PITCH) | (_DEPTH if volume else 0)
    rows, columns = texture.level_shape(form, content.size, content.kind, 0)[1:3]
    pitch = columns * form.bytes * (rows if form is BC1 else 1)
    caps = _TEXTURE | (_COMPLEX if count > 1 or volume or layers > 1 else 0)
    head = _HEADER.pack(
        b"DDS ",
        *(124, flags, height, width, pitch, layers if volume else 0, count),
        b"",
        *_pixel_format(form, header),
        *(caps | (_MIPMAP if count > 1 else 0), _VOLUME if volume else 0, 0, 0, 0),
    )
    if header == "dx10":
        number = next(number for number, each in _DXGI.items() if each is form)
        head += _DX10.pack(
            number, _DIMENSION[content.kind], 0, 1 if volume else layers, _PREMULTIPLIED
        )
    if volume:
        return head + b"".join(level.tobytes() for level in content.levels)
    return head + b"".join(
        level[layer].tobytes() for layer in range(layers) for level in content.levels
    )


def _pixel_format(form: Format, header: str) -> tuple[Any, ...]:
    if header == "dx10":
        return 32, _FOURCC, b"DX10", 0, 0, 0, 0, 0
    if form is BC1:
        return 32, _FOURCC, b"DXT1", 0, 0, 0, 0, 0
    return 32, _RGB | _ALPHA, b"", 32, *_RGBA


def decode(data: bytes, name: str) -> Texture:
    """Texture from the bytes of a DDS file; `name` is what errors call it.

    Bytes after the last level are taken for what some tools append, and ignored. Raises InputError
    for anything but a whole 2D, 2D array or 3D file in one of the formats above, before more than
    the file's own size is allocated.
    """
    with refusing(name, "DDS texture"):
        return _decoded(data, name)


def _decoded(data: bytes, name: str) -> Texture:
    magic, size, _, height, width, _, depth, count, _, *rest = _HEADER.unpack_from(data)
    pixel_format, (_, caps2, *_) = rest[:8], rest[8:]
    if magic != b"DDS " or size != 124 or pixel_format[0] != 32:
        raise ValueError("it does not start with a DDS header")
    if caps2 & _CUBE:
        raise InputError(name, "caps2", hex(caps2), "use a 2D or 3D texture, not a cube map")
    at, layers, swapped = _HEADER.size, 1, False
    kind: Kind = "volume" if caps2 & _VOLUME else "array"
    if pixel_format[1] & _FOURCC and pixel_format[2] == b"DX10":
        number, dimension, misc, layers, _ = _DX10.unpack_from(data, at)
        at += _DX10.size
        form = _known(name, "DXGI format", number, _DXGI.get(number))
        if dimension not in _DIMENSION.values() or misc & 0x4:
            remedy = "use a 2D or 3D texture, not a cube map or a 1D one"
            raise InputError(name, "dimension", dimension, remedy)
        kind = "volume" if dimension == 4 else "array"
        if kind == "volume" and layers > 1:
            raise InputError(name, "array size", layers, "use no arrays of volumes")
    else:
        form, swapped = _old_format(name, pixel_format)

    # Refuse what is too large, or cut off, before any of it is copied
    whole = (depth if kind == "volume" else layers, height, width)
    shapes = texture.check_declared(name, form, whole, kind, max(count, 1))
    needed = sum(prod(shape) for shape in shapes)
    if at + needed > len(data):
        raise ValueError(f"it holds {len(data) - at} bytes of levels where {needed} belong")
    levels = _levels(np.frombuffer(data, np.uint8, needed, at), shapes, kind)
    if swapped:
        levels = [level[..., (2, 1, 0, 3)] for level in levels]
    for level in levels:
        level.flags.writeable = False
    return Texture(tuple(levels), kind, {}, (width, height) if form is BC1 else None)


def _levels(
    body: NDArray[np.uint8], shapes: list[tuple[int, int, int, int]], kind: str
) -> list[NDArray[np.uint8]]:
    """Cut the body into levels; in arrays, each layer has all of them."""
    if kind == "volume":
        ends = np.cumsum([prod(shape) for shape in shapes])[:-1]
        return [p.reshape(s) for p, s in zip(np.split(body, ends), shapes, strict=True)]
    layers = body.reshape(shapes[0][0], -1)
    ends = np.cumsum([prod(shape[1:]) for shape in shapes])[:-1]
    pieces = np.split(layers, ends, axis=1)
    return [np.ascontiguousarray(p).reshape(s) for p, s in zip(pieces, shapes, strict=True)]


def _old_format(name: str, pixel_format: list[Any]) -> tuple[Format, bool]:
    """Return the format of a header without DX10, and whether red and blue are swapped."""
    _, flags, fourcc, bits, *masks = pixel_format
    if flags & _FOURCC:
        shown = fourcc.decode("ascii", "replace")
        return _known(name, "FourCC", shown, BC1 if fourcc == b"DXT1" else None), False
    plain = flags & _RGB and flags & _ALPHA and bits == 32 and tuple(masks) in (_RGBA, _BGRA)
    shown = f"{bits} bits, {' '.join(f'{mask:#x}' for mask in masks)}"
    return _known(name, "pixel format", shown, RGBA8 if plain else None), tuple(masks) == _BGRA


def _known(name: str, field: str, found: object, form: Format | None) -> Format:
    if form is None:
        remedy = "convert it to BC1 (DXT1, BC1_UNORM) or RGBA8 (R8G8B8A8_UNORM), linear"
        raise InputError(name, field, found, remedy)
    return form
