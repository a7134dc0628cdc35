"""Folders for the user: filled aside, then renamed into place, so that none is half-written."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from formats import seal
from formats.errors import DamagedError, InputError, MachineError

ATTEMPTS = 16


def deliver(source: Path, target: Path) -> None:
    """Put a copy of the sealed folder `source` at `target`; a copy that is there and intact stays.

    What stood there is replaced only if it is a baked folder. InputError, MachineError.
    """
    if target.exists():
        if not target.is_dir() or (any(target.iterdir()) and not seal.is_sealed(target)):
            remedy = "name a new or empty folder"
            raise InputError(target, "--output", "is not a baked folder", remedy)
        if _same(source, target):
            return
    publish(target, lambda temporary: copy(source, temporary))


def publish(target: Path, fill: Callable[[Path], None]) -> None:
    """Fill a temporary folder beside `target` and rename it into its place.

    A folder that is there steps aside first; whoever is killed between the two renames finds no
    folder, never half of one. MachineError where the disk is full or cannot be written.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        room = Path(tempfile.mkdtemp(dir=target.parent, prefix=".tmp-"))
        try:
            os.chmod(room, 0o755)
            (room / "new").mkdir()
            fill(room / "new")
            _replace(room, target)
        finally:
            shutil.rmtree(room, ignore_errors=True)
    except OSError as error:
        reason = error.strerror or str(error)
        remedy = "choose a folder with room that can be written"
        raise MachineError(target, "", reason, remedy) from error


def _replace(room: Path, target: Path) -> None:
    """Put `room`/new at `target`; what other processes put there meanwhile steps aside as well."""
    for attempt in range(ATTEMPTS):
        with suppress(FileNotFoundError):
            os.rename(target, room / f"old-{attempt}")
        try:
            os.rename(room / "new", target)
            return
        except OSError as error:
            taken = error.errno in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)
            if not taken or attempt == ATTEMPTS - 1:
                raise


def copy(source: Path, target: Path) -> None:
    """Copy the files of a folder; copies, since an edit of a hard link would damage the store."""
    target.mkdir(parents=True, exist_ok=True)
    for file in source.iterdir():
        shutil.copy2(file, target / file.name)


def _same(source: Path, target: Path) -> bool:
    if not seal.is_sealed(target):
        return False
    if (source / seal.NAME).read_bytes() != (target / seal.NAME).read_bytes():
        return False
    try:
        seal.verify(target)
    except DamagedError:
        return False
    return True
