"""A full disk at every write of every bake: what was there stays, and one line says so.

Three disks: one that is full at the n-th write, folder, rename or flush that Python asks for, and
stays full; one that fails at that alone; and, where a process may mount one, a real one in memory
with n pages left, which the writers in C and C++ meet as well.
"""

from __future__ import annotations

import builtins
import ctypes
import errno
import io
import os
import shutil
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from bake import publish
from bake.store import Store
from tests.hard_crash import forks
from tests.hard_crash.subjects import Subject, leftovers, tree, unfinished
from tests.hard_crash.tally import Note, silent

NAMES = ("mkdir", "rename", "replace", "fsync", "sendfile", "write", "fchmod")
NEW_MOUNTS, PRIVATE = 0x20000, 1 << 18 | 1 << 14
PAGE = 4096
WRONG = ("no typed refusal", "more than one line", "old asset changed", "left behind", "damaged",
         "went on with other bytes", "not gone on with where there is room")  # fmt: skip


@dataclass
class Disk:
    """Counts operations that need space; the n-th fails, and all later ones where it `stays`."""

    full_at: int
    stays: bool
    count: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock)

    def use(self) -> None:
        with self.lock:
            self.count += 1
            count = self.count
        if count == self.full_at or (self.stays and count > self.full_at > 0):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def mount(self) -> None:
        """Take the place of the functions that write, in this process."""
        for name in NAMES:
            setattr(os, name, partial(self._used, getattr(os, name)))
        plain, disk = io.open, self

        class Raw(io.FileIO):
            def write(self, data: Any) -> Any:
                disk.use()
                return super().write(data)

        def opened(file: Any, mode: str = "r", *rest: Any, **named: Any) -> Any:
            writes = set(mode) & set("wax+") and isinstance(file, str | os.PathLike)
            if not writes or str(file) == os.devnull:
                return plain(file, mode, *rest, **named)
            disk.use()
            buffered = io.BufferedWriter(Raw(file, mode.replace("b", "").replace("t", "")))
            if "b" in mode:
                return buffered
            return io.TextIOWrapper(buffered, encoding=named.get("encoding", "utf-8"))

        builtins.open = io.open = opened  # type: ignore[assignment]

    def _used(self, function: Callable[..., Any], *given: Any, **named: Any) -> Any:
        # Messages go to pipes and terminals, which are no disk
        if function.__name__ != "write" or given[0] > 2:
            self.use()
        return function(*given, **named)


def prove(
    subjects: dict[str, Subject],
    folder: Path,
    every: int = 1,
    begin: int = 0,
    note: Note = silent,
) -> dict[str, Any]:
    """Fail each write of each bake, from the subject `begin` on. every : 1, or more to take but
    every n-th.

    Returns counts of trials and of what went wrong, which must all be 0.
    """
    wrong: dict[str, int] = dict.fromkeys(WRONG, 0)
    faults: list[str] = []
    trials = {"full from then on": 0, "failed once": 0, "pages left": 0}
    result = {"trials": trials, "wrong": wrong, "faults": faults, "gone on with": 0}
    for number, (name, subject) in list(enumerate(subjects.items(), 1))[begin:]:
        place = folder / "full"
        truth = _before(subject, place)
        count = forks.value(partial(_counted, subject, place))
        whole = tree(place)
        kinds: list[tuple[str, Callable[[], Any], int]] = []
        for n in range(1, count + 1, every):
            kinds.append(("full from then on", partial(_on, Disk(n, True), subject, place), n))
            kinds.append(("failed once", partial(_on, Disk(n, False), subject, place), n))
        for kind, bake, n in kinds:
            shutil.rmtree(place)
            _before(subject, place)
            found = _told(forks.ended(bake), truth, whole, place)
            trials[kind] += 1
            if not found and (left := unfinished(place)):
                result["gone on with"] += len(left)
                found = _again(forks.ended(partial(_quietly, subject, place)), whole, place)
            if found:
                wrong[found[0]] += 1
                faults.append(f"{name}, {kind}, {n} of {count}: {found[0]}: {found[1]}")
        pages, found_pages = _real_disk(subject, folder / "mounted", truth, whole, every)
        trials["pages left"] += pages
        for problem, text in found_pages:
            wrong[problem] += 1
            faults.append(f"{name}, pages left: {problem}: {text}")
        shutil.rmtree(place)
        note(number, result)
    return result


def _again(ended: dict[str, Any], whole: dict[str, str], build: Path) -> tuple[str, str] | None:
    """Return what is wrong with a bake that went on with finished tiles."""
    if "value" not in ended or tree(build) != whole or unfinished(build):
        return WRONG[-1], str(ended)[-300:]
    return None


def _before(subject: Subject, build: Path) -> dict[str, str]:
    """Have a delivered folder of an earlier bake; return its bytes."""
    subject.place_old(build)
    return tree(build)


def _counted(subject: Subject, build: Path) -> int:
    disk = Disk(0, False)
    _on(disk, subject, build)
    return disk.count


def _on(disk: Disk, subject: Subject, build: Path) -> str:
    """Bake on that disk, in this process."""
    disk.mount()
    _quietly(subject, build)
    return "went on"


def _quietly(subject: Subject, build: Path) -> None:
    Store.__init__.__kwdefaults__["say"] = lambda text: None
    subject.run(build)


def _told(
    ended: dict[str, Any], old: dict[str, str], whole: dict[str, str], build: Path
) -> tuple[str, str] | None:
    """Return what is wrong with how a bake on a full disk ended, and with what it left."""
    disk_now = tree(build)
    if "value" in ended:
        # What failed was but a convenience, such as the memory of parsed code
        same = disk_now == whole and not unfinished(build)
        return None if same else ("went on with other bytes", _differ(whole, disk_now))
    if ended.get("code") != 3:
        return "no typed refusal", str(ended)[-600:]
    if "\n" in ended["refused"] or " -- " not in ended["refused"]:
        return "more than one line", ended["refused"]
    if left := leftovers(build):
        return "left behind", str(left[0])
    shown = {k: v for k, v in disk_now.items() if k.startswith("scenes/")}
    # Flushing the parent is the last thing done: then the new one is there, whole
    if shown not in (old, {k: v for k, v in whole.items() if k.startswith("scenes/")}):
        return "old asset changed", _differ(old, shown)
    stored = {k: v for k, v in disk_now.items() if k not in shown}
    if not stored.items() <= whole.items() or (
        (build / "store").is_dir() and Store(build / "store").verify()
    ):
        return "damaged", _differ(whole, stored)
    return None


def _differ(a: dict[str, str], b: dict[str, str]) -> str:
    return ", ".join(sorted(k for k in a.keys() | b.keys() if a.get(k) != b.get(k)))[:300]


def _real_disk(
    subject: Subject, place: Path, old: dict[str, str], whole: dict[str, str], every: int
) -> tuple[int, list[tuple[str, str]]]:
    """Bake on a disk in memory with 0, 1, 2 ... pages left, until it goes through."""
    place.mkdir(exist_ok=True)
    found, pages = [], 0
    while True:
        ended = forks.ended(partial(_with_pages, subject, place, pages, old, whole))
        if ended.get("value") == "not allowed":
            return 0, []
        if "value" not in ended:
            raise RuntimeError(f"a disk in memory failed: {ended}")
        went_on, problem = ended["value"]
        found += [(problem[0], f"{pages} pages: {problem[1]}")] if problem else []
        pages += every
        if went_on or pages > 4000:
            return pages // every, found


def _with_pages(
    subject: Subject, place: Path, pages: int, old: dict[str, str], whole: dict[str, str]
) -> Any:
    """Mount, fill all but some pages, bake in a child, look. The mount ends with this process."""
    if not _mounted(place):
        return "not allowed"
    _before(subject, place)
    (place / "store").mkdir(mode=0o700)
    with open(place / "ballast", "wb") as stream, suppress(OSError):
        free = shutil.disk_usage(place).free
        os.posix_fallocate(stream.fileno(), 0, free - pages * PAGE)
    # The store would refuse before it begins; it may be wrong about what will be needed
    publish.require_space = lambda parent, needed: None
    ended = forks.ended(partial(_quietly, subject, place))
    (place / "ballast").unlink()
    return "value" in ended, _told(ended, old, whole, place)


def _mounted(place: Path) -> bool:
    """Mount a disk of 8 MiB in memory that only this process sees, if that is allowed."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(NEW_MOUNTS) or libc.mount(b"none", b"/", None, PRIVATE, None):
        return False
    return not libc.mount(b"tmpfs", os.fsencode(place), b"tmpfs", 0, b"size=8m")
