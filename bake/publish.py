"""How a finished folder gets its name in the store, whatever happens on the way.

Everything is written under a temporary name in the same folder, each file is flushed to the disk,
then the folders, then one rename publishes the whole, then the parent is flushed. A reader sees all
or nothing after a killed process and, since ext4 and others may otherwise order a rename before the
data it names, after a power cut too (Pillai et al. 2014, "All file systems are not created equal").
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from formats.errors import MachineError

TEMPORARY = ".tmp-"
BAD = ".bad-"
TILES = ".tiles-"

_FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
_REFUSED = (errno.EACCES, errno.EPERM, errno.EROFS, errno.EIO)
_TAKEN = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)


def temporary(parent: Path, label: str) -> Path:
    """Return the path of a folder in `parent`, not yet made, that no other process uses."""
    return parent / f"{TEMPORARY}{label}-{os.getpid()}-{secrets.token_hex(4)}"


def publish(folder: Path, final: Path) -> bool:
    """Flush `folder` and rename it to `final`, its sibling; False if that name is taken.

    Its files become read-only: hard links may share them with scenes, so no one may edit in place.
    """
    flush_tree(folder, mode=0o444)
    try:
        os.rename(folder, final)
    except OSError as error:
        if error.errno in _TAKEN:
            return False
        raise
    flush(final.parent)
    return True


def set_aside(folder: Path) -> Path | None:
    """Rename a damaged folder to a `.bad-` name beside it; None if another process was faster."""
    bad = folder.with_name(f"{BAD}{folder.name}-{secrets.token_hex(4)}")
    try:
        os.rename(folder, bad)
    except FileNotFoundError:
        return None
    return bad


def remove(folder: Path) -> None:
    """Delete a folder that has a final name; nobody sees it half deleted under that name."""
    doomed = temporary(folder.parent, "gone")
    try:
        os.rename(folder, doomed)
    except FileNotFoundError:
        return
    discard(doomed)


def discard(folder: Path) -> None:
    """Delete a temporary folder, or a temporary file, as far as that is possible."""
    with suppress(OSError):
        if folder.is_dir():
            shutil.rmtree(folder, ignore_errors=True)
        else:
            folder.unlink()


def size_of(folder: Path) -> int:
    """Return the bytes of all files below `folder`."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def require_space(parent: Path, needed: int) -> None:
    """Raise MachineError if the disk of `parent` has fewer than `needed` bytes left."""
    free = shutil.disk_usage(parent).free
    if free < needed:
        raise MachineError(
            parent, "free space", f"{free} bytes, {needed} needed", "free some space on that disk"
        )


@contextmanager
def typed_errors(folder: Path) -> Iterator[None]:
    """Turn a full disk and other refusals of the file system into MachineError.

    `folder` is what was being written. What a codec made of the system's error counts as well, if
    it names that as its cause or quotes its text.
    """
    try:
        yield
    except Exception as error:
        number = _number(error)
        if number is None:
            raise
        remedy = (
            "free some space, or raise the quota or file size limit"
            if number in _FULL
            else "make that folder writable or choose another store"
        )
        written, free = size_of(folder), shutil.disk_usage(folder.parent).free
        state = f"{os.strerror(number)} after {written} bytes, {free} bytes free"
        raise MachineError(folder.parent, "write", state, remedy) from error


def _number(error: BaseException | None) -> int | None:
    """Return the system's error number behind `error`, if there is one."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _FULL + _REFUSED:
            return error.errno
        for number in _FULL:
            if os.strerror(number) in str(error):
                return number
        error = error.__cause__
    return None


def flush_tree(folder: Path, mode: int | None = None) -> None:
    """Flush every file below `folder` to the disk, then the folders. mode : to give the files."""
    for parent, _, files in os.walk(folder, topdown=False):
        for name in files:
            flush(Path(parent, name), mode)
        flush(Path(parent))


def flush(path: Path, mode: int | None = None) -> None:
    """Flush a file, or the names in a folder, to the disk."""
    if os.name == "nt" and path.is_dir():
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        if mode is not None:
            os.fchmod(descriptor, mode)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
