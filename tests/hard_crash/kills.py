"""kill -9 at random moments of every bake; then the store is verified and the bake run again."""

from __future__ import annotations

import os
import random
import select
import shutil
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from bake import publish, tile_files, tiles
from bake.store import Store
from formats.errors import DamagedError
from pipelines import deliver
from tests.hard_crash import forks
from tests.hard_crash.subjects import Subject, leftovers, tree, unfinished
from tests.hard_crash.tally import Note, silent

PATIENCE = 60.0


def prove(
    subjects: dict[str, Subject],
    folder: Path,
    kills: int,
    begin: int = 0,
    note: Note = silent,
    seed: int = 1,
) -> dict[str, Any]:
    """Kill bakes, from the trial `begin` on; return counts of what went wrong, which must all be 0,
    and of what was hit.

    Half of the kills come at any moment of a bake, half while something is written, which takes
    but a small share of the time. Every fifth bake is killed again while it is resumed.
    """
    wrong: Counter[str] = Counter(dict.fromkeys(WRONG, 0))
    hit: Counter[str] = Counter()
    faults: list[str] = []
    names = list(subjects)
    truth = {
        name: _truth(subjects[name], folder / "truth" / str(n)) for n, name in enumerate(names)
    }
    result: dict[str, Any] = {"kills": 0, "wrong": wrong, "hit": hit, "faults": faults}
    for trial in range(begin, kills):
        rng = random.Random(f"{seed} {trial}")
        name = names[trial % len(names)]
        build, writing = folder / "killed", bool(trial // len(names) % 2)
        kill = partial(_kill, subjects[name], build, rng, truth[name], writing)
        while True:
            subjects[name].place_old(build)
            old = tree(build)
            hit[state := kill()] += 1
            # What ended before the kill came proves nothing
            if state != ENDED:
                break
            shutil.rmtree(build)
        if trial % 5 == 4:
            hit[state := kill()] += 1
        before = dict(wrong)
        _check(subjects[name], build, old, truth[name]["tree"], wrong, hit, faults)
        if wrong != before and len(faults) < 5:
            faults.append(f"{name}, trial {trial}, killed {state}")
        shutil.rmtree(build)
        result["kills"] += 1
        note(trial + 1, result)
    return result


WRONG = ("damaged names", "failed resumes", "bytes that differ", "temporaries left", "warnings")
GOING_ON = "going on with"
ENDED = "ended before"


def _truth(subject: Subject, build: Path) -> dict[str, Any]:
    """Bake without a kill, twice, in children: bytes, seconds, and when writing begins."""

    def timed() -> dict[str, Any]:
        moments: list[float] = []
        tell(lambda: moments.append(time.perf_counter() - begin))
        begin = time.perf_counter()
        subject.run(build)
        return {"seconds": time.perf_counter() - begin, "moments": moments}

    forks.value(timed)
    found: dict[str, Any] = {"tree": tree(build)}
    shutil.rmtree(build)
    found |= forks.value(timed)
    if tree(build) != found["tree"]:
        raise RuntimeError(f"{subject.name} is not the same twice")
    shutil.rmtree(build)
    return found


def tell(note: Callable[[], None]) -> None:
    """Let the store and the delivery call `note` where they begin to write, in this process."""
    name, fill, write = publish.temporary, deliver.copy, tile_files.write

    def temporary(parent: Path, label: str) -> Path:
        note()
        return name(parent, label)

    def copy(source: Path, target: Path) -> None:
        note()
        fill(source, target)

    def kept(*given: Any) -> int:
        note()
        return write(*given)

    publish.temporary, deliver.copy, tile_files.write = temporary, copy, kept


def _kill(
    subject: Subject, build: Path, rng: random.Random, truth: dict[str, Any], writing: bool
) -> str:
    """Start a bake and kill it; return what it was at."""
    read, write = os.pipe()

    def bake() -> None:
        tell(lambda: os.write(write, b".") and None)
        _saying(subject, build, lambda text: None)

    child = forks.start(bake)
    os.close(write)
    if writing:
        for _ in range(rng.randint(1, max(1, len(truth["moments"])))):
            select.select([read], [], [], PATIENCE)
            os.read(read, 1)
        # Files of a tiny entry are written and flushed in some milliseconds
        time.sleep(rng.uniform(0, 0.012))
    else:
        time.sleep(rng.uniform(0, 1.1 * truth["seconds"]))
    child.kill()
    ended = child.end()
    os.close(read)
    if "killed" not in ended:
        return ENDED
    if any(path.parent.name.startswith(publish.TILES) for path in leftovers(build)):
        return "writing tiles"
    return "writing" if leftovers(build) else "working"


def _saying(subject: Subject, build: Path, say: Callable[[str], None]) -> None:
    Store.__init__.__kwdefaults__["say"] = say
    subject.run(build)


def _check(
    subject: Subject,
    build: Path,
    old: dict[str, str],
    truth: dict[str, str],
    wrong: Counter[str],
    hit: Counter[str],
    faults: list[str],
) -> None:
    """Look at what a kill left, resume, look again."""
    build.mkdir(parents=True, exist_ok=True)
    damaged = forks.value(
        lambda: [str(finding.path) for finding in Store(build / "store").verify()]
    )
    wrong["damaged names"] += bool(damaged) or not all(map(_whole, unfinished(build)))
    # What has its final name is as it would be at the end
    visible = {k: v for k, v in tree(build).items() if ".tmp-" not in k}
    shown = {k: v for k, v in visible.items() if k.startswith("scenes/")}
    hit["no folder for a moment"] += not shown
    stored = visible.keys() - shown.keys()
    wrong["bytes that differ"] += any(truth.get(k) != visible[k] for k in stored)
    wrong["bytes that differ"] += not (shown in ({}, old) or shown.items() <= truth.items())
    # A day goes by
    for path in leftovers(build):
        os.utime(path, (0, 0))
    said: list[str] = []

    def resume() -> list[str]:
        _saying(subject, build, said.append)
        return said

    ended = forks.ended(resume)
    wrong["failed resumes"] += "value" not in ended
    told = [text for text in ended.get("value", ()) if not text.startswith(GOING_ON)]
    wrong["warnings"] += bool(told)
    hit["gone on with from tiles"] += len(told) < len(ended.get("value", ()))
    if "value" not in ended:
        faults.append(str(ended)[-400:])
    wrong["bytes that differ"] += tree(build) != truth
    wrong["temporaries left"] += bool(leftovers(build) or unfinished(build))


def _whole(folder: Path) -> bool:
    """Whether each file of finished tiles is as it was written."""
    try:
        for path in folder.glob(f"*{tiles.SUFFIX}"):
            tile_files.read(path, folder.name)
    except DamagedError:
        return False
    return True


def control(subject: Subject, folder: Path, kills: int, seed: int = 1) -> int:
    """Kill bakes whose store writes in place; return how many names were found damaged.

    It must not be 0: the proof above can fail.
    """
    rng, found = random.Random(seed), 0
    truth = _truth(subject, folder / "truth")
    for _ in range(kills):
        build = folder / "in place"
        _kill(Subject(subject.name, partial(_in_place, subject)), build, rng, truth, True)
        build.mkdir(parents=True, exist_ok=True)
        found += forks.value(lambda build=build: len(Store(build / "store").verify()))
        shutil.rmtree(build)
    return found


def _in_place(subject: Subject, store: Store) -> Any:
    """Bake as a store would that gives names first and writes then."""
    told = publish.temporary

    def final(parent: Path, label: str) -> Path:
        told(parent, label)
        return parent / f"in.place-{label}"

    publish.temporary = final
    publish.publish = lambda folder, final: True
    publish.discard = lambda folder: None
    return subject.bake(store)


def control_of_tiles(subjects: dict[str, Subject], folder: Path) -> list[str]:
    """End bakes after their first file of tiles, and go on with what they gave turned round; return
    the names of those whose bytes differ or that fail, as all should."""
    found = []
    for name, subject in subjects.items():
        build = folder / "turned"
        truth = _truth(subject, build)["tree"]
        forks.ended(partial(end_at_tiles, subject, build))
        ended = forks.ended(partial(_with_turned_tiles, subject, build))
        if "value" not in ended or tree(build) != truth:
            found.append(name)
        shutil.rmtree(build)
    return found


def end_at_tiles(subject: Subject, build: Path) -> None:
    """Bake in this process until memory runs out after the first file of tiles."""
    written: list[int] = []
    write = tile_files.write

    def ending(*given: Any) -> int:
        written.append(write(*given))
        if len(written) == 1:
            raise MemoryError
        return written[-1]

    tile_files.write = ending
    _saying(subject, build, lambda text: None)


def _with_turned_tiles(subject: Subject, build: Path) -> None:
    read = tile_files.read

    def turned(*given: Any) -> tuple[dict[str, Any], list[Any]]:
        head, arrays = read(*given)
        return head, [array[..., ::-1] for array in arrays]

    tile_files.read = turned
    _saying(subject, build, lambda text: None)
