"""KTX2 textures: 2D, 2D array, 3D; RGBA8, RGBA16F, R16UI, BC1 (Khronos KTX 2.0, KDF 1.3).

Linear, with premultiplied alpha; plain or under zstd. File order is header, level index, data
format descriptor, key/value data, then the levels, the smallest first. Everything is little-endian.
"""

from __future__ import annotations

import struct
from math import prod
from pathlib import Path

import numpy as np
import zstandard

from formats.errors import InputError
from formats.files import atomic, texture
from formats.files.reading import read_bytes, refusing
from formats.files.texture import MAX_BYTES, MAX_EXTENT, Format, Kind, Texture

__all__ = ["MAX_BYTES", "MAX_EXTENT", "Texture", "decode", "encode", "read", "write"]

MAX_METADATA_BYTES = 1 << 16
"""Largest key/value block."""
# Measured on 5.3 MB of a noisy photograph as RGBA8, one core: level 3 packs to 61 % at 94 MB/s,
# 6 to 56 % at 41 MB/s, 9 to 54 % at 22 MB/s; unpacking runs at 470 MB/s or more for all but 9.
ZSTD_LEVEL = 6
"""Level of zstd; a 512 x 512 sprite of 12 channels and its mips (4.2 MB) takes about 0.1 s."""

_IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
_HEADER = struct.Struct("<12s9I4I2Q")
_LEVEL = struct.Struct("<3Q")
# VkFormat R8G8B8A8_UNORM, R16_UINT, R16G16B16A16_SFLOAT and BC1_RGBA_UNORM_BLOCK
_FORMATS = {37: texture.RGBA8, 74: texture.R16UI, 97: texture.RGBA16F, 133: texture.BC1}
_PLAIN, _ZSTD = 0, 2  # supercompressionScheme
_OWN_KEYS = ("KTXorientation", "KTXwriter")


def write(path: Path, content: Texture, *, compress: bool = True) -> None:
    """Write a texture atomically; one layer becomes a plain 2D texture (layerCount 0).

    Raises InputError for levels of wrong shape, type or size, for values that are not finite, and
    for metadata that KTX2 cannot hold.
    """
    texture.check(path, content)
    atomic.write_bytes(path, encode(content, compress=compress, name=str(path)))


def read(path: Path) -> Texture:
    """Read a texture; InputError as in `decode`."""
    return decode(read_bytes(path, MAX_BYTES), str(path))


def encode(content: Texture, *, compress: bool = True, name: str = "texture") -> bytes:
    """Bytes of a KTX2 file; deterministic for one version of zstd."""
    texture.check(name, content)
    form, (layers, height, width) = content.format, content.size
    volume, count = content.kind == "volume", len(content.levels)
    raw = [np.ascontiguousarray(level, form.dtype).tobytes() for level in content.levels]
    stored = [_deflated(level) if compress else level for level in raw]

    # Lay out the index and the descriptors
    descriptor, metadata = _descriptor(form), _metadata(name, content)
    descriptor_at = _HEADER.size + count * _LEVEL.size
    metadata_at = descriptor_at + len(descriptor)
    header = _HEADER.pack(
        _IDENTIFIER,
        next(number for number, each in _FORMATS.items() if each == form),
        form.dtype.itemsize,
        *(width, height, layers if volume else 0, 0 if volume or layers == 1 else layers, 1, count),
        _ZSTD if compress else _PLAIN,
        *(descriptor_at, len(descriptor), metadata_at, len(metadata), 0, 0),
    )

    # Append the levels, smallest first, plain ones aligned to a texel or block
    index, body, at = [b""] * count, bytearray(), metadata_at + len(metadata)
    for i in reversed(range(count)):
        body += b"\0" * (0 if compress else -(at + len(body)) % 8)
        index[i] = _LEVEL.pack(at + len(body), len(stored[i]), len(raw[i]))
        body += stored[i]
    return header + b"".join(index) + descriptor + metadata + bytes(body)


def decode(data: bytes, name: str) -> Texture:
    """Texture from the bytes of a KTX2 file; `name` is what errors call it.

    Raises InputError for anything but a whole 2D, 2D array or 3D file in one of the formats above.
    Sizes are checked against `MAX_EXTENT` and `MAX_BYTES` before anything is allocated.
    """
    with refusing(name, "KTX2 texture"):
        return _decoded(data, name)


def _decoded(data: bytes, name: str) -> Texture:
    magic, vk_format, _, *size, scheme, _, _, kv_at, kv_size, _, _ = _HEADER.unpack_from(data)
    width, height, depth, layers, faces, count = size
    if magic != _IDENTIFIER:
        raise ValueError("it does not start with the KTX2 identifier")
    if vk_format not in _FORMATS:
        remedy = "convert it to R8G8B8A8_UNORM (37), R16G16B16A16_SFLOAT (97), R16_UINT (74) or "
        raise InputError(name, "vkFormat", vk_format, remedy + "BC1_RGBA_UNORM_BLOCK (133)")
    if scheme not in (_PLAIN, _ZSTD):
        remedy = "store it plain (0) or with Zstandard (2)"
        raise InputError(name, "supercompressionScheme", scheme, remedy)
    if faces != 1 or (depth and layers):
        remedy = "use one face, and no arrays of volumes"
        raise InputError(name, "faces, layers", (faces, layers), remedy)

    # Refuse what is too large before any of it is allocated
    kind: Kind = "volume" if depth else "array"
    form = _FORMATS[vk_format]
    whole = (depth or max(layers, 1), height, width)
    shapes = texture.check_declared(name, form, whole, kind, max(count, 1))

    levels = []
    for i, shape in enumerate(shapes):
        expected = prod(shape) * form.dtype.itemsize
        at, stored, plain = _LEVEL.unpack_from(data, _HEADER.size + i * _LEVEL.size)
        if plain != expected or at + stored > len(data):
            raise ValueError(f"level {i} holds {plain} bytes where {expected} belong")
        piece = memoryview(data)[at : at + stored]
        level = np.frombuffer(_inflated(piece, expected, scheme), form.dtype).reshape(shape)
        texture.check_finite(name, form, level, i)
        levels.append(level)
    extent = (width, height) if form.block > 1 else None
    return Texture(tuple(levels), kind, _parse_metadata(data, kv_at, kv_size), extent)


def _deflated(level: bytes) -> bytes:
    return zstandard.ZstdCompressor(level=ZSTD_LEVEL, write_checksum=True).compress(level)


def _inflated(piece: memoryview, expected: int, scheme: int) -> bytes | memoryview:
    if scheme == _PLAIN:
        if len(piece) != expected:
            raise ValueError("a plain level has two different sizes")
        return piece
    declared = zstandard.get_frame_parameters(piece).content_size
    if declared not in (expected, zstandard.CONTENTSIZE_UNKNOWN):
        raise ValueError(f"a zstd frame declares {declared} bytes where {expected} belong")
    inflater = zstandard.ZstdDecompressor(max_window_size=1 << 27)
    return inflater.decompress(piece, max_output_size=expected, allow_extra_data=False)


def _descriptor(form: Format) -> bytes:
    """Basic data format descriptor (KDF 1.3, 5): BT.709, linear, premultiplied alpha if any.

    bytesPlane0 keeps the size of a plain texel under zstd too, as libktx 4.4 and later want it.
    """
    # Colour model, samples (bits, channel and qualifiers, lower, upper), alpha premultiplied
    model, premultiplied = 1, 1  # RGBSDA
    channels = (0, 1, 2, 15)
    if form == texture.BC1:
        model, samples = 128, [(64, 1, 0, 0xFFFFFFFF)]  # BC1A, with alpha
    elif form == texture.R16UI:
        samples, premultiplied = [(16, 0, 0, 1)], 0
    elif form == texture.RGBA16F:  # signed floats from the bits of -1 to those of 1
        samples = [(16, channel | 0xC0, 0xBF800000, 0x3F800000) for channel in channels]
    else:
        samples = [(8, channel, 0, 255) for channel in channels]
    body = b"".join(
        struct.pack("<HBB3I", i * bits, bits - 1, channel, 0, lower, upper)
        for i, (bits, channel, lower, upper) in enumerate(samples)
    )
    size, side = 24 + len(body), form.block - 1
    planes = (form.bytes, *[0] * 7)
    block = struct.pack(
        "<IHH4B4B8B", 0, 2, size, model, 1, 1, premultiplied, side, side, 0, 0, *planes
    )
    return struct.pack("<I", 4 + size) + block + body


def _metadata(name: str, content: Texture) -> bytes:
    orientation = "ruo" if content.kind == "volume" else "rd"
    pairs = {"KTXorientation": orientation, "KTXwriter": "bakelight"} | content.metadata
    block = bytearray()
    for key, value in sorted((k.encode(), v.encode()) for k, v in pairs.items()):
        reserved = key[:3].lower() == b"ktx" and key.decode() not in _OWN_KEYS
        if not key or b"\0" in key + value or reserved:
            remedy = "use a key that is not empty and does not start with KTX, and no NUL"
            raise InputError(name, "metadata", key.decode(), remedy)
        pair = key + b"\0" + value + b"\0"
        block += struct.pack("<I", len(pair)) + pair + b"\0" * (-len(pair) % 4)
    if len(block) > MAX_METADATA_BYTES:
        remedy = f"keep metadata under {MAX_METADATA_BYTES} bytes"
        raise InputError(name, "metadata", len(block), remedy)
    return bytes(block)


def _parse_metadata(data: bytes, at: int, size: int) -> dict[str, str]:
    if size > MAX_METADATA_BYTES or at + size > len(data):
        raise ValueError(f"a key/value block of {size} bytes is out of range")
    block, pairs = data[at : at + size], {}
    while block:
        (length,) = struct.unpack_from("<I", block)
        key, zero, value = block[4 : 4 + length].partition(b"\0")
        if not key or not zero or 4 + length > len(block):
            raise ValueError("a key/value pair is cut off")
        pairs[key.decode()] = value.rstrip(b"\0").decode(errors="replace")
        block = block[4 + length + -length % 4 :]
    return pairs
