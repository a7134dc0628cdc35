"""Pictures that people bring: PNG (8 and 16 bits), JPEG, WebP, TIFF; and PNG for what we show.

Colours of these files are taken as sRGB; embedded profiles and gamma chunks are ignored. Alpha is
handed over as stored, which is straight (not premultiplied) in all four formats.
"""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any, Literal

import numpy as np
import png
from numpy.typing import NDArray
from PIL import Image, ImageOps

from formats.errors import InputError
from formats.files import atomic
from formats.files.reading import read_bytes, refusing
from maths import colour

FORMATS = ("PNG", "JPEG", "WEBP", "TIFF")
"""The only parsers that Pillow may try."""
MAX_FILE_BYTES = 1 << 29
"""Largest file; a 16-bit picture of MAX_PIXELS, uncompressed."""
MAX_PIXELS = 1 << 26
"""Largest picture, 8192 x 8192; under the size from which Pillow warns of a bomb."""
MAX_EXTENT = 32768
"""Largest width or height."""
# A noisy 1152 x 640 frame: level 1 takes 0.13 s to 46 %, 4 0.17 s to 38 %, 6 0.53 s to 39 %.
PNG_LEVEL = 4
"""zlib level of written pictures."""

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {1: "L", 2: "LA", 3: "RGB", 4: "RGBA"}


def read(path: Path, *, space: Literal["linear", "stored"] = "linear") -> NDArray[np.float32]:
    """Picture as (h, w, c) float32 in 0..1, row 0 on top; c is 1 grey, 2 grey and alpha, 3, or 4.

    space : "linear" decodes colour from sRGB to linear Rec. 709 and leaves alpha; "stored" divides
    the codes by their maximum. All bits are kept; photographs are turned as their EXIF tag says.
    Raises InputError for other formats and colour spaces, for damaged files, and for files over
    `MAX_FILE_BYTES`, `MAX_PIXELS` or `MAX_EXTENT`, before any pixel is decoded.
    """
    return decode(read_bytes(path, MAX_FILE_BYTES), str(path), space=space)


def decode(
    data: bytes, name: str, *, space: Literal["linear", "stored"] = "linear"
) -> NDArray[np.float32]:
    """Picture from the bytes of a file (a texture inside a GLB, say); see `read`."""
    if space not in ("linear", "stored"):
        raise InputError(name, "space", space, "use linear or stored")
    with refusing(name, "picture (PNG, JPEG, WebP or TIFF)"):
        codes, top = _codes(data, name)
    scale = np.arange(top + 1, dtype=np.float64) / top
    if space == "stored":
        return scale.astype(np.float32).take(codes)
    linear = np.asarray(colour.srgb_decode(scale), np.float32).take(codes)
    if codes.shape[2] in (2, 4):
        linear[..., -1] = scale.astype(np.float32).take(codes[..., -1])
    return linear


def write(path: Path, image: NDArray[Any]) -> None:
    """Write an 8-bit PNG atomically.

    image : (h, w, c), row 0 on top, c = 1, 3 or 4; float is linear light, clipped to 0..1, coded as
    sRGB (alpha stays linear) and rounded without dither; uint8 is written as it is. Raises
    InputError for other shapes and types, values that are not finite, and names without .png.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise InputError(path, "format", path.suffix, "end the name in .png")
    with refusing(path, "picture"):
        codes = np.ascontiguousarray(_encoded(path, np.asarray(image)))
        buffer = io.BytesIO()
        picture = Image.fromarray(codes[..., 0] if codes.shape[2] == 1 else codes)
        picture.save(buffer, "PNG", compress_level=PNG_LEVEL)
    atomic.write_bytes(path, buffer.getvalue())


def _encoded(path: Path, image: NDArray[Any]) -> NDArray[np.uint8]:
    if image.ndim != 3 or image.shape[2] not in (1, 3, 4) or 0 in image.shape:
        raise InputError(path, "shape", image.shape, "give (h, w, c) with c = 1, 3 or 4")
    _check_size(path, image.shape[1], image.shape[0])
    if image.dtype == np.uint8:
        return image
    if image.dtype.kind != "f":
        raise InputError(path, "type", str(image.dtype), "give float (linear) or uint8 (as is)")
    if not np.all(np.isfinite(image)):
        raise InputError(path, "values", "not finite", "replace NaN and infinity")
    shown = np.clip(image.astype(np.float64), 0.0, 1.0)
    colours = 3 if image.shape[2] == 4 else image.shape[2]
    shown[..., :colours] = colour.srgb_encode(shown[..., :colours])
    return colour.quantise(shown)


def _codes(data: bytes, name: str) -> tuple[NDArray[Any], int]:
    """Stored codes (h, w, c) of unsigned integers, and the code that means 1."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            picture = Image.open(io.BytesIO(data), formats=FORMATS)
        except (Image.DecompressionBombWarning, Image.DecompressionBombError) as error:
            raise InputError(name, "size", str(error), _size_remedy()) from error
        _check_size(name, *picture.size)
        if data.startswith(_PNG_SIGNATURE) and data[24] == 16:
            return _deep_png(data)
        bits = _bits(picture)
        if picture.mode == "I;16" and bits == 16:
            return np.asarray(picture)[..., None], 65535
        if bits > 8 or picture.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA"):
            remedy = "save it as RGB or grey PNG of 8 or 16 bits"
            raise InputError(name, "pixels", f"{picture.mode}, {bits} bits", remedy)
        upright = ImageOps.exif_transpose(picture)
        codes = np.asarray(upright.convert(_plain_mode(upright)))
    return (codes[..., None] if codes.ndim == 2 else codes), 255


def _plain_mode(picture: Image.Image) -> str:
    """Grey stays grey; palettes and colour keys become what they stand for."""
    if "transparency" in picture.info or picture.mode == "PA":
        return "LA" if picture.mode in ("1", "L") else "RGBA"
    return {"1": "L", "P": "RGB"}.get(picture.mode, picture.mode)


def _bits(picture: Image.Image) -> int:
    """Bits a channel; Pillow would cut 16-bit colour TIFF down to 8 without a word."""
    if picture.format != "TIFF":
        return 8
    stored = picture.tag_v2.get(258, (1,))  # type: ignore[attr-defined]
    return int(max(stored) if isinstance(stored, tuple) else stored)


def _deep_png(data: bytes) -> tuple[NDArray[Any], int]:
    """A 16-bit PNG, which Pillow would cut to 8 bits; pypng takes 0.2 to 5 s a megapixel."""
    width, height, rows, info = png.Reader(bytes=data).asDirect()
    channels = int(info["planes"])
    codes = np.empty((height, width * channels), np.uint16)
    filled = 0
    for i, row in enumerate(rows):
        codes[i] = row
        filled += 1
    if filled != height:
        raise ValueError(f"{filled} of {height} rows")
    return codes.reshape(height, width, channels), (1 << int(info["bitdepth"])) - 1


def _check_size(name: object, width: int, height: int) -> None:
    if max(width, height) > MAX_EXTENT or width * height > MAX_PIXELS:
        raise InputError(name, "size", f"{width} x {height}", _size_remedy())


def _size_remedy() -> str:
    return f"use at most {MAX_PIXELS} pixels and {MAX_EXTENT} a side"
