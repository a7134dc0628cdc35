"""KTX2 textures: 2D, 2D array and 3D; RGBA8 and RGBA16F, linear; zstd (Khronos KTX 2.0, KDF 1.3).

File order is header, level index, data format descriptor, key/value data, then the levels, the
smallest first. Everything is little-endian.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Any, Literal

import numpy as np
import zstandard
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files import atomic
from formats.files.reading import read_bytes, refusing

MAX_EXTENT = 16384
"""Largest width, height, depth or number of layers."""
MAX_BYTES = 1 << 30
"""Largest sum of all decoded levels; also the largest file."""
MAX_METADATA_BYTES = 1 << 16
"""Largest key/value block."""
# Measured on 5.3 MB of a noisy photograph as RGBA8, one core: level 3 packs to 61 % at 94 MB/s,
# 6 to 56 % at 41 MB/s, 9 to 54 % at 22 MB/s; unpacking runs at 470 MB/s or more for all but 9.
ZSTD_LEVEL = 6
"""Level of zstd; a 512 x 512 sprite of 12 channels and its mips (4.2 MB) takes about 0.1 s."""

_IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
_HEADER = struct.Struct("<12s9I4I2Q")
_LEVEL = struct.Struct("<3Q")
# VkFormat R8G8B8A8_UNORM and R16G16B16A16_SFLOAT
_FORMATS: dict[int, np.dtype[Any]] = {37: np.dtype("u1"), 97: np.dtype("<f2")}
_PLAIN, _ZSTD = 0, 2  # supercompressionScheme
_OWN_KEYS = ("KTXorientation", "KTXwriter")


@dataclass(frozen=True)
class Texture:
    """Mip levels from the largest down; level i + 1 has half the size of level i, rounded down.

    levels : each (layers or depth, height, width, 4), all uint8 (linear 0..255 for 0..1) or all
    float16. Arrays keep their number of layers, volumes halve their depth too; row 0 is the top of
    a picture and the bottom (-y) of a volume. metadata : extra text keys; `KTXorientation` and
    `KTXwriter` are filled in when absent. Arrays that come from `read` are read-only.
    """

    levels: tuple[NDArray[Any], ...]
    kind: Literal["array", "volume"] = "array"
    metadata: dict[str, str] = field(default_factory=dict)


def write(path: Path, texture: Texture, *, compress: bool = True) -> None:
    """Write a texture atomically; one layer becomes a plain 2D texture (layerCount 0).

    Raises InputError for levels of wrong shape, type or size, for values that are not finite, and
    for metadata that KTX2 cannot hold.
    """
    _check_levels(path, texture)
    atomic.write_bytes(path, encode(texture, compress=compress, name=str(path)))


def read(path: Path) -> Texture:
    """Read a texture; InputError as in `decode`."""
    return decode(read_bytes(path, MAX_BYTES), str(path))


def encode(texture: Texture, *, compress: bool = True, name: str = "texture") -> bytes:
    """Bytes of a KTX2 file; deterministic for one version of zstd."""
    _check_levels(name, texture)
    layers, height, width, _ = texture.levels[0].shape
    volume, count = texture.kind == "volume", len(texture.levels)
    half = texture.levels[0].dtype.itemsize == 2
    raw = [
        np.ascontiguousarray(level, "<f2" if half else "u1").tobytes() for level in texture.levels
    ]
    stored = [_deflated(level) if compress else level for level in raw]

    # Lay out the index and the descriptors
    descriptor, metadata = _descriptor(half), _metadata(name, texture)
    descriptor_at = _HEADER.size + count * _LEVEL.size
    metadata_at = descriptor_at + len(descriptor)
    header = _HEADER.pack(
        _IDENTIFIER,
        97 if half else 37,
        2 if half else 1,
        *(width, height, layers if volume else 0, 0 if volume or layers == 1 else layers, 1, count),
        _ZSTD if compress else _PLAIN,
        *(descriptor_at, len(descriptor), metadata_at, len(metadata), 0, 0),
    )

    # Append the levels, smallest first, plain ones aligned to a texel
    index, body, at = [b""] * count, bytearray(), metadata_at + len(metadata)
    for i in reversed(range(count)):
        body += b"\0" * (0 if compress else -(at + len(body)) % 8)
        index[i] = _LEVEL.pack(at + len(body), len(stored[i]), len(raw[i]))
        body += stored[i]
    return header + b"".join(index) + descriptor + metadata + bytes(body)


def decode(data: bytes, name: str) -> Texture:
    """Texture from the bytes of a KTX2 file; `name` is what errors call it.

    Raises InputError for anything but a whole 2D, 2D array or 3D file in RGBA8 or RGBA16F. Sizes
    are checked against `MAX_EXTENT` and `MAX_BYTES` before anything is allocated.
    """
    with refusing(name, "KTX2 texture"):
        return _decoded(data, name)


def _decoded(data: bytes, name: str) -> Texture:
    magic, vk_format, _, *size, scheme, _, _, kv_at, kv_size, _, _ = _HEADER.unpack_from(data)
    width, height, depth, layers, faces, count = size
    if magic != _IDENTIFIER:
        raise ValueError("it does not start with the KTX2 identifier")
    if vk_format not in _FORMATS:
        remedy = "convert it to R8G8B8A8_UNORM (37) or R16G16B16A16_SFLOAT (97)"
        raise InputError(name, "vkFormat", vk_format, remedy)
    if scheme not in (_PLAIN, _ZSTD):
        remedy = "store it plain (0) or with Zstandard (2)"
        raise InputError(name, "supercompressionScheme", scheme, remedy)
    if not (
        0 < width <= MAX_EXTENT and 0 < height <= MAX_EXTENT and max(depth, layers) <= MAX_EXTENT
    ):
        remedy = f"use a 2D or 3D texture of at most {MAX_EXTENT} a side"
        raise InputError(name, "size", (width, height, depth, layers), remedy)
    if faces != 1 or (depth and layers) or count > max(width, height, depth).bit_length():
        remedy = "use one face, no arrays of volumes, and at most a full mip chain"
        raise InputError(name, "faces, layers, levels", (faces, layers, count), remedy)

    # Refuse what is too large before any of it is allocated
    kind: Literal["array", "volume"] = "volume" if depth else "array"
    dtype = _FORMATS[vk_format]
    shapes = [
        _level_shape((depth or max(layers, 1), height, width), kind, i)
        for i in range(max(count, 1))
    ]
    sizes = [prod(shape) * dtype.itemsize for shape in shapes]
    if sum(sizes) > MAX_BYTES:
        raise InputError(name, "decoded bytes", sum(sizes), f"use at most {MAX_BYTES} bytes")

    levels = []
    for i, (shape, expected) in enumerate(zip(shapes, sizes, strict=True)):
        at, stored, plain = _LEVEL.unpack_from(data, _HEADER.size + i * _LEVEL.size)
        if plain != expected or at + stored > len(data):
            raise ValueError(f"level {i} holds {plain} bytes where {expected} belong")
        piece = memoryview(data)[at : at + stored]
        level = np.frombuffer(_inflated(piece, expected, scheme), dtype).reshape(shape)
        if dtype.itemsize == 2 and not finite_halves(level):
            remedy = "replace NaN and infinity before writing it"
            raise InputError(name, f"level {i}", "not finite", remedy)
        levels.append(level)
    return Texture(tuple(levels), kind, _parse_metadata(data, kv_at, kv_size))


def finite_halves(values: NDArray[np.float16]) -> bool:
    """Whether all half floats are finite: an exponent of all ones is infinity or NaN."""
    return bool(np.all((values.view(np.uint16) & 0x7C00) != 0x7C00))


def _level_shape(size: tuple[int, int, int], kind: str, level: int) -> tuple[int, int, int, int]:
    layers, height, width = size
    layers = max(1, layers >> level) if kind == "volume" else layers
    return layers, max(1, height >> level), max(1, width >> level), 4


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


def _descriptor(half: bool) -> bytes:
    """Basic data format descriptor (KDF 1.3, 5): RGBSDA, BT.709, linear, premultiplied alpha.

    bytesPlane0 keeps the size of a plain texel under zstd too, as libktx 4.4 and later want it.
    """
    bits, flags = (16, 0xC0) if half else (8, 0)  # 0xC0: signed float
    lower, upper = (0xBF800000, 0x3F800000) if half else (0, 255)  # bits of -1.0 and 1.0
    samples = b"".join(
        struct.pack("<HBB3I", i * bits, bits - 1, channel | flags, 0, lower, upper)
        for i, channel in enumerate((0, 1, 2, 15))
    )
    size = 24 + len(samples)
    block = struct.pack("<IHH4BI8B", 0, 2, size, 1, 1, 1, 1, 0, bits // 2, *[0] * 7)
    return struct.pack("<I", 4 + size) + block + samples


def _metadata(name: str, texture: Texture) -> bytes:
    orientation = "ruo" if texture.kind == "volume" else "rd"
    pairs = {"KTXorientation": orientation, "KTXwriter": "bakelight"} | texture.metadata
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


def _check_levels(name: object, texture: Texture) -> None:
    if texture.kind not in ("array", "volume"):
        raise InputError(name, "kind", texture.kind, "use array or volume")
    if not texture.levels or not all(isinstance(level, np.ndarray) for level in texture.levels):
        raise InputError(name, "levels", type(texture.levels), "give a tuple of numpy arrays")
    first = texture.levels[0]
    if first.dtype not in _FORMATS.values() or first.ndim != 4:
        remedy = "use (layers, height, width, 4) of uint8 or float16"
        raise InputError(name, "levels", f"{first.dtype} {first.shape}", remedy)
    if not all(0 < side <= MAX_EXTENT for side in first.shape) or first.shape[3] != 4:
        remedy = f"use sides of 1 to {MAX_EXTENT} and 4 channels"
        raise InputError(name, "levels", first.shape, remedy)
    sides = first.shape[0 if texture.kind == "volume" else 1 : 3]
    if len(texture.levels) > max(sides).bit_length():
        raise InputError(name, "levels", len(texture.levels), "stop at the level of one texel")
    if sum(level.nbytes for level in texture.levels) > MAX_BYTES:
        raise InputError(name, "levels", "too large", f"use at most {MAX_BYTES} bytes")
    for i, level in enumerate(texture.levels):
        shape = _level_shape(first.shape[:3], texture.kind, i)
        if level.shape != shape or level.dtype != first.dtype:
            remedy = f"halve each level: expected {shape} of {first.dtype}"
            raise InputError(name, f"levels[{i}]", f"{level.shape} {level.dtype}", remedy)
        if level.dtype.itemsize == 2 and not finite_halves(level):
            raise InputError(name, f"levels[{i}]", "not finite", "replace NaN and infinity")
