"""Folders for the user: filled aside, then renamed into place, so that none is half-written."""

from __future__ import annotations

import ctypes
import errno
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from bake.publish import flush, flush_tree
from formats import seal
from formats.errors import DamagedError, InputError, MachineError

ATTEMPTS = 16
STALE_HOURS = 6
NO_FOLDER, EXCHANGE = -1, 2  # of renameat2: paths are absolute; swap
LONGEST = 40  # characters of a target's name that its temporaries carry


def deliver(source: Path, target: Path, amend: Callable[[Path], None] | None = None) -> None:
    """Put a copy of the sealed folder `source` at `target`; a copy that is there and intact stays.

    amend : adds to the copy and seals it anew. What stood there is replaced only if it is a baked
    folder, and neither a scene nor an entry of a store. InputError, MachineError.
    """
    sweep(target)
    if target.exists():
        # The store marks its folder by its locks
        if (target / "manifest.json").exists() or (target.absolute().parent / ".locks").is_dir():
            remedy = "name a new or empty folder"
            raise InputError(target, "--output", "is a baked scene, or lies in a store", remedy)
        if not target.is_dir() or (any(target.iterdir()) and not seal.is_sealed(target)):
            remedy = "name a new or empty folder"
            raise InputError(target, "--output", "is not a baked folder", remedy)
        if amend is None and _same(source, target):
            return

    def fill(temporary: Path) -> None:
        copy(source, temporary)
        if amend is not None:
            amend(temporary)

    publish(target, fill)


def publish(target: Path, fill: Callable[[Path], None]) -> None:
    """Fill a temporary folder beside `target` and rename it into its place.

    A folder that is there changes places with it in one step or, where the system has none such,
    steps aside first: whoever is killed between two renames finds no folder, never half of one. A
    power cut finds the bytes wherever it finds the name, since they are flushed first. MachineError
    where the disk is full or cannot be written.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        room = Path(tempfile.mkdtemp(dir=target.parent, prefix=_prefix(target)))
        try:
            os.chmod(room, 0o755)
            (room / "new").mkdir()
            fill(room / "new")
            flush_tree(room / "new")
            _replace(room, target)
            flush(target.parent)
        finally:
            shutil.rmtree(room, ignore_errors=True)
    except OSError as error:
        reason = error.strerror or str(error)
        remedy = "choose a folder with room that can be written"
        raise MachineError(target, "", reason, remedy) from error


def sweep(target: Path) -> None:
    """Remove what killed processes left beside `target` hours ago, their temporaries for it.

    The parent may be any folder of the user's: only what can have come from `publish` goes.
    """
    made = re.compile(re.escape(_prefix(target)) + "[a-z0-9_]{8}")
    latest = time.time() - 3600 * STALE_HOURS
    with suppress(OSError):
        for room in list(os.scandir(target.parent)):
            if not made.fullmatch(room.name) or not room.is_dir(follow_symlinks=False):
                continue
            inside = {re.sub(r"\d+$", "", name) for name in os.listdir(room)}
            if inside <= {"new", "old-"} and room.stat().st_mtime < latest:
                shutil.rmtree(room, ignore_errors=True)


def _prefix(target: Path) -> str:
    return f".tmp-{target.name[:LONGEST]}-"


def _replace(room: Path, target: Path) -> None:
    """Put `room`/new at `target`; what other processes put there meanwhile steps aside as well."""
    for attempt in range(ATTEMPTS):
        old = room / f"old-{attempt}"
        if _exchanged(room / "new", target):
            return
        with suppress(FileNotFoundError):
            os.rename(target, old)
        try:
            os.rename(room / "new", target)
            return
        except OSError as error:
            taken = error.errno in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)
            if not taken or attempt == ATTEMPTS - 1:
                with suppress(OSError):
                    os.rename(old, target)
                raise


def _exchanged(new: Path, target: Path) -> bool:
    """Swap two folders in one step, renameat2(2); False where the system cannot, or one is
    missing."""
    if sys.platform != "linux":
        return False
    swap = getattr(ctypes.CDLL(None), "renameat2", None)
    names = os.fsencode(new.absolute()), os.fsencode(target.absolute())
    return swap is not None and swap(NO_FOLDER, names[0], NO_FOLDER, names[1], EXCHANGE) == 0


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
