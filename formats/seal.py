"""The seal of a baked folder: size and SHA-256 of every file, checked when bytes are read.

KTX2, GLB and EXR carry no checksum of their own, and most damaged files still load. Hashing runs at
over 1 GB/s. The seal finds accidents; it is no defence against a forger, who can seal again.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path, PurePosixPath
from typing import Any

from formats.errors import BakelightError, DamagedError, InputError
from formats.files import atomic
from formats.files.reading import MAX_JSON_BYTES, strict_json
from formats.files.reading import read_bytes as read_limited

NAME = "seal.json"
FORMAT = 1
UNSEALED = ("timings.json",)
"""File names, at any depth, that a seal leaves out."""

_REMEDY = "bake it again"


def seal(folder: Path) -> None:
    """Write `folder`/seal.json: {"format": 1, "files": {name: {"bytes", "sha256"}}}.

    Every file below the folder is listed by its path with forward slashes, except the seal itself,
    `timings.json` and unfinished temporaries. Raises InputError for a missing folder and for links,
    which could point out of it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(folder, "seal", "no such folder", "give the folder of an asset")
    files = {name: _measured(folder / name) for name in _names(folder)}
    text = json.dumps({"format": FORMAT, "files": files}, sort_keys=True, indent=2)
    atomic.write_bytes(folder / NAME, text.encode() + b"\n")


def is_sealed(folder: Path) -> bool:
    """Whether the folder carries a seal (which may be broken)."""
    return (Path(folder) / NAME).exists()


def verify(folder: Path) -> None:
    """Compare every sealed file with its size and hash.

    Raises DamagedError naming the first file that is missing, shorter, longer or changed, or the
    seal itself. Files that the seal does not list are ignored: `read_bytes` never serves them.
    """
    folder = Path(folder)
    for name, entry in _entries(folder).items():
        path = folder / name
        try:
            found = _measured(path)
        except (OSError, InputError) as error:
            raise DamagedError(path, "read", _reason(error), _REMEDY) from error
        _compare(path, found, entry)


def read_bytes(folder: Path, name: str) -> bytes:
    """Bytes of one sealed file, verified; `name` as in the seal, with forward slashes.

    Raises DamagedError when there is no seal, the seal does not list the name, or the bytes differ.
    """
    folder = Path(folder)
    entry = _entries(folder).get(name)
    path = folder / name
    if entry is None:
        raise DamagedError(path, NAME, "not sealed", _REMEDY)
    try:
        data = read_limited(path, entry["bytes"]) if entry["bytes"] else path.read_bytes()
    except (OSError, InputError) as error:
        raise DamagedError(path, "read", _reason(error), _REMEDY) from error
    found = {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    _compare(path, found, entry)
    return data


def _names(folder: Path) -> list[str]:
    names = []
    for parent, folders, files in os.walk(folder):
        for entry in folders + files:
            if (Path(parent) / entry).is_symlink():
                raise InputError(Path(parent) / entry, "seal", "a link", "copy the file instead")
        names += [(Path(parent) / entry).relative_to(folder).as_posix() for entry in files]
    kept = (name for name in names if name != NAME)
    return sorted(name for name in kept if not _left_out(PurePosixPath(name).name))


def _left_out(name: str) -> bool:
    return name in UNSEALED or name.startswith(atomic.TEMPORARY)


def _measured(path: Path) -> dict[str, Any]:
    with open(path, "rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        return {"bytes": stream.tell(), "sha256": digest}


def _compare(path: Path, found: dict[str, Any], entry: dict[str, Any]) -> None:
    for field in ("bytes", "sha256"):
        if found[field] != entry[field]:
            value = f"{found[field]}, sealed as {entry[field]}"
            raise DamagedError(path, field, value, _REMEDY)


def _entries(folder: Path) -> dict[str, dict[str, Any]]:
    path = folder / NAME
    try:
        data = strict_json(read_limited(path, MAX_JSON_BYTES), path)
    except InputError as error:
        raise DamagedError(path, error.field, error.value, _REMEDY) from error
    files = data.get("files") if isinstance(data, dict) else None
    if not isinstance(files, dict) or data.get("format") != FORMAT:
        raise DamagedError(path, "format", "not a seal of format 1", _REMEDY)
    for name, entry in files.items():
        if not _is_inside(name) or not _is_entry(entry):
            raise DamagedError(path, "files", name, _REMEDY)
    return files


def _is_inside(name: str) -> bool:
    parts = PurePosixPath(name).parts
    return bool(parts) and not name.startswith("/") and ".." not in parts and "\0" not in name


def _is_entry(entry: object) -> bool:
    if not isinstance(entry, dict) or set(entry) != {"bytes", "sha256"}:
        return False
    size = entry["bytes"]
    return type(size) is int and size >= 0 and isinstance(entry["sha256"], str)


def _reason(error: BakelightError | OSError) -> str:
    if isinstance(error, BakelightError):
        return str(error.value)
    return error.strerror or str(error)
