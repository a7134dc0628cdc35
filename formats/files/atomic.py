"""Files that appear whole or not at all: temporary name, fsync, rename, fsync of the folder."""

from __future__ import annotations

import errno
import os
import re
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from formats.errors import InputError, MachineError

TEMPORARY = ".tmp-"
"""Names that start so are unfinished: a sweeper may delete them, a seal leaves them out."""

STALE_HOURS = 6

_OURS = re.compile(re.escape(TEMPORARY) + r"\d+-[0-9a-f]{12}")  # what `replacing` calls them
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder; on success it takes the place of `path`.

    When the block raises, nothing is left behind and an older file stays as it was. An OSError
    becomes MachineError where the disk is full, InputError where the folder cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f"{TEMPORARY}{os.getpid()}-{secrets.token_hex(6)}")
    try:
        yield temporary
        _flush(temporary, os.O_RDWR)
        os.replace(temporary, path)
        _flush(path.parent, os.O_RDONLY)
    except OSError as error:
        reason = error.strerror or str(error)
        if error.errno in _FULL:
            raise MachineError(path, "write", reason, "free some disk space") from error
        remedy = "choose a folder that exists and can be written"
        raise InputError(path, "write", reason, remedy) from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` in one step; errors as in `replacing`."""
    with replacing(path) as temporary, open(temporary, "xb") as stream:
        stream.write(data)


def sweep(folder: Path) -> None:
    """Remove the temporaries that killed processes left in a folder hours ago, and nothing else."""
    latest = time.time() - 3600 * STALE_HOURS
    with suppress(OSError):
        for file in list(os.scandir(folder)):
            ours = _OURS.fullmatch(file.name) and file.is_file(follow_symlinks=False)
            if ours and file.stat().st_mtime < latest:
                os.unlink(file.path)


def _flush(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
