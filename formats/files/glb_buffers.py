"""The bytes of a GLB: its two chunks, buffer views and accessors (glTF 2.0, sections 3.6 and 4)."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.files.reading import strict_json

MAX_DECODED_BYTES = 1 << 31
"""Largest sum of all arrays read; accessors may overlap, so the file's size is no bound."""

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_COMPONENTS: dict[int, np.dtype[Any]] = {
    5120: np.dtype("i1"),
    5121: np.dtype("u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_CODES = {dtype: code for code, dtype in _COMPONENTS.items()}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TYPES = {width: name for name, width in _WIDTHS.items()}
_VERTICES, _INDICES = 34962, 34963  # bufferView targets


def pack(gltf: dict[str, Any], binary: bytes) -> bytes:
    """A GLB file from its JSON and its binary chunk, both padded to 4 bytes."""
    text = json.dumps(gltf, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<2I", len(text), _JSON) + text
    if binary:
        chunks += struct.pack("<2I", len(binary), _BIN) + binary
    return struct.pack("<3I", _MAGIC, 2, 12 + len(chunks)) + chunks


def unpack(data: bytes, name: object) -> tuple[dict[str, Any], memoryview]:
    """JSON and binary chunk of a GLB; ValueError or InputError where the container is broken."""
    magic, version, length = struct.unpack_from("<3I", data)
    if magic != _MAGIC or version != 2:
        raise ValueError("it does not start as a GLB of version 2")
    if length > len(data):
        raise ValueError(f"{len(data)} bytes of {length}")
    size, kind = struct.unpack_from("<2I", data, 12)
    if kind != _JSON or 20 + size > length:
        raise ValueError("the JSON chunk is broken")
    gltf = strict_json(data[20 : 20 + size], name)
    if not isinstance(gltf, dict):
        raise ValueError("the JSON chunk is not an object")
    at = 20 + size
    if at == length:
        return gltf, memoryview(b"")
    size, kind = struct.unpack_from("<2I", data, at)
    if kind != _BIN or at + 8 + size > length:
        raise ValueError("the binary chunk is broken")
    return gltf, memoryview(data)[at + 8 : at + 8 + size]


class Writer:
    """Collects arrays and byte strings into one buffer, its views and accessors."""

    def __init__(self) -> None:
        self.binary = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add_bytes(self, data: bytes, **view: int) -> int:
        """Append bytes at a multiple of 4; returns the index of their buffer view."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.views.append(
            {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)} | view
        )
        self.binary += data
        return len(self.views) - 1

    def add_vertices(
        self, array: NDArray[Any], *, normalized: bool = False, bounds: bool = False
    ) -> int:
        """Append (n,) or (n, k) float32, uint8 or uint16, each vertex at a multiple of 4 bytes."""
        rows = np.ascontiguousarray(array.reshape(len(array), -1))
        rows = rows.astype(rows.dtype.newbyteorder("<"), copy=False)
        wasted = -rows.strides[0] % 4 if len(rows) else 0
        padded = np.zeros((len(rows), rows.shape[1] * rows.itemsize + wasted), np.uint8)
        padded[:, : padded.shape[1] - wasted] = rows.view(np.uint8)
        view = {"target": _VERTICES} | ({"byteStride": padded.shape[1]} if wasted else {})
        extra: dict[str, Any] = {"normalized": True} if normalized else {}
        if bounds:
            extra |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        return self._add_accessor(rows, self.add_bytes(padded.tobytes(), **view), extra)

    def add_indices(self, indices: NDArray[Any], vertices: int) -> int:
        """Append triangle corners as uint16 where they fit; the largest code means a restart."""
        dtype = "<u2" if vertices <= 65535 else "<u4"
        flat = np.ascontiguousarray(indices.reshape(-1, 1), dtype)
        return self._add_accessor(flat, self.add_bytes(flat.tobytes(), target=_INDICES), {})

    def _add_accessor(self, rows: NDArray[Any], view: int, extra: dict[str, Any]) -> int:
        described = {
            "bufferView": view,
            "componentType": _CODES[rows.dtype],
            "count": len(rows),
            "type": _TYPES[rows.shape[1]],
        }
        self.accessors.append(described | extra)
        return len(self.accessors) - 1


class Reader:
    """Arrays and byte strings of one unpacked GLB, each decoded once."""

    def __init__(self, gltf: dict[str, Any], binary: memoryview) -> None:
        self.gltf, self.binary = gltf, binary
        self._arrays: dict[int, NDArray[Any]] = {}
        self._decoded = 0

    def view(self, index: object) -> memoryview:
        """Bytes of a buffer view."""
        view = item(self.gltf, "bufferViews", index)
        at, size = whole(view.get("byteOffset", 0)), whole(view["byteLength"])
        if whole(view["buffer"]) != 0 or at + size > len(self.binary):
            raise ValueError(f"buffer view {index} lies outside the file")
        return self.binary[at : at + size]

    def array(self, index: object) -> NDArray[Any]:
        """An accessor as (n, k), in its stored type; a copy of the caller's own, writeable."""
        key = whole(index)
        if key not in self._arrays:
            self._arrays[key] = self._array(key)
        return self._arrays[key]

    def floats(self, index: object) -> NDArray[np.float32]:
        """An accessor as (n, k) float32; normalised integers become 0..1 or -1..1."""
        array = self.array(index)
        if array.dtype.kind == "f" or not item(self.gltf, "accessors", index).get("normalized"):
            return array.astype(np.float32)
        top = np.iinfo(array.dtype).max
        floats: NDArray[np.float32] = array.astype(np.float32) / np.float32(top)
        return np.maximum(floats, np.float32(-1.0))

    def _array(self, index: int) -> NDArray[Any]:
        accessor = item(self.gltf, "accessors", index)
        if "sparse" in accessor or "bufferView" not in accessor:
            raise ValueError("sparse accessors are not supported")
        dtype, width = _COMPONENTS[accessor["componentType"]], _WIDTHS[accessor["type"]]
        view, count = self.view(accessor["bufferView"]), whole(accessor["count"])
        at = whole(accessor.get("byteOffset", 0))
        size = width * dtype.itemsize
        stride = item(self.gltf, "bufferViews", accessor["bufferView"]).get("byteStride", size)
        if not size <= whole(stride) <= 252 or count < 1:
            raise ValueError(f"accessor {index} has a stride of {stride} and {count} elements")
        if at + stride * (count - 1) + size > len(view):
            raise ValueError(f"accessor {index} lies outside its buffer view")
        self._decoded += count * size
        if self._decoded > MAX_DECODED_BYTES:
            raise ValueError(f"its arrays hold over {MAX_DECODED_BYTES} bytes")
        strides = (stride, dtype.itemsize)
        array: NDArray[Any] = np.ndarray((count, width), dtype, view, at, strides).copy()
        if dtype.kind == "f" and not np.all(np.isfinite(array)):
            raise ValueError(f"accessor {index} holds NaN or infinity")
        return array


def item(gltf: dict[str, Any], table: str, index: object) -> dict[str, Any]:
    """Entry of one of the tables of the JSON; ValueError where there is none."""
    entry = gltf[table][whole(index)]
    if not isinstance(entry, dict):
        raise ValueError(f"{table}[{index}] is not an object")
    return entry


def whole(value: object) -> int:
    """A JSON value as a count or an index: a whole number from 0."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(f"{value!r} is not a whole number from 0")
    return value
