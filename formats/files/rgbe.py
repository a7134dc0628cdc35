"""Radiance RGBE pictures (.hdr): a shared exponent for three 8-bit mantissas.

Ward, Real Pixels, Graphics Gems II (1991). A code (r, g, b, e) stands for (r, g, b) * 2^(e - 136),
as in Walter's rgbe.c and stb_image, so that a mantissa of 0 is exactly 0; Ward's reader adds 0.5.
EXPOSURE and COLORCORR lines are ignored, as by most readers.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files import atomic
from formats.files.reading import read_bytes, refusing

MAX_FILE_BYTES = 1 << 29
"""Largest file."""
MAX_EXTENT = 32767
"""Largest width or height; run-length coding ends here."""
MAX_PIXELS = 1 << 27
"""Largest picture: 16384 x 8192."""
MAX_HEADER_BYTES = 1 << 16
"""Largest header."""
LARGEST = 255 * 2.0**119
"""Largest value: mantissa 255, exponent code 255."""

_SIZE = re.compile(rb"-Y (\d{1,9}) \+X (\d{1,9})")
_SHORTEST_CODED = 8  # narrower rows are stored flat


def read(path: Path) -> NDArray[np.float32]:
    """Picture as (h, w, 3) float32 from 0, scene-linear, row 0 on top.

    Raises InputError for damaged files, XYZE colours, turned or mirrored rows, and sizes over
    `MAX_EXTENT` and `MAX_PIXELS` (checked before anything is decoded).
    """
    return decode(read_bytes(path, MAX_FILE_BYTES), str(path))


def write(path: Path, image: NDArray[Any]) -> None:
    """Write (h, w, 3) floats atomically, rounded to the nearest code, run-length coded.

    The error is at most 1/255 of the pixel's largest channel; pixels under 2^-128 become black.
    Raises InputError for other shapes and types, values not finite, negative, or above `LARGEST`.
    """
    pixels = np.asarray(image)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape:
        raise InputError(path, "shape", pixels.shape, "give (h, w, 3)")
    if max(pixels.shape) > MAX_EXTENT or pixels.size > 3 * MAX_PIXELS:
        raise InputError(path, "shape", pixels.shape, f"use at most {MAX_EXTENT} a side")
    if pixels.dtype.kind != "f" or not np.all(np.isfinite(pixels)):
        raise InputError(path, "values", str(pixels.dtype), "give finite floats")
    if pixels.min() < 0.0 or pixels.max() > LARGEST:
        remedy = "clip to 0 and above, or write OpenEXR"
        raise InputError(path, "values", f"{pixels.min()} to {pixels.max()}", remedy)
    codes = _encoded(pixels.astype(np.float64))
    height, width = codes.shape[:2]
    head = f"#?RADIANCE\nSOFTWARE=bakelight\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    coded = width >= _SHORTEST_CODED
    rows = [_packed_row(row) for row in codes] if coded else [codes.tobytes()]
    atomic.write_bytes(Path(path), head.encode() + b"".join(rows))


def decode(data: bytes, name: str) -> NDArray[np.float32]:
    """Picture from the bytes of a file; see `read`."""
    with refusing(name, "Radiance picture"):
        height, width, at = _header(data, name)
        codes = np.empty((height, width, 4), np.uint8)
        for y in range(height):
            at = _unpack_row(data, at, codes[y])
    mantissas = codes[..., :3].astype(np.float32)
    picture = np.ldexp(mantissas, codes[..., 3:].astype(np.int32) - 136)
    picture[codes[..., 3] == 0] = 0.0
    return picture


def _header(data: bytes, name: str) -> tuple[int, int, int]:
    """Height, width and where the rows start."""
    if not data.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise ValueError("it does not start with #?RADIANCE")
    end = data.find(b"\n\n", 0, MAX_HEADER_BYTES)
    stop = data.find(b"\n", end + 2, end + 64)
    if end < 0 or stop < 0:
        raise ValueError("the header does not end")
    lines = data[:end].split(b"\n")
    kinds = [line.partition(b"=")[2].strip() for line in lines if line.startswith(b"FORMAT=")]
    if any(kind != b"32-bit_rle_rgbe" for kind in kinds):
        raise InputError(name, "FORMAT", kinds[0].decode(), "save it as 32-bit_rle_rgbe")
    size = _SIZE.fullmatch(data[end + 2 : stop].strip())
    if size is None:
        value = data[end + 2 : stop].decode(errors="replace")
        raise InputError(name, "size", value, "save it upright: -Y height +X width")
    height, width = int(size[1]), int(size[2])
    if not 0 < max(height, width) <= MAX_EXTENT or not 0 < height * width <= MAX_PIXELS:
        remedy = f"use at most {MAX_EXTENT} a side and {MAX_PIXELS} pixels"
        raise InputError(name, "size", f"{width} x {height}", remedy)
    # A run of two bytes covers at most 127 bytes of a row's four planes
    if (len(data) - stop) * 64 < height * width * 4:
        raise ValueError(f"{len(data)} bytes cannot hold {width} x {height} pixels")
    return height, width, stop + 1


def _unpack_row(data: bytes, at: int, row: NDArray[np.uint8]) -> int:
    """Fill one row (w, 4) from run-length coded, old-style coded or flat pixels."""
    width = len(row)
    if width < _SHORTEST_CODED or data[at : at + 2] != b"\2\2" or data[at + 2] & 0x80:
        return _unpack_old_row(data, at, row)
    if int.from_bytes(data[at + 2 : at + 4], "big") != width:
        raise ValueError("a row has another width")
    at += 4
    for channel in range(4):
        x = 0
        while x < width:
            count = data[at]
            run = count > 128
            count -= 128 * run
            if count == 0 or x + count > width:
                raise ValueError("a run leaves its row")
            taken = 1 if run else count
            values = np.frombuffer(data, np.uint8, taken, at + 1)
            row[x : x + count, channel] = values
            x, at = x + count, at + 1 + taken
    return at


def _unpack_old_row(data: bytes, at: int, row: NDArray[np.uint8]) -> int:
    """Flat pixels; (1, 1, 1, n) repeats the last one n times, successive ones shift n by 8."""
    x, shift = 0, 0
    flat = np.frombuffer(data, np.uint8, len(data) - at, at)
    whole = flat[: 4 * len(row)].reshape(-1, 4)
    if len(whole) == len(row) and not np.any(np.all(whole[:, :3] == 1, axis=1)):
        row[:] = whole
        return at + 4 * len(row)
    while x < len(row):
        code = data[at : at + 4]
        if len(code) < 4:
            raise ValueError("the picture is cut off")
        at += 4
        if code[:3] != b"\1\1\1":
            row[x], x, shift = np.frombuffer(code, np.uint8), x + 1, 0
            continue
        count = code[3] << shift
        if x == 0 or x + count > len(row) or shift > 16:
            raise ValueError("a run leaves its row")
        row[x : x + count] = row[x - 1]
        x, shift = x + count, shift + 8
    return at


def _encoded(pixels: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Codes (h, w, 4) nearest to pixels (h, w, 3)."""
    largest = pixels.max(axis=2)
    exponent = np.frexp(largest)[1]
    # The largest mantissa may round up to 256: take one more bit there
    exponent += np.floor(np.ldexp(largest, 8 - exponent) + 0.5) > 255
    mantissas = np.floor(np.ldexp(pixels, (8 - exponent)[..., None]) + 0.5)
    codes = np.concatenate([mantissas, exponent[..., None] + 128.0], axis=2)
    codes[(largest == 0.0) | (exponent < -127)] = 0
    return codes.astype(np.uint8)


def _packed_row(row: NDArray[np.uint8]) -> bytes:
    """One row (w, 4) as four run-length coded planes."""
    packed = bytearray(b"\2\2" + len(row).to_bytes(2, "big"))
    for channel in range(4):
        plane = row[:, channel]
        starts = np.concatenate([[0], np.flatnonzero(np.diff(plane)) + 1, [len(plane)]])
        literal = bytearray()
        for start, stop in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
            if stop - start < 4:
                literal += plane[start:stop].tobytes()
                continue
            _flush_literal(packed, literal)
            for at in range(start, stop, 127):
                packed += bytes((128 + min(127, stop - at), int(plane[start])))
        _flush_literal(packed, literal)
    return bytes(packed)


def _flush_literal(packed: bytearray, literal: bytearray) -> None:
    for at in range(0, len(literal), 128):
        piece = literal[at : at + 128]
        packed += bytes((len(piece),)) + piece
    literal.clear()
