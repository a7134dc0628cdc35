"""What was measured once is not measured again: the key of an answer, and how long answers take.

A key is a hash of all that an answer follows from: the study's code and what it imports, without
comments, and the code that draws it; the shaders and passes, where it plays something; the files it
measures on; quick or full, the seed, the source, the versions, the class of machine.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

from bake import machine, syntax
from formats.files import atomic
from pipelines.current import digest
from pipelines.studies.answer import LIBRARIES
from pipelines.studies.subjects import Setting

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("pipelines", "bake", "runtime", "formats", "maths")
SIDECARS = (".lp",)  # sources whose folder holds what they name
TIMES = "seconds.json"


def key(question: str, setting: Setting) -> str:
    """Return the key of a study's answer, 64 hex digits."""
    parts = {
        "code": code(f"pipelines.studies.{question}"),
        "shown": code("pipelines.studies.record"),
        "files": files(),
        "quick": setting.quick,
        "seed": setting.seed,
        "source": source(setting.source),
        "versions": machine.versions(LIBRARIES),
        "machine": machine.name(),
    }
    return hashlib.sha256(syntax.canonical(parts).encode()).hexdigest()


def code(module: str) -> str:
    """Return a hash of a module's code and of all that it imports from the project."""
    found: dict[str, str] = {}
    waiting, plays = [module], False
    while waiting:
        dotted = waiting.pop()
        path = ROOT.joinpath(*dotted.split(".")).with_suffix(".py")
        if dotted in found or dotted.partition(".")[0] not in PACKAGES or not path.is_file():
            continue
        tree, imports = syntax.of(path)
        found[dotted] = tree
        plays = plays or dotted.startswith("runtime.")
        waiting += syntax.absolute(imports, dotted.rpartition(".")[0])
    if plays:
        found["runtime"] = player()
    return hashlib.sha256(syntax.canonical(sorted(found.items())).encode()).hexdigest()


@cache
def player() -> str:
    """Return a hash of the passes and shaders, which the player finds by their names."""
    paths = [p for p in sorted((ROOT / "runtime").rglob("*")) if p.is_file()]
    texts = [
        syntax.of(p)[0] if p.suffix == ".py" else digest(p)
        for p in paths
        if "__pycache__" not in p.parts
    ]
    return hashlib.sha256(syntax.canonical(texts).encode()).hexdigest()


@cache
def files() -> str:
    """Return a hash of the assets that studies measure on."""
    paths = [p for p in sorted((ROOT / "assets").rglob("*")) if p.is_file()]
    told = [[p.relative_to(ROOT).as_posix(), digest(p)] for p in paths if p.suffix != ".pyc"]
    return hashlib.sha256(syntax.canonical(told).encode()).hexdigest()


def source(path: Path | None) -> list[str]:
    """Return hashes of the user's source, and of its neighbours where it names them."""
    if path is None:
        return []
    beside = sorted(p for p in path.parent.iterdir() if p.is_file() and p != path)
    return [digest(p) for p in [path, *(beside if path.suffix.lower() in SIDECARS else ())]]


def is_current(out: Path, question: str, wanted: str) -> bool:
    """Say whether an answer of this key lies in a folder, with its part of the page."""
    return read(out, question).get("key") == wanted and part_of(out, question).is_file()


def read(out: Path, question: str) -> dict[str, Any]:
    """Return what the JSON of an answer says; empty where there is none."""
    return _read(out / f"{question}.json")


def part_of(out: Path, question: str) -> Path:
    """Return where the part of the page lies."""
    return out / "parts" / f"{question}.html"


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}


def seconds(out: Path, question: str, quick: bool) -> float | None:
    """Return how long a study took here, or else where results are committed; None if unknown."""
    name = f"{question}, {'quick' if quick else 'full'}"
    for folder in (out, *sorted((ROOT / "results").glob("*"))):
        found = _read(folder / TIMES).get(name)
        if isinstance(found, int | float):
            return float(found)
    return None


def note(out: Path, question: str, quick: bool, taken: float) -> None:
    """Remember how long a study took."""
    known = _read(out / TIMES) | {f"{question}, {'quick' if quick else 'full'}": round(taken, 1)}
    atomic.write_bytes(out / TIMES, (json.dumps(known, indent=1, sort_keys=True) + "\n").encode())
