"""The order of writes, flushes and renames of every bake, as the system is told.

A kill cannot show it: pages that were never flushed survive a process, not a power cut.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from bake import tiles
from pipelines import deliver
from tests.hard_crash import forks
from tests.hard_crash.subjects import Subject

Event = tuple[str, str, str]
WRONG = ("files not flushed before their name", "folders not flushed before their name",
         "names not flushed afterwards")  # fmt: skip


def prove(subjects: dict[str, Subject], folder: Path) -> dict[str, Any]:
    """Bake each subject while watching what flushes and renames, with nothing delivered before
    and where an older folder is to be replaced."""
    wrong, faults = dict.fromkeys(WRONG, 0), []
    names = {"entries": 0, "delivered": 0, "tiles": 0, "others": 0}
    for subject, replaced in itertools.product(subjects.values(), (False, True)):
        build = folder / "ordered"
        if replaced:
            subject.place_old(build)
        events = forks.value(partial(_watched, partial(subject.run, build), build))
        shutil.rmtree(build)
        published, bad = judged([(str(a), str(b), str(c)) for a, b, c in events])
        for name in published:
            names[_kind(Path(name))] += 1
        for problem, path in bad:
            wrong[problem] += 1
            faults.append(f"{subject.name}: {problem}: {path}")
    return {"names": names, "wrong": wrong, "faults": faults[:8]}


def _kind(name: Path) -> str:
    if name.suffix == tiles.SUFFIX:
        return "tiles"
    if name.parent.name == "scenes":
        return "delivered"
    return "others" if name.name.startswith(".") else "entries"


def judged(events: list[Event]) -> tuple[list[str], list[tuple[str, str]]]:
    """Return the final names that were given, and what was wrong with which.

    A flush counts if the file was then as it was when it got its name.
    """
    published: list[str] = []
    bad = []
    for n, (what, target, states) in enumerate(events):
        if what != "rename" or "/.tmp-" in target:
            continue
        published.append(target)
        flushed = {(path, state) for kind, path, state in events[:n] if kind == "fsync"}
        for file in states.split("\n"):
            path, _, state = file.rpartition("=")
            if (path, state) not in flushed:
                bad.append((WRONG[1] if state == "folder" else WRONG[0], path))
        after = {path for kind, path, _ in events[n:] if kind == "fsync"}
        if str(Path(target).parent) not in after:
            bad.append((WRONG[2], target))
    return published, bad


def _watched(bake: Callable[[], object], build: Path) -> list[Event]:
    events: list[Event] = []
    fsync = os.fsync

    def flushed(descriptor: int) -> None:
        path = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        events.append(("fsync", str(path), _state(path)))
        fsync(descriptor)

    def renamed(rename: Callable[..., Any], source: Any, target: Any, **rest: Any) -> Any:
        if Path(target).is_relative_to(build):
            place = Path(source)
            inside = [place, *(sorted(place.rglob("*")) if place.is_dir() else ())]
            states = [f"{path}={_state(path)}" for path in inside]
            events.append(("rename", str(target), "\n".join(states)))
        done = rename(source, target, **rest)
        if done is False:
            # Nothing was there to change places with
            events.pop()
        return done

    os.fsync = flushed
    os.rename, os.replace = partial(renamed, os.rename), partial(renamed, os.replace)
    deliver._exchanged = partial(renamed, deliver._exchanged)
    bake()
    return events


def _state(path: Path) -> str:
    return "folder" if path.is_dir() else hashlib.sha256(path.read_bytes()).hexdigest()
