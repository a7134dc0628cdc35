"""A scene's text, TOML or JSON, read with limits; what it may say is in formats/scene.py."""

import tomllib
from pathlib import Path
from typing import Any

from formats.errors import InputError
from formats.files.reading import read_bytes, strict_json

MAX_BYTES = 4_000_000
MAX_DEPTH = 32


def parse(path: Path) -> dict[str, Any]:
    """The raw table of a file.

    Raises InputError where it is missing, too large, too deep, not UTF-8, not well-formed, or a
    JSON file with a key twice or a number that is not finite.
    """
    if path.suffix.lower() not in (".toml", ".json"):
        raise InputError(path, "", path.suffix, "name a scene file that ends in .toml or .json")
    data = read_bytes(path, MAX_BYTES)
    raw = strict_json(data, path) if path.suffix.lower() == ".json" else _toml(data, path)
    if not isinstance(raw, dict):
        raise InputError(path, "", type(raw).__name__, "start a JSON scene with {")
    if depth(raw) > MAX_DEPTH:
        raise InputError(path, "", "too deep", f"nest at most {MAX_DEPTH} levels")
    return raw


def root_of(file: Path) -> Path | None:
    """The folder in which a scene's sources are looked up: the one that holds scenes/, if any."""
    return next((f.parent for f in file.absolute().parents if f.name == "scenes"), None)


def depth(raw: object) -> int:
    """Levels of nesting; a plain value has none.

    >>> depth({"a": [1, [2]]})
    3
    """
    level, found = [raw], 0
    while level := [entry for entry in level if isinstance(entry, dict | list)]:
        found += 1
        level = [
            inner
            for entry in level
            for inner in (entry.values() if isinstance(entry, dict) else entry)
        ]
    return found


def _toml(data: bytes, path: Path) -> Any:
    try:
        return tomllib.loads(data.decode("utf-8-sig"))
    except RecursionError:
        raise InputError(path, "", "too deep", f"nest at most {MAX_DEPTH} levels") from None
    except ValueError as error:
        raise InputError(path, "", str(error), "mend the file there") from None
