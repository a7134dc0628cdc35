"""The boundary where foreign bytes come in: size first, then one typed error for all faults."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from formats.errors import BakelightError, InputError, MachineError, reason

MAX_JSON_BYTES = 64 << 20
"""Largest JSON text that is parsed."""


def read_bytes(path: Path, limit: int) -> bytes:
    """Bytes of a file of at most `limit` bytes; errors as in `check_readable`."""
    check_readable(path, limit)
    with _readable(path):
        return Path(path).read_bytes()


def check_readable(path: Path, limit: int) -> None:
    """InputError when a file is missing, unreadable, not regular, empty, or over `limit` bytes."""
    with _readable(path):
        status = os.stat(path)
    if not stat.S_ISREG(status.st_mode):
        raise InputError(path, "read", "not a regular file", "give the path of a file")
    if status.st_size == 0:
        raise InputError(path, "size", 0, "the file is empty: export it again")
    if status.st_size > limit:
        raise InputError(path, "size", status.st_size, f"use a file of at most {limit} bytes")


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(path, "read", reason, "check the path and its permissions") from error


@contextmanager
def refusing(name: object, kind: str) -> Iterator[None]:
    """Turn whatever a parser raises into InputError (MachineError where memory ran out).

    Parsers of one format raise four to seven exception types on damaged bytes; a caller of ours
    sees one.
    """
    try:
        yield
    except BakelightError:
        raise
    except MemoryError as error:
        raise MachineError(name, kind, "out of memory", "close other programs") from error
    except Exception as error:
        remedy = f"the file is damaged or not a {kind}: export it again"
        raise InputError(name, kind, reason(error), remedy) from error


def strict_json(data: bytes, name: object) -> Any:
    """Parse JSON without its holes: no NaN or infinity, no repeated keys, no runaway depth or size.

    Raises InputError naming `name`. Python's own parser takes all of these silently.
    """
    if len(data) > MAX_JSON_BYTES:
        remedy = f"use at most {MAX_JSON_BYTES} bytes of JSON"
        raise InputError(name, "size", len(data), remedy)
    with refusing(name, "JSON file"):
        return json.loads(
            data.decode("utf-8"),
            parse_float=_finite,
            parse_constant=_no_constant,
            object_pairs_hook=_no_repeats,
        )


def _finite(text: str) -> float:
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise ValueError(f"the number {text} is out of range")
    return value


def _no_constant(text: str) -> float:
    raise ValueError(f"{text} is not a number")


def _no_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        raise ValueError(f"a key occurs twice among {sorted(key for key, _ in pairs)[:8]}")
    return table
