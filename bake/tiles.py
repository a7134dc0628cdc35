"""Finished tiles of stages that take long: an interrupted bake goes on where it ended.

While the store runs a stage, what its tiles give is written to files beside the entries, in a
folder named by the key; the next run of the same key finds them. A key holds all that a result
depends on, so the number of a call and of a tile in it say the rest. A file appears whole or not at
all, carries its hash, and is believed only if that is right: to lose one costs time, no more.

A file holds some seconds of work, and writing takes about one part in PRICE of the time at most.
The folder takes about MAX_BYTES at most; memory, what tiles gave since the last file.
"""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

from bake import tile_files, workers
from bake.tile_files import Kinds, Place
from formats.errors import BakelightError, DamagedError

Tile = TypeVar("Tile")
Result = TypeVar("Result")

SUFFIX = ".tiles"
EVERY = 5.0
"""Seconds of work that a file holds at least: shorter stages write none."""
PRICE = 100
MAX_BYTES = 1 << 30


def kept(
    function: Callable[[Tile], Result],
    tiles: Iterable[Tile],
    progress: workers.Progress = workers.silent,
    kinds: Kinds = (),
) -> list[Result]:
    """Do as `workers.map_tiles`, but for tiles that an interrupted run has finished.

    What tiles give is as bake.tile_files says; its arrays come in C order. A stage must make its
    calls in the same order every time, from one thread, and share its work out in the same tiles,
    whatever the number of threads.
    """
    work, shelf = list(tiles), _open.get()
    call, done = (0, {}) if shelf is None else shelf.take(len(work), kinds)
    rest = [n for n in range(len(work)) if n not in done]

    def one(n: int) -> Result:
        result: Result = tile_files.settled(function(work[n]), kinds)
        if shelf is not None:
            shelf.put((call, len(work), n), result)
        return result

    if done:
        progress(len(done) / len(work))
    made = workers.map_tiles(one, rest, lambda f: progress((len(done) + f * len(rest)) / len(work)))
    done |= zip(rest, made, strict=True)
    return [done[n] for n in range(len(work))]


def once(function: Callable[[], Result]) -> Result:
    """Do as `kept` with one tile, in this thread: for work that spreads over threads itself."""
    shelf = _open.get()
    call, done = (0, {}) if shelf is None else shelf.take(1, ())
    if not done:
        done[0] = tile_files.settled(function(), ())
        if shelf is not None:
            shelf.put((call, 1, 0), done[0])
    result: Result = done[0]
    return result


class Shelf:
    """The files of one bake's tiles in `folder`, named by its key; it need not exist.

    seconds, count : of work in the files that were found, and of tiles.
    """

    def __init__(self, folder: Path, say: Callable[[str], None]) -> None:
        self.folder, self.key, self.say = folder, folder.name, say
        self.seconds, self.count = 0.0, 0
        self._places: dict[int, set[Path]] = {}
        self._call = -1
        self._lock = threading.Lock()
        self._pending: list[tuple[Place, Any]] = []
        self._bytes, self._full, self._writing = 0, False, False
        self._since, self._pause = perf_counter(), EVERY
        for path in sorted(folder.glob(f"*{SUFFIX}")):
            try:
                head, _ = tile_files.read(path, self.key)
            except DamagedError as error:
                say(f"warning: {error}")
                continue
            self.seconds += head["seconds"]
            self.count += len(head["tiles"])
            # Another process that bakes the same may have published it, and removed this
            with suppress(FileNotFoundError):
                self._bytes += path.stat().st_size
            for (call, _, _), _ in head["tiles"]:
                self._places.setdefault(call, set()).add(path)

    def take(self, count: int, kinds: Kinds) -> tuple[int, dict[int, Any]]:
        """Begin the next call, of `count` tiles; return its number and what tiles gave before."""
        self._call += 1
        found = {}
        for path in sorted(self._places.get(self._call, ())):
            try:
                head, arrays = tile_files.read(path, self.key)
            except DamagedError:
                # Another process may have published the same bake meanwhile
                continue
            for (call, of, n), form in head["tiles"]:
                if (call, of) == (self._call, count):
                    found[n] = tile_files.restored(form, arrays, kinds)
        return self._call, found

    def put(self, place: Place, result: Any) -> None:
        """Keep what a tile gave; write it with others when it is time to."""
        with self._lock:
            self._pending.append((place, result))
            if self._writing or perf_counter() - self._since < self._pause:
                return
            self._writing = True
        self.flush()
        self._writing = False

    def flush(self) -> None:
        """Write what is pending. Where that is not possible nothing is kept any more."""
        begin = perf_counter()
        with self._lock:
            batch, self._pending = self._pending, []
            seconds, self._since = begin - self._since, begin
        if self._full or not batch:
            return
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            path = self.folder / f"{secrets.token_hex(8)}{SUFFIX}"
            self._bytes += tile_files.write(path, self.key, seconds, batch)
        except (OSError, BakelightError) as error:
            self._full = True
            reason = error.strerror if isinstance(error, OSError) else error.value
            self.say(f"warning: finished tiles are no longer kept: {reason}")
        self._full |= self._bytes > MAX_BYTES
        self._pause = max(EVERY, PRICE * (perf_counter() - begin))


_open: ContextVar[Shelf | None] = ContextVar("tiles", default=None)


@contextmanager
def shelf(folder: Path, name: str, say: Callable[[str], None]) -> Iterator[Shelf]:
    """Let `kept` and `once` use `folder` while the stage of that name runs in this thread; say what
    was found. After Ctrl-C, and where memory runs out, what is finished is written, too."""
    opened = Shelf(folder, say)
    if opened.count:
        found = f"{opened.count} tiles, {opened.seconds:.0f} s of work, were done before"
        say(f"going on with {name}: {found}")
    token = _open.set(opened)
    try:
        yield opened
    except (KeyboardInterrupt, MemoryError):
        opened.flush()
        raise
    finally:
        _open.reset(token)
