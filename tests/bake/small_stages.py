"""A kind and a few stages so small that the tests of the store are about the store."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from bake.store import Entry, Source, Store
from formats import report
from formats.errors import InputError

calls: list[str] = []
"""What ran, in order, since the bench was set up."""


@dataclass(frozen=True)
class Text:
    """The smallest kind: one file of text."""

    text: str

    def save(self, folder: Path) -> None:
        (folder / "text.txt").write_text(self.text)
        report.write(folder, {"kind": "text", "characters": len(self.text)})

    @classmethod
    def load(cls, folder: Path) -> Text:
        return cls((folder / "text.txt").read_text())


@dataclass(frozen=True)
class Params:
    times: int = 2
    factor: float = 1.0
    joint: str = ""


def repeat(text: str, *, params: Params, progress: Callable[[float], None]) -> Text:
    """Repeat a text of the user."""
    calls.append("repeat")
    progress(1.0)
    return Text(params.joint.join([text] * params.times))


def shout(*texts: Text, params: Any, progress: Callable[[float], None]) -> Text:
    """Join entries in capitals."""
    calls.append("shout")
    return Text("".join(text.text for text in texts).upper())


def failing(text: str, *, params: Any, progress: Callable[[float], None]) -> Text:
    raise InputError("mesh.obj", "faces", "none", "give a mesh with faces")


def exhausted(text: str, *, params: Any, progress: Callable[[float], None]) -> Text:
    raise MemoryError


def threads(text: str, *, params: Any, progress: Callable[[float], None]) -> Text:
    """Tell how many threads each BLAS may use."""
    import numpy as np
    from threadpoolctl import threadpool_info

    np.linalg.norm(np.eye(2))
    counts = [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]
    return Text(f"{len(counts)} libraries, {max(counts, default=1)} threads")


class Unsaveable(Text):
    """Writes one file, then fails as a broken codec would."""

    def save(self, folder: Path) -> None:
        super().save(folder)
        raise OSError(28, os.strerror(28))


def unsaveable(text: str, *, params: Any, progress: Callable[[float], None]) -> Text:
    return Unsaveable(text)


class Unreported(Text):
    def save(self, folder: Path) -> None:
        (folder / "text.txt").write_text(self.text)


def unreported(text: str, *, params: Any, progress: Callable[[float], None]) -> Text:
    return Unreported(text)


def read_text(path: Path) -> str:
    calls.append("read")
    return path.read_text()


def read_and_touch(path: Path) -> str:
    """Read a file that something else writes to at the same time."""
    path.write_text(path.read_text() + "more")
    return path.read_text()


@dataclass
class Bench:
    """A store, what it said, and a source of one small file."""

    folder: Path
    said: list[str]
    path: Path

    @property
    def store(self) -> Store:
        """Open the store as a new process would: nothing is known to be intact."""
        return Store(self.folder, say=self.said.append)

    def bake(
        self, store: Store | None = None, source: Source[str] | None = None, **params: Any
    ) -> Entry:
        """Run the stage `repeat` on the source, in a new store object unless one is given."""
        return (store or self.store).run(repeat, source or self.source, params=Params(**params))

    @property
    def source(self) -> Source[str]:
        return Source((self.path,), partial(read_text, self.path))

    def names(self) -> set[str]:
        return {path.name for path in self.folder.iterdir()}

    def leftovers(self) -> list[str]:
        return sorted(name for name in self.names() if name.startswith((".tmp", ".bad")))


def damage(file: Path) -> None:
    """Flip one bit of a file, whose size and time of change stay as they were."""
    status = file.stat()
    data = bytearray(file.read_bytes())
    data[0] ^= 1
    file.chmod(0o644)
    file.write_bytes(data)
    os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir()) if p.name != "timings.json"}


def bench_in(folder: Path) -> Iterator[Bench]:
    """Set up a bench; whatever the test did, the store must verify at its end."""
    calls.clear()
    path = folder / "input.txt"
    path.write_text("ab")
    bench = Bench(folder / "store", [], path)
    yield bench
    assert bench.store.verify() == []
