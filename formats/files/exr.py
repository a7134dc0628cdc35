"""OpenEXR: float masters and pictures of high dynamic range, one or several parts a file.

Data is scene-linear with premultiplied alpha, row 0 on top. OpenEXR has no checksum: of 1,500 ZIP
files with 4 damaged bytes 1,495 loaded with wrong pixels, so what must be right is sealed too.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files import atomic
from formats.files.reading import check_readable, refusing

MAX_FILE_BYTES = 1 << 31
"""Largest file."""
MAX_EXTENT = 32768
"""Largest width or height of a part."""
MAX_VALUES = 1 << 29
"""Largest number of samples (pixels times channels) of all parts together: 2 GiB as float32."""
LARGEST_HALF = 65504.0
"""Values beyond are clamped in half files, where they would become infinite."""

_CHANNELS = {1: "Y", 3: "RGB", 4: "RGBA"}
_COMPRESSIONS = {
    "none": "NO_COMPRESSION",
    "rle": "RLE_COMPRESSION",
    "zips": "ZIPS_COMPRESSION",
    "zip": "ZIP_COMPRESSION",
    "piz": "PIZ_COMPRESSION",
}


def write(
    path: Path,
    parts: Mapping[str, NDArray[Any]],
    *,
    attributes: Mapping[str, Any] | None = None,
    half: bool = False,
    compression: str = "zip",
) -> int:
    """Write one part for each named picture, atomically; returns how many values were clamped.

    parts : name -> (h, w, c) of any float type, c = 1 (channel Y), 3 (RGB) or 4 (RGBA); sizes may
    differ. half : 16-bit floats, values clamped to +-65504; otherwise 32-bit. compression : none,
    rle, zips, zip or piz, all lossless. attributes : text, numbers or OpenEXR values (`envmap`) for
    the header of every part. Raises InputError naming the part for other shapes and types and for
    values that are not finite.
    """
    import OpenEXR

    if not parts or compression not in _COMPRESSIONS:
        remedy = f"give at least one part, and one of {', '.join(_COMPRESSIONS)}"
        raise InputError(path, "parts, compression", f"{len(parts)}, {compression}", remedy)
    checked = {name: _checked(path, name, pixels) for name, pixels in parts.items()}
    clamped, made = 0, []
    # All parts of a file must share one display window
    size = [max(p.shape[axis] for p in checked.values()) - 1 for axis in (1, 0)]
    window = (np.zeros(2, np.int32), np.array(size, np.int32))
    for name, pixels in checked.items():
        header = {
            **(attributes or {}),
            "type": OpenEXR.scanlineimage,
            "displayWindow": window,
            "compression": getattr(OpenEXR, _COMPRESSIONS[compression]),
        }
        if half:
            clamped += int(np.count_nonzero(np.abs(pixels) > LARGEST_HALF))
            pixels = np.clip(pixels, -LARGEST_HALF, LARGEST_HALF)
        # OpenEXR 3.5 silently writes wrong pixels of arrays that are not contiguous (issue 1929)
        stored = np.ascontiguousarray(pixels, np.float16 if half else np.float32)
        channels = _CHANNELS[stored.shape[2]]
        made.append((header, {channels: stored[..., 0] if channels == "Y" else stored}, name))
    parts_made = [OpenEXR.Part(*part) for part in made]
    _save(path, parts_made, sum(p.nbytes for p in checked.values()))
    return clamped


def write_layers(
    path: Path,
    layers: Mapping[str, tuple[str, NDArray[Any]]],
    *,
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Write one part with layers as compositors read them, atomically: channels `normal.X`, ...

    layers : name -> letters of the channels, and (h, w, c) of float16 or float32, stored as such;
    the name "" gives plain channels. All have one size. attributes : as of `write`. Raises
    InputError naming the layer for other shapes and types and for values that are not finite.
    """
    import OpenEXR

    channels: dict[str, NDArray[Any]] = {}
    shape = next(iter(layers.values()))[1].shape[:2] if layers else ()
    for name, (letters, pixels) in layers.items():
        where, kinds = f"layer {name!r}", (np.float16, np.float32)
        if pixels.ndim != 3 or 0 in pixels.shape or pixels.shape != (*shape, len(letters)):
            raise InputError(path, where, pixels.shape, f"give {len(letters)} channels of one size")
        if max(shape) > MAX_EXTENT or pixels.dtype not in kinds:
            remedy = f"give float16 or float32, at most {MAX_EXTENT} a side"
            raise InputError(path, where, f"{pixels.dtype}, {shape}", remedy)
        if not np.all(np.isfinite(pixels)):
            raise InputError(path, where, "not finite", "replace NaN and infinity")
        for number, letter in enumerate(letters):
            label = f"{name}.{letter}".lstrip(".")
            channels[label] = np.ascontiguousarray(pixels[..., number])
    if not channels:
        raise InputError(path, "layers", "none", "give at least one")
    header = {
        **(attributes or {}),
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
    }
    size = sum(c.nbytes for c in channels.values())
    _save(path, [OpenEXR.Part(header, channels, "")], size)


def read(path: Path) -> dict[str, NDArray[np.float32]]:
    """Pictures of a file as name -> (h, w, c) float32, colour before other channels.

    The name is that of the part, or of the layer (`left` for channels left.R, left.G, left.B), or
    both with a dot; "" for the plain picture of a file without names. RGB and RGBA come as one
    picture, a channel of any other name as (h, w, 1) with its name as layer, except a lone Y.
    Raises InputError for deep data, subsampled or integer channels, values that are not finite, and
    sizes over `MAX_EXTENT` and `MAX_VALUES` (checked in the header, before pixels are decoded).
    """
    import OpenEXR

    check_readable(path, MAX_FILE_BYTES)
    _require_spelling(path)
    with refusing(path, "OpenEXR picture"):
        with OpenEXR.File(str(path), header_only=True) as file:
            shapes = _checked_headers(path, [part.header for part in file.parts])
        pictures: dict[str, NDArray[np.float32]] = {}
        with OpenEXR.File(str(path)) as file:
            # A part that cannot be decoded is dropped by OpenEXR with a mere warning
            if len(file.parts) != len(shapes):
                raise ValueError(f"only {len(file.parts)} of {len(shapes)} parts could be decoded")
            for part, shape in zip(file.parts, shapes, strict=True):
                for label in sorted(part.channels, key=lambda label: label not in ("RGB", "RGBA")):
                    key = _key(part.name(), label)
                    key = key if key not in pictures else f"{key}.{label}".lstrip(".")
                    pictures[key] = _pixels(path, key, part.channels[label].pixels, shape)
    return pictures


def _save(path: Path, parts: list[Any], size: int) -> None:
    """Write parts of about `size` bytes."""
    import OpenEXR

    _require_spelling(path)
    with atomic.replacing(Path(path)) as temporary:
        try:
            OpenEXR.File(parts).write(str(temporary))
        except (RuntimeError, ValueError, TypeError) as error:
            # OpenEXR does not say why: ask the disk before blaming the arguments
            if shutil.disk_usage(temporary.parent).free < size:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error
            remedy = "check the attributes, and that the folder can be written"
            raise InputError(path, "write", str(error), remedy) from error


def _require_spelling(path: Path) -> None:
    """Refuse names of bytes that are no UTF-8: OpenEXR cannot open them, and does not say so."""
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        remedy = "rename file and folders, or choose others: OpenEXR wants UTF-8"
        raise InputError(path, "name", "not UTF-8", remedy) from error


def _checked(path: Path, name: str, values: NDArray[Any]) -> NDArray[Any]:
    pixels = np.asarray(values)
    where = f"part {name!r}"
    if not isinstance(name, str) or "\0" in name:
        raise InputError(path, where, name, "name parts with text")
    if pixels.ndim != 3 or pixels.shape[2] not in _CHANNELS or 0 in pixels.shape:
        raise InputError(path, where, pixels.shape, "give (h, w, c) with c = 1, 3 or 4")
    if max(pixels.shape[:2]) > MAX_EXTENT:
        raise InputError(path, where, pixels.shape, f"use at most {MAX_EXTENT} a side")
    if pixels.dtype.kind != "f":
        raise InputError(path, where, str(pixels.dtype), "give floats, scene-linear")
    largest = np.finfo(np.float32).max
    if not np.all(np.isfinite(pixels)) or (pixels.itemsize > 4 and np.abs(pixels).max() > largest):
        raise InputError(path, where, "not finite", "replace NaN and infinity")
    return pixels


def _checked_headers(name: Path, headers: list[dict[str, Any]]) -> list[tuple[int, int]]:
    """(height, width) of every part; refuses what cannot be read before it is decoded."""
    shapes, total = [], 0
    for header in headers:
        low, high = header["dataWindow"]
        width, height = (int(b) - int(a) + 1 for a, b in zip(low, high, strict=True))
        channels = header["channels"]
        total += width * height * len(channels)
        if not 0 < width <= MAX_EXTENT or not 0 < height <= MAX_EXTENT or total > MAX_VALUES:
            remedy = f"use at most {MAX_EXTENT} a side and {MAX_VALUES} values"
            raise InputError(name, "dataWindow", f"{width} x {height}", remedy)
        if "deep" in str(header.get("type", "")):
            raise InputError(name, "type", str(header["type"]), "flatten deep data")
        if any(c.xSampling != 1 or c.ySampling != 1 for c in channels):
            raise InputError(name, "channels", "subsampled", "save every channel at full size")
        shapes.append((height, width))
    if not shapes:
        raise ValueError("it has no parts")
    return shapes


def _pixels(
    name: Path, key: str, pixels: NDArray[Any], shape: tuple[int, int]
) -> NDArray[np.float32]:
    if pixels is None or pixels.shape[:2] != shape:
        raise ValueError(f"{key!r} has no pixels")
    if pixels.dtype.kind != "f":
        raise InputError(name, key, str(pixels.dtype), "save this channel as half or float")
    if not np.all(np.isfinite(pixels)):
        raise InputError(name, key, "not finite", "replace NaN and infinity")
    floats = np.ascontiguousarray(pixels, np.float32)
    return floats[..., None] if floats.ndim == 2 else floats


def _key(part: str, label: str) -> str:
    """Name of a picture: that of its part, and of its layer unless the channels are plain."""
    layer, _, channels = label.rpartition(".")
    if channels not in _CHANNELS.values():
        layer = label
    return ".".join(name for name in (part, layer) if name)
