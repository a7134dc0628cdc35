"""Two and eight bakes of the same at the same time: the same bytes, and no error."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

from bake.store import Store
from tests.hard_crash import forks
from tests.hard_crash.subjects import Subject, leftovers, tree, unfinished
from tests.hard_crash.tally import Note, silent

WRONG = ("failed bakes", "bytes that differ", "temporaries left", "damaged names")


def prove(
    subjects: dict[str, Subject],
    folder: Path,
    trials: int,
    begin: int = 0,
    note: Note = silent,
) -> dict[str, Any]:
    """Start 2, then 8 processes at one moment on one empty build folder, `trials` times each.

    In every second round none waits for another, so that the same names are published at once.
    """
    wrong: Counter[str] = Counter(dict.fromkeys(WRONG, 0))
    faults: list[str] = []
    names, build = list(subjects), folder / "at once"
    truth: dict[str, dict[str, str]] = {}
    result: dict[str, Any] = {"trials": 0, "wrong": wrong, "faults": faults}
    for trial in range(begin, trials):
        subject = subjects[names[trial % len(names)]]
        if subject.name not in truth:
            forks.value(partial(subject.run, build))
            truth[subject.name] = tree(build)
            shutil.rmtree(build)
        for many in (2, 8):
            read, write = os.pipe()
            alone = bool(trial // len(names) % 2)
            children = [
                forks.start(partial(_after, read, write, subject, build, alone))
                for _ in range(many)
            ]
            os.close(read)
            os.close(write)
            ended = [child.end() for child in children]
            bad = [each for each in ended if "value" not in each]
            wrong["failed bakes"] += bool(bad)
            faults += [f"{subject.name}, {many} at once: {str(each)[-500:]}" for each in bad[:1]]
            wrong["bytes that differ"] += tree(build) != truth[subject.name]
            wrong["temporaries left"] += bool(leftovers(build) or unfinished(build))
            wrong["damaged names"] += bool(Store(build / "store").verify())
            shutil.rmtree(build)
        result["trials"] += 1
        note(trial + 1, result)
    return result


def _after(read: int, write: int, subject: Subject, build: Path, alone: bool) -> None:
    """Bake when all have been started: when the pipe's last writer has closed it."""
    os.close(write)
    os.read(read, 1)
    if alone:
        Store.__init__.__kwdefaults__["patience_seconds"] = 0.0
    Store.__init__.__kwdefaults__["say"] = lambda text: None
    subject.run(build)
