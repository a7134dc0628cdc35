"""The store: what was baked once is never baked again, and what is damaged is never served.

An entry is a sealed folder named by its stage and its key, the SHA-256 of `recipe.json` inside it:
stage, code, parameters, inputs by content, libraries, class of machine. Keys of earlier entries
stand for their content, so keys form a Merkle tree. Two processes may bake the same entry at once:
the first rename wins and the other's result, the same bytes, is dropped; locks only save work.
What a stage that takes long has finished is kept beside the entries until it is (bake/tiles.py).
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from bake import fingerprint, publish, recipe, syntax
from bake.recipe import NO_PARAMS, RECIPE, Baked, Entry, Input, Kind, Source, Stage
from bake.workers import Progress, silent
from formats import seal
from formats.errors import DamagedError, InputError, MachineError

__all__ = ["Baked", "Entry", "Finding", "Source", "Store", "seconds_of"]

LOCKS, SYNTAX = ".locks", ".syntax.json"
REPORT, TIMINGS = "report.json", "timings.json"
LEAST_FREE_BYTES = 16 << 20

_ENTRY = re.compile(r"(?P<stage>[A-Za-z_][\w.]*)-(?P<key>[0-9a-f]{64})")


@dataclass(frozen=True)
class Finding:
    """Something in the store that should not be there: where, and what is wrong with it."""

    path: Path
    problem: str


def _to_stderr(message: str) -> None:
    print(message, file=sys.stderr, flush=True)


class Store:
    """Baked entries in `folder`, which is made if need be.

    say : is told when something damaged is set aside, when another process is waited for, and when
    an interrupted bake goes on.
    patience_seconds : how long to wait for it before baking the same thing alongside.
    stale_hours, tiles_hours : when what killed processes left is swept, and when what interrupted
    ones finished.
    Raises MachineError if the folder cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        *,
        say: Callable[[str], None] = _to_stderr,
        patience_seconds: float = 6 * 3600,
        stale_hours: float = 6,
        tiles_hours: float = 7 * 24,
    ) -> None:
        self.folder = Path(folder).absolute()
        self.say, self.patience_seconds = say, patience_seconds
        self.stale_hours, self.tiles_hours = stale_hours, tiles_hours
        self._verified: set[Path] = set()
        self._swept = False
        syntax.remember(self.folder / SYNTAX)
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            (self.folder / LOCKS).mkdir(mode=0o700, exist_ok=True)
        except OSError as error:
            remedy = "choose a folder that can be written"
            raise MachineError(self.folder, "store", error.strerror or "", remedy) from error

    def run(
        self,
        stage: Stage,
        *inputs: Input,
        params: Any = NO_PARAMS,
        on_progress: Progress | None = None,
    ) -> Entry:
        """Return the entry of `stage(*assets, params=params, progress=on_progress)`, baked if new.

        stage : a top-level function that returns a kind. params : a frozen dataclass of plain
        values, all of which count in the key: none may be a thread count or a path.
        Raises what the stage raises; InputError for unreadable sources, parameters that are not
        finite and edited code; MachineError for a full disk or memory; TypeError for misuse.
        """
        name = fingerprint.name(stage)
        contents = recipe.of(stage, inputs, params)
        syntax.save(self.folder / SYNTAX)
        key = recipe.key(contents)
        path = self.folder / f"{name}-{key}"
        self._sweep()
        if self._is_intact(path):
            return Entry(path, key, True, seconds_of(path))
        with self._lock(key, name):
            if self._is_intact(path, locked=True):
                return Entry(path, key, True, seconds_of(path))
            self._require_space(name)
            recipe.require_unedited(stage, inputs)
            assets = self._load(inputs, contents)
            finished = self.folder / f"{publish.TILES}{key}"
            work = partial(stage, *assets, params=params, progress=on_progress or silent)
            with recipe.naming(inputs):
                kind, seconds = self._finish(work, finished, name)
            recipe.require_unedited(stage, inputs)
            self._publish(kind, path, contents, seconds)
            publish.discard(finished)
        return Entry(path, key, False, seconds)

    def _finish(self, work: Callable[[], Kind], finished: Path, name: str) -> tuple[Kind, float]:
        """Run a stage from the tiles in `finished` on; return what it gives, and its seconds."""
        from threadpoolctl import threadpool_limits  # type: ignore[import-untyped, unused-ignore]

        from bake import tiles

        begin = time.perf_counter()
        try:
            # The last bits of BLAS depend on its threads; tiles have threads of their own
            with tiles.shelf(finished, name, self.say) as shelf, threadpool_limits(limits=1):
                kind = work()
        except MemoryError as error:
            remedy = "lower the resolution or the samples, or close other programs"
            raise MachineError(name, "memory", "not enough", remedy) from error
        return kind, shelf.seconds + time.perf_counter() - begin

    def verify(self) -> list[Finding]:
        """Check every byte of every entry; return what is damaged or foreign, sorted by path.

        Nothing is changed. What is set aside or unfinished is under names that are never served.
        """
        findings = []
        for path in sorted(self.folder.iterdir()):
            unserved = (publish.TEMPORARY, publish.BAD, publish.TILES)
            if path.name in (LOCKS, SYNTAX) or path.name.startswith(unserved):
                continue
            try:
                _check(path)
            except DamagedError as error:
                findings.append(Finding(path, str(error)))
        return findings

    def gc(self, keep: Collection[str], dry_run: bool = False) -> list[Path]:
        """Remove entries whose key is not in `keep`, and all that is set aside or left over.

        Returns what is removed, or would be. Scenes keep their own copies or hard links.
        """
        doomed = [path for path in self._entries() if path.name[-64:] not in keep]
        doomed += sorted(self.folder.glob(f"{publish.BAD}*"))
        if not dry_run:
            for path in doomed:
                publish.remove(path)
                self._verified.discard(path)
        return doomed + self._sweep(again=True, dry_run=dry_run)

    def timings(self, stage: str, params: Any = None) -> list[float]:
        """Return the seconds that runs of the stage of this name took, the latest last.

        With `params` only the runs with equal parameters count.
        """
        paths = [path for path in self._entries() if path.name[:-65] == stage]
        if params is not None:
            wanted = recipe.plain_params(stage, params)
            paths = [path for path in paths if _read_json(path / RECIPE).get("params") == wanted]
        known = [(_mtime(path), seconds_of(path)) for path in paths]
        return [seconds for _, seconds in sorted(known) if seconds > 0]

    def _entries(self) -> list[Path]:
        return sorted(path for path in self.folder.iterdir() if _ENTRY.fullmatch(path.name))

    def _is_intact(self, path: Path, locked: bool = False) -> bool:
        """Check an entry, every byte at its first use in this process; set a bad one aside, if
        `locked`: else another process may just have baked it again."""
        if path in self._verified and path.is_dir():
            return True
        if not path.exists():
            return False
        try:
            _check(path)
        except DamagedError as error:
            if locked:
                self._set_aside(path, error)
            return False
        self._verified.add(path)
        return True

    def _set_aside(self, path: Path, error: DamagedError) -> None:
        with publish.typed_errors(path):
            bad = publish.set_aside(path)
        if bad is not None:
            self.say(f"warning: {error}; set aside as {bad.name}")

    def _load(self, inputs: tuple[Input, ...], contents: dict[str, Any]) -> list[Any]:
        """Load all inputs and make sure that what was loaded is what was hashed."""
        assets = []
        for each, identity in zip(inputs, contents["inputs"], strict=True):
            if isinstance(each, Baked):
                assets.append(self._load_entry(each))
                continue
            assets.append(each.load())
            if each.identity() != identity:
                remedy = "bake again when nothing writes to it"
                raise InputError(each.paths[0], "", "changed while it was read", remedy)
        return assets

    def _load_entry(self, baked: Baked[Any]) -> Any:
        path = baked.entry.path
        remedy = "run the command again: it will be baked anew"
        if not self._is_intact(path):
            raise DamagedError(path, "", "damaged or removed since it was baked", remedy)
        try:
            return baked.load(path)
        except DamagedError as error:
            self._verified.discard(path)
            raise DamagedError(error.file, error.field, error.value, remedy) from error

    def _publish(self, kind: Kind, path: Path, contents: dict[str, Any], seconds: float) -> None:
        temporary = publish.temporary(self.folder, path.name[-64:])
        try:
            with publish.typed_errors(temporary):
                temporary.mkdir(mode=0o700)
                kind.save(temporary)
                if not (temporary / REPORT).is_file():
                    raise TypeError(f"{type(kind).__name__}.save must write {REPORT}.")
                (temporary / RECIPE).write_bytes(recipe.text(contents))
                timings = {"bytes": publish.size_of(temporary), "seconds": seconds}
                (temporary / TIMINGS).write_text(json.dumps(timings) + "\n")
                seal.seal(temporary)
                won = publish.publish(temporary, path)
        finally:
            publish.discard(temporary)
        if won:
            self._verified.add(path)
        elif not self._is_intact(path):
            remedy = "run the command again"
            raise DamagedError(path, "", "another process left a damaged entry", remedy)

    def _require_space(self, name: str) -> None:
        """Refuse before the work if twice the largest entry of this stage does not fit."""
        past = [path for path in self._entries() if path.name[:-65] == name]
        largest = max((_number(path, "bytes") for path in past), default=0)
        publish.require_space(self.folder, LEAST_FREE_BYTES + 2 * int(largest))

    @contextmanager
    def _lock(self, key: str, name: str) -> Iterator[None]:
        """Hold the lock of a key, or go on without if that takes too long or does not work here."""
        from filelock import FileLock, Timeout

        lock = FileLock(self.folder / LOCKS / f"{key}.lock")
        try:
            with suppress(Timeout, NotImplementedError, OSError):
                try:
                    lock.acquire(blocking=False)
                except Timeout:
                    self.say(f"waiting for another process that bakes {name}")
                    lock.acquire(timeout=self.patience_seconds, poll_interval=0.05)
            yield
        finally:
            lock.release(force=True)

    def _sweep(self, again: bool = False, dry_run: bool = False) -> list[Path]:
        """Remove what killed processes left: temporaries hours old whose lock is free, and finished
        tiles that are days old, of an entry that is there or, if `again`, any."""
        if self._swept and not again:
            return []
        self._swept = True
        latest = time.time() - 3600 * self.stale_hours
        old = [p for p in sorted(self.folder.glob(f"{publish.TEMPORARY}*")) if _mtime(p) < latest]
        baked = {path.name[-64:] for path in self._entries()}
        latest = time.time() - 3600 * self.tiles_hours
        for path in sorted(self.folder.glob(f"{publish.TILES}*")):
            if again or path.name[-64:] in baked or _mtime(path) < latest:
                old.append(path)
        stale = [path for path in old if not self._is_locked(path.name.split("-")[1])]
        if not dry_run:
            for path in stale:
                publish.discard(path)
        return stale

    def _is_locked(self, key: str) -> bool:
        from filelock import FileLock, Timeout

        path = self.folder / LOCKS / f"{key}.lock"
        if not path.exists():
            return False
        try:
            with FileLock(path, timeout=0):
                return False
        except (Timeout, NotImplementedError, OSError):
            return True


def _check(path: Path) -> None:
    """Raise DamagedError unless `path` is an entry whose bytes and name are as sealed."""
    match = _ENTRY.fullmatch(path.name)
    if match is None or not path.is_dir():
        raise DamagedError(path, "", "does not belong into a store", "remove it")
    seal.verify(path)
    contents = seal.read_bytes(path, RECIPE)
    if hashlib.sha256(contents).hexdigest() != match["key"]:
        raise DamagedError(path, RECIPE, "is that of another entry", "bake it again")


def _read_json(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}


def _number(path: Path, field: str) -> float:
    value = _read_json(path / TIMINGS).get(field)
    return float(value) if isinstance(value, int | float) and value > 0 else 0.0


def seconds_of(path: Path) -> float:
    """Return the seconds that baking an entry took, 0 where that is not known."""
    return _number(path, "seconds")


def _mtime(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return float("inf")
