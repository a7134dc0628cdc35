"""Hard cases of what is stored: damage, links, half-written folders, two processes at once."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from formats import seal
from formats.errors import DamagedError
from pipelines.hard.cells import Family, Result, all_of, equal, refused

crash = Family("what is stored")


def _write(path: Path, value: float = 1.0) -> None:
    from formats.files import exr

    exr.write(path, {"sky": np.full((8, 16, 3), value, np.float32)})


def bake(root: Path, *, width: int = 16) -> Any:
    """Bake a tiny map of the environment into a store below `root`."""
    from bake import environment
    from bake.recipe import Source
    from bake.store import Store

    path = root / "sky.exr"
    if not path.exists():
        _write(path)
    store = Store(root / "store", say=lambda line: None)
    source = Source((path,), partial(environment.load, path))
    return store.run(environment.resample, source, params=environment.Params(width=width))


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir()) if p.name != "timings.json"}


def in_root(run: Callable[[Path], Result]) -> Callable[[], Result]:
    """Give a cell a folder of its own."""

    def call() -> Result:
        with tempfile.TemporaryDirectory() as name:
            return run(Path(name))

    return call


def _flip(file: Path, bit: int) -> None:
    data = bytearray(file.read_bytes())
    data[bit // 8 % len(data)] ^= 1 << (bit % 8)
    file.chmod(0o644)
    file.write_bytes(data)


def _flips(root: Path) -> Result:
    entry, rng, missed = bake(root), np.random.default_rng(1), 0
    sound = root / "sound"
    shutil.copytree(entry.path, sound)
    names = [n for n in contents(sound) if n != seal.NAME]
    for _ in range(100):
        copy = root / "copy"
        shutil.copytree(sound, copy)
        _flip(copy / names[rng.integers(len(names))], int(rng.integers(1 << 30)))
        try:
            seal.verify(copy)
            missed += 1
        except DamagedError:
            pass
        shutil.rmtree(copy)
    return equal(missed, 0, "of 100 flipped bits")


def _served(root: Path) -> Result:
    first = bake(root)
    before = contents(first.path)
    _flip(next(p for p in first.path.iterdir() if p.suffix == ".ktx2"), 999)
    second = bake(root)
    aside = [p.name for p in first.path.parent.iterdir() if p.name.startswith(".bad-")]
    return all_of(
        equal(second.hit, False), equal(contents(second.path) == before, True), equal(len(aside), 1)
    )


def _missing(root: Path) -> Result:
    first = bake(root)
    before = contents(first.path)
    first.path.chmod(0o755)
    next(p for p in first.path.iterdir() if p.suffix == ".ktx2").unlink()
    return equal(contents(bake(root).path) == before, True, "baked again")


def _swept(root: Path) -> Result:
    bake(root)
    left = root / "store" / ".tmp-99999-old"
    left.mkdir()
    (left / "half").write_bytes(b"x")
    os.utime(left, (0, 0))
    bake(root, width=8)
    return equal(left.exists(), False, "a temporary folder of long ago")


def _hit(root: Path) -> Result:
    bake(root)
    second = bake(root)
    _write(root / "sky.exr", 2.0)
    third = bake(root)
    return all_of(
        equal(second.hit, True), equal(third.hit, False, "the content counts, not the name")
    )


def _touched(root: Path) -> Result:
    bake(root)
    os.utime(root / "sky.exr", (1e9, 1e9))
    return equal(bake(root).hit, True, "times do not count")


def _at_once(root: Path) -> Result:
    _write(root / "sky.exr")
    with ThreadPoolExecutor(8) as pool:
        entries = list(pool.map(lambda _: bake(root), range(8)))
    same = len({e.path for e in entries}) == 1
    seal.verify(entries[0].path)
    return all_of(equal(same, True), equal(sum(not e.hit for e in entries), 1, "baked once"))


def _no_folder(root: Path) -> Result:
    (root / "store").write_text("a file")
    return refused(lambda: bake(root))


def _link(root: Path) -> Result:
    (root / "asset").mkdir()
    (root / "elsewhere").write_text("x")
    (root / "asset" / "report.json").symlink_to(root / "elsewhere")
    return refused(lambda: seal.seal(root / "asset"))


def _broken_seal(text: str, root: Path) -> Result:
    entry = bake(root)
    copy = root / "copy"
    shutil.copytree(entry.path, copy)
    (copy / seal.NAME).chmod(0o644)
    (copy / seal.NAME).write_text(text)
    return refused(lambda: seal.verify(copy))


def _another(root: Path) -> Result:
    from formats.voxels import Voxels

    return refused(lambda: Voxels.load(bake(root).path))


CASES = (
    ("K1", "flipped bits in an entry", "found when read", "SHA-256: 100 of 100", _flips),
    ("K2", "a damaged entry", "set aside, baked again, same bytes", "never served", _served),
    ("K3", "a missing file", "baked again", "the seal lists it", _missing),
    ("K4", "folders that a killed bake left", "swept", "older than any bake", _swept),
    (
        "K5",
        "the same input again, and other bytes under its name",
        "a hit, and a bake",
        "SHA-256",
        _hit,
    ),
    ("K6", "another time of change", "a hit", "content alone is in the key", _touched),
    (
        "K7",
        "eight bakes of one asset at once",
        "one bakes, all get it",
        "lock and rename",
        _at_once,
    ),
    ("K8", "a file where the store should be", "refused", "an error of the machine", _no_folder),
    ("K9", "a link inside an asset", "refused", "what is sealed is copied", _link),
    ("K11", "an entry of another kind", "refused", "kind and format are checked", _another),
)
for _row, _case, _behaviour, _truth, _run in CASES:
    crash.row(_row, _case, _behaviour, _truth)
    crash.add(_row, "bake.store", in_root(_run))
crash.row("K10", "a broken seal", "refused as damaged", "one line, exit code 4")
for _name, _text in (
    ("nothing", ""), ("no JSON", "{"), ("another format", '{"format": 9, "files": {}}'),
    ("a path out", '{"format": 1, "files": {"../x": {"bytes": 1, "sha256": "00"}}}'),
    ("an absolute path", '{"format": 1, "files": {"/etc/passwd": {"bytes": 1, "sha256": "00"}}}'),
    ("bytes below 0", '{"format": 1, "files": {"a": {"bytes": -1, "sha256": "00"}}}'),
    ("a list", "[]"), ("deep", "[" * 5000),
):  # fmt: skip
    crash.add("K10", _name, in_root(partial(_broken_seal, _text)))
