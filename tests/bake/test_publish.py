"""A finished entry appears whole, after its bytes, or not at all."""

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from bake import publish
from bake import store as store_module
from formats.errors import MachineError
from tests.bake.small_stages import Bench, Text, bench_in, calls, unsaveable


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    yield from bench_in(tmp_path)


def test_files_reach_the_disk_before_the_name_and_the_name_before_the_return(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """write -> fsync of files -> fsync of folder -> rename -> fsync of parent, by watching os.

    kill -9 cannot test this: pages that were never flushed survive a process, not a power cut.
    """
    store = bench.store
    events: list[tuple[str, Path, str]] = []
    fsync, rename = os.fsync, os.rename

    def state(path: Path) -> str:
        return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "folder"

    def watched_fsync(descriptor: int) -> None:
        path = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        events.append(("fsync", path, state(path)))
        fsync(descriptor)

    def watched_rename(source: Path, target: Path) -> None:
        events.append(("rename", Path(source), ""))
        rename(source, target)

    monkeypatch.setattr(os, "fsync", watched_fsync)
    monkeypatch.setattr(os, "rename", watched_rename)
    entry = bench.bake(store)

    temporary = next(path for what, path, _ in events if what == "rename")
    published = events.index(("rename", temporary, ""))
    flushed = {path.name: (n, seen) for n, (what, path, seen) in enumerate(events[:published])}
    folder_flushed, _ = flushed.pop(temporary.name)
    for file in entry.path.iterdir():
        when, seen = flushed[file.name]
        assert seen == state(file), "its last bytes were flushed"
        assert when < folder_flushed < published
    assert events[published + 1 :] == [("fsync", bench.folder, "folder")]
    assert temporary.name.startswith(".tmp-")


def test_published_files_are_read_only(bench: Bench) -> None:
    """Scenes hold hard links to them: an edit in place would reach the store."""
    entry = bench.bake()
    assert {path.stat().st_mode & 0o777 for path in entry.path.iterdir()} == {0o444}
    assert bench.folder.stat().st_mode & 0o777 == 0o700


def test_a_lost_rename_race_serves_the_winner(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process publishes the same entry between the last look and the rename."""
    store, rename, winners = bench.store, os.rename, []

    def overtaken(source: Path, target: Path) -> None:
        if not winners:
            shutil.copytree(source, target)
            winners.append(target)
        rename(source, target)

    monkeypatch.setattr(os, "rename", overtaken)
    entry = bench.bake(store)
    assert winners == [entry.path]
    assert Text.load(entry.path).text == "abab"
    assert bench.leftovers() == []


def test_a_disk_that_fills_up_is_named_and_nothing_is_left(bench: Bench) -> None:
    with pytest.raises(
        MachineError, match=r"after \d{2,} bytes, \d+ bytes free -- free some space"
    ):
        bench.store.run(unsaveable, bench.source)
    assert bench.names() <= {".locks", ".syntax.json"}


def test_a_disk_too_full_is_refused_before_the_work(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = shutil.disk_usage(bench.path)._replace(free=1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    with pytest.raises(MachineError, match="1000 bytes, 16777216 needed"):
        bench.bake()
    assert calls == []


def test_space_is_asked_for_by_the_largest_past_entry(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = bench.bake(times=1000)
    size = json.loads((entry.path / "timings.json").read_text())["bytes"]
    assert size > 2000
    asked: list[int] = []
    monkeypatch.setattr(publish, "require_space", lambda folder, needed: asked.append(needed))
    bench.bake()
    assert asked == [2 * size + store_module.LEAST_FREE_BYTES]


def test_a_bake_that_finds_all_in_the_store_sweeps_too(bench: Bench) -> None:
    bench.bake()
    left = bench.folder / f".tmp-{'0' * 64}-1-abcdef01"
    left.mkdir()
    os.utime(left, (0, 0))
    assert bench.bake().hit
    assert bench.leftovers() == []
