"""A file of what tiles gave: JSON that says what is what, the bytes of all arrays, and a SHA-256.

What a tile gives is an array, a number, None, or a tuple or dataclass of such.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from formats.errors import DamagedError
from formats.files import atomic

Place = tuple[int, int, int]
"""Number of the call, how many tiles it has, number of the tile."""
Kinds = tuple[type, ...]
"""The dataclasses that may occur."""

_MAGIC = b"BLTILES\1"
_HASH = 32


def write(path: Path, key: str, seconds: float, batch: list[tuple[Place, Any]]) -> int:
    """Write what tiles gave, settled, whole or not at all; return the bytes of the file."""
    arrays: list[Any] = []
    tiles = [[place, _form(value, arrays)] for place, value in batch]
    told = [[array.dtype.str, array.shape] for array in arrays]
    head = json.dumps({"key": key, "seconds": seconds, "tiles": tiles, "arrays": told}).encode()
    parts = [_MAGIC, len(head).to_bytes(8, "little"), head]
    parts += [array.reshape(-1).view(np.uint8).data for array in arrays]
    digest = hashlib.sha256()
    with atomic.replacing(path) as temporary, open(temporary, "xb") as stream:
        for part in parts:
            digest.update(part)
            stream.write(part)
        stream.write(digest.digest())
        return stream.tell()


def read(path: Path, key: str) -> tuple[dict[str, Any], list[Any]]:
    """Return what a file says of its tiles, and its arrays, which share its bytes.

    DamagedError where it cannot be read, is not as it was written, or belongs to another key.
    """
    remedy = "its tiles are computed again"
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DamagedError(path, "read", error.strerror or "", remedy) from error
    digest = hashlib.sha256(memoryview(data)[:-_HASH]).digest()
    if data[: len(_MAGIC)] != _MAGIC or digest != data[-_HASH:]:
        raise DamagedError(path, "sha256", "not as it was written", remedy)
    start = len(_MAGIC) + 8
    end = start + int.from_bytes(data[start - 8 : start], "little")
    head = json.loads(data[start:end])
    if head["key"] != key:
        raise DamagedError(path, "key", head["key"], remedy)
    arrays = []
    for dtype, shape in head["arrays"]:
        arrays.append(np.frombuffer(data, dtype, int(np.prod(shape)), end).reshape(shape))
        end += arrays[-1].nbytes
    return head, arrays


def settled(value: Any, kinds: Kinds) -> Any:
    """Return what a tile gave with arrays in C order, as read back. TypeError for others."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return value if value.flags.c_contiguous else np.ascontiguousarray(value)
    if isinstance(value, tuple):
        return tuple(settled(part, kinds) for part in value)
    if type(value) in kinds:
        return type(value)(*(settled(part, kinds) for part in _parts(value)))
    if value is None or type(value) in (bool, int, float):
        return value
    raise TypeError(f"{type(value).__name__} cannot be kept as what a tile gave.")


def restored(form: Any, arrays: list[Any], kinds: Kinds) -> Any:
    """Return what a tile gave from its form in a file and that file's arrays."""
    if isinstance(form, list):
        return tuple(restored(part, arrays, kinds) for part in form)
    if not isinstance(form, dict):
        return form
    if "array" in form:
        return arrays[form["array"]].copy()
    kind = next(kind for kind in kinds if kind.__name__ == form["kind"])
    return kind(*(restored(part, arrays, kinds) for part in form["parts"]))


def _form(value: Any, arrays: list[Any]) -> Any:
    """Return what a tile gave as JSON has it; its arrays go to `arrays`."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, tuple):
        return [_form(part, arrays) for part in value]
    if dataclasses.is_dataclass(value):
        parts = [_form(part, arrays) for part in _parts(value)]
        return {"kind": type(value).__name__, "parts": parts}
    return value


def _parts(value: Any) -> list[Any]:
    return [getattr(value, field.name) for field in dataclasses.fields(value)]
