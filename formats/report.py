"""report.json of an asset: what it is, from what it was made, how good it is."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from formats import seal
from formats.errors import BakelightError, DamagedError, InputError, reason
from formats.files import atomic
from formats.files.reading import MAX_JSON_BYTES, read_bytes, strict_json

NAME = "report.json"
MAX_DEPTH = 32
"""Deepest nesting of a report."""
SMALL = 1 << 16
"""Values of the largest array that a report holds; larger ones come from files that are checked."""


Made = TypeVar("Made")
From = TypeVar("From")


def understood(load: Callable[[From, Path], Made]) -> Callable[[From, Path], Made]:
    """Make `load(cls, folder)` answer for whatever a report says, sealed by whomever.

    Entries that are missing, of another type or out of range end in DamagedError.
    """

    @wraps(load)
    def answering(cls: From, folder: Path) -> Made:
        try:
            made = load(cls, folder)
            _require_finite(made)
            return made
        except BakelightError:
            raise
        except (Exception, MemoryError) as error:
            why = reason(error)[:160]
            raise DamagedError(Path(folder) / NAME, "entries", why, "bake it again") from error

    return answering


def _require_finite(made: Any) -> None:
    """Raise ValueError where a number, or an array as small as those of reports, is not finite."""
    for field in fields(made) if is_dataclass(made) else ():
        value = getattr(made, field.name)
        small = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.size <= SMALL
        if (small or isinstance(value, float)) and not np.isfinite(value).all():
            raise ValueError(f"{field.name} is not finite")


def write(folder: Path, data: dict[str, Any]) -> None:
    """Write `folder`/report.json with sorted keys, so that equal reports are equal bytes.

    data : JSON values; tuples, numpy scalars and arrays become lists and numbers. Raises InputError
    naming the entry for a number that is not finite, a key that is not text, and any other type.
    """
    path = Path(folder) / NAME
    if not isinstance(data, dict):
        raise InputError(path, "report", type(data).__name__, "give a dictionary")
    text = json.dumps(_plain(data, path, "", 0), sort_keys=True, indent=2, allow_nan=False)
    atomic.write_bytes(path, text.encode() + b"\n")


def read(folder: Path) -> dict[str, Any]:
    """Read `folder`/report.json, verified where the folder is sealed.

    Raises DamagedError when the bytes are not those sealed, InputError when the file is missing or
    is not a report.
    """
    path = Path(folder) / NAME
    sealed = seal.is_sealed(folder)
    data = strict_json(
        seal.read_bytes(folder, NAME) if sealed else read_bytes(path, MAX_JSON_BYTES), path
    )
    if not isinstance(data, dict):
        raise InputError(
            path, "report", type(data).__name__, "a report is a JSON object: bake it again"
        )
    quality = data.get("quality", {})
    if not isinstance(quality, dict):
        raise InputError(path, "quality", type(quality).__name__, "a table: bake it again")
    return data


def _plain(value: Any, path: Path, where: str, depth: int) -> Any:
    if depth > MAX_DEPTH:
        raise InputError(path, where, "too deep", f"nest at most {MAX_DEPTH} levels")
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise InputError(path, where, value, "reports hold finite numbers only")
        return value
    if isinstance(value, list | tuple):
        return [_plain(v, path, f"{where}[{i}]", depth + 1) for i, v in enumerate(value)]
    if not isinstance(value, dict):
        raise InputError(path, where, type(value).__name__, "use text, numbers, lists and tables")
    for key in value:
        if not isinstance(key, str):
            raise InputError(path, where, key, "use text for keys")
    return {k: _plain(v, path, f"{where}.{k}" if where else k, depth + 1) for k, v in value.items()}
