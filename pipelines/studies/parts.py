"""Parts of a study that takes long: what was counted before an interruption is not counted again.

A part is a file of JSON in a folder named by the answer's key, which holds all that it follows
from. The folder goes once the answer is written down; parts of other keys go with it.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from formats.files import atomic

_folder: ContextVar[Path | None] = ContextVar("parts", default=None)


@contextmanager
def into(folder: Path, key: str) -> Iterator[None]:
    """Keep the parts of a study in `folder` / `key` until the block has ended well; none without a
    key."""
    token = _folder.set(folder / key if key else None)
    try:
        yield
    finally:
        _folder.reset(token)
    shutil.rmtree(folder, ignore_errors=True)


def part(name: str, make: Callable[[], list[Any]]) -> list[Any]:
    """Return what `make` does, a list of what JSON holds, or what it did in a run before.

    name : tells the parts of a study apart.
    """
    folder = _folder.get()
    if folder is None:
        return make()
    path = folder / f"{re.sub(r'[^0-9a-zA-Z]+', '-', name)}.json"
    try:
        found = json.loads(path.read_bytes())
    except (OSError, ValueError):
        found = None
    if isinstance(found, list):
        return found
    made = make()
    folder.mkdir(parents=True, exist_ok=True)
    atomic.write_bytes(path, json.dumps(made).encode())
    return made
