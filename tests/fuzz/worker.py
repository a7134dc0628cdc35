"""Read damaged files one after the other in a process of its own, with limits.

    python -m tests.fuzz.worker SUBJECT START STOP FOLDER

FOLDER/at holds the number of the input being read, so that who watches can tell what crashed;
FOLDER/found.jsonl gets a line a fault. Input n of a subject is the same on every machine.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import warnings
from pathlib import Path
from random import Random
from time import process_time

import numpy as np

from formats.errors import BakelightError, MachineError
from tests.fuzz import mutations, subjects

MEMORY = 512 << 20  # bytes that reading may take beyond what the process had
SECONDS = 2.0


def main(name: str, start: int, stop: int, folder: Path) -> None:
    """Read inputs start..stop - 1 of a subject."""
    np.seterr(all="raise", under="ignore")
    warnings.simplefilter("ignore")
    os.fsync = lambda _: None  # what is written here is read once
    subject = subjects.SUBJECTS[name]
    seeds = subject.seeds(folder)
    path = folder / (subject.place or f"input{subject.suffix}")
    # Import and allocate what every read needs before the limit
    path.write_bytes(seeds[0])
    subject.read(path)
    limit = _address_space() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    with open(folder / "at", "wb", buffering=0) as at, open(folder / "found.jsonl", "a") as found:
        for number in range(start, stop):
            at.seek(0)
            at.write(b"%12d" % number)
            path.write_bytes(damaged(name, seeds, number))
            began = process_time()
            fault = read(subject, path)
            seconds = process_time() - began
            if not fault and seconds > SECONDS:
                fault = f"{seconds:.1f} s"
            if fault:
                found.write(json.dumps({"subject": name, "number": number, "fault": fault}) + "\n")
                found.flush()
        at.seek(0)
        at.write(b"%12d" % stop)


def damaged(name: str, seeds: list[bytes], number: int) -> bytes:
    """Return input `number` of a subject."""
    rng = Random(f"{name} {number}")
    return mutations.mutate(rng.choice(seeds), rng, subjects.SUBJECTS[name].mutations)


def read(subject: subjects.Subject, path: Path) -> str:
    """Read a file; return what is wrong with how that ended, "" for nothing."""
    try:
        subject.read(path)
    except MachineError as error:
        return f"memory: {error}"
    except BakelightError as error:
        return "" if "\n" not in str(error) else f"several lines: {error!s:.200}"
    except BaseException as error:
        return subjects.described(error)
    return ""


def _address_space() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
