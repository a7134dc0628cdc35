"""Single flipped bits in entries of every kind: all are found, and none is served."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import random
import shutil
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bake import recipe, tiles
from bake.photographs import Photographs
from bake.store import Store
from formats import seal
from formats.billboard import Billboard
from formats.coefficients import Coefficients
from formats.dome import Dome
from formats.environment import Environment
from formats.errors import DamagedError
from formats.lightmap import Lightmap
from formats.mesh import Mesh
from formats.occlusion import MASTER, Occlusion, OcclusionHarmonics
from formats.picture import Picture
from formats.transfer import Layout, primitives
from formats.voxels import Voxels
from tests.hard_crash import forks, kills
from tests.hard_crash.subjects import Subject, tree
from tests.hard_crash.tally import Note, silent

WRONG = ("verify missed", "a load served other values", "no rebuild", "bytes that differ")


def prove(
    subjects: dict[str, Subject],
    folder: Path,
    flips: int,
    begin: int = 0,
    note: Note = silent,
    seed: int = 1,
    verify: Callable[[Path], None] = seal.verify,
) -> dict[str, Any]:
    """Flip one bit at a time, any of a file of an entry, files and their bytes equally often.

    verify : the check of a seal; another one shows that misses are counted. Each flip is looked
    for by `Store.verify` and by the kind's own `load`, which must refuse or, where it does not read
    that file, give the same values; every 20th entry is then baked again where it lies damaged.
    """
    build = folder / "store of all"
    names = [name for name in subjects if subjects[name].scene is None]
    for name in names:
        forks.value(partial(subjects[name].run, build))
    wrong: Counter[str] = Counter(dict.fromkeys(WRONG, 0))
    found: Counter[str] = Counter()
    again: Counter[str] = Counter()
    result: dict[str, Any] = {"flips": 0, "wrong": wrong, "found": found, "of": again}
    whole = tree(build)
    entries = sorted(p for p in (build / "store").iterdir() if not p.name.startswith("."))
    kinds = {entry: json.loads((entry / "report.json").read_bytes())["kind"] for entry in entries}
    values = {entry: forks.value(partial(_digest, entry, kinds[entry])) for entry in entries}
    for flip in range(begin, flips):
        rng = random.Random(f"{seed} {flip}")
        entry = entries[flip % len(entries)]
        path = rng.choice(sorted(p for p in entry.iterdir() if p.name != "timings.json"))
        data = path.read_bytes()
        bit = rng.randrange(8 * len(data))
        _write(path, _flipped(data, bit))
        seal.verify, kept = verify, seal.verify
        findings = {finding.path for finding in Store(build / "store").verify()}
        seal.verify = kept
        wrong["verify missed"] += findings != {entry}
        loaded = forks.ended(partial(_digest, entry, kinds[entry]))
        refused = loaded.get("code") == DamagedError.exit_code
        found["refused by load" if refused else "not read by load"] += 1
        wrong["a load served other values"] += not refused and loaded != {"value": values[entry]}
        if flip % 20 == 0:
            found["baked again"] += 1
            ended = forks.ended(lambda: [_again(subjects[name], build) for name in names])
            wrong["no rebuild"] += "value" not in ended or not entry.is_dir()
            for bad in (build / "store").glob(".bad-*"):
                shutil.rmtree(bad)
            wrong["bytes that differ"] += tree(build) != whole
            again.update(WRONG[2:])
        else:
            _write(path, data)
        result["flips"] += 1
        note(flip + 1, result)
    return result


def prove_tiles(
    subjects: dict[str, Subject],
    folder: Path,
    flips: int,
    begin: int = 0,
    note: Note = silent,
    seed: int = 1,
) -> dict[str, Any]:
    """Flip one bit at a time of what interrupted bakes had finished, and go on with them."""
    names, left = list(subjects), folder / "interrupted"
    truth: dict[str, dict[str, str]] = {}
    wrong: Counter[str] = Counter(dict.fromkeys(WRONG_TILES, 0))
    result: dict[str, Any] = {"flips": 0, "wrong": wrong}
    for flip in range(begin, flips):
        rng, name = random.Random(f"{seed} {flip}"), names[flip % len(names)]
        if name not in truth:
            forks.value(partial(subjects[name].run, folder / "whole" / name))
            truth[name] = tree(folder / "whole" / name)
            forks.ended(partial(kills.end_at_tiles, subjects[name], left / name))
        build = folder / "flipped"
        shutil.copytree(left / name, build)
        path = rng.choice(sorted(build.rglob(f"*{tiles.SUFFIX}")))
        data = path.read_bytes()
        _write(path, _flipped(data, rng.randrange(8 * len(data))))
        said = forks.value(partial(_said, subjects[name], build))
        wrong["not told of"] += not any(path.name in text for text in said)
        wrong["bytes that differ"] += tree(build) != truth[name]
        shutil.rmtree(build)
        result["flips"] += 1
        note(flip + 1, result)
    return result


WRONG_TILES = ("not told of", "bytes that differ")


def _said(subject: Subject, build: Path) -> list[str]:
    said: list[str] = []
    subject.run(build, say=said.append)
    return said


def _again(subject: Subject, build: Path) -> None:
    subject.run(build, say=lambda text: None)
    # A later stage's entry hides an earlier one that lies damaged: ask for all
    store = Store(build / "store", say=lambda text: None)
    sprite = getattr(subject.bake, "keywords", {}).get("sprite")
    if sprite is not None:
        given = sprite.source
        for step in sprite.steps:
            entry = store.run(step.stage, given, params=step.params)
            given = recipe.Baked(entry, step.load)


def _flipped(data: bytes, bit: int) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def _write(path: Path, data: bytes) -> None:
    path.chmod(0o644)
    path.write_bytes(data)


def _digest(entry: Path, kind: str) -> str:
    """Load an entry as its kind does; return a hash of all its values."""
    return digest(LOADS[kind](entry))


def _transfer(folder: Path) -> Any:
    """Read what the player reads."""
    return Layout.load(folder), primitives(folder)


LOADS: dict[str, Callable[[Path], Any]] = {
    "billboard": Billboard.load,
    "coefficients": Coefficients.load,
    "dome": Dome.load,
    "environment": Environment.load,
    "lightmap": Lightmap.load,
    "mesh": Mesh.load,
    "occlusion": Occlusion.load,
    MASTER: OcclusionHarmonics.load,
    "photographs": Photographs.load,
    "picture": Picture.load,
    "transfer": _transfer,
    "voxels": Voxels.load,
}
"""How each kind of folder is read whole."""


def digest(value: object) -> str:
    """Hash all arrays and numbers of an asset."""
    state = hashlib.sha256()
    _feed(value, state.update)
    return state.hexdigest()


def _feed(value: Any, update: Callable[[bytes], object]) -> None:
    if isinstance(value, np.ndarray):
        update(f"{value.dtype} {value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            _feed(getattr(value, field.name), update)
    elif isinstance(value, dict):
        for key in sorted(value):
            update(repr(key).encode())
            _feed(value[key], update)
    elif isinstance(value, list | tuple):
        for item in value:
            _feed(item, update)
    else:
        update(repr(value).encode())
