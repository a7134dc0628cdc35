"""An interrupted stage goes on with the tiles that it had finished, and gives the same bytes."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bake import publish, tile_files, tiles, workers
from bake.store import Store
from formats.errors import DamagedError
from formats.files import atomic
from tests.bake.small_stages import Bench, Text, bench_in, contents

KEY = "5" * 64


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write each tile as soon as it is finished."""
    monkeypatch.setattr(tiles, "EVERY", 0.0)
    monkeypatch.setattr(tiles, "PRICE", 0)
    monkeypatch.setattr(workers, "_count", 1)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    yield from bench_in(tmp_path)


@dataclass(frozen=True)
class Inner:
    """A part of what a tile gives."""

    values: np.ndarray
    nothing: None = None


@dataclass(frozen=True)
class Outer:
    """What a tile gives, of every kind that it may."""

    inner: Inner
    parts: tuple[Any, ...]
    number: int
    share: float
    flag: bool


done: list[int] = []


def count_up(text: str, *, params: Any, progress: Callable[[float], None]) -> Text:
    """A stage of two calls of ten tiles, and something done once."""

    def one(n: int) -> np.ndarray:
        done.append(n)
        return np.arange(n + 1)

    first = tiles.kept(one, range(10), progress)
    middle = tiles.once(lambda: (one(99), 7))
    second = tiles.kept(lambda n: one(n + 10), range(10), progress)
    return Text(text + str([int(v.sum()) for v in (*first, middle[0], *second)]))


def stop_at(call: int) -> Callable[[float], None]:
    """Progress that is interrupted when it is told of for the n-th time."""
    left = [call]

    def progress(fraction: float) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt

    return progress


def interrupt(bench: Bench, call: int) -> Path:
    """Run until the n-th tile; return the folder of what was finished."""
    done.clear()
    with pytest.raises(KeyboardInterrupt):
        bench.store.run(count_up, bench.source, on_progress=stop_at(call))
    [folder] = bench.folder.glob(f"{publish.TILES}*")
    return folder


@pytest.mark.parametrize("call", [1, 6, 10, 13, 19])
def test_an_interrupted_stage_computes_only_the_rest(bench: Bench, call: int) -> None:
    interrupt(bench, call)
    finished = list(done)
    assert len(finished) >= call
    before: list[float] = []
    done.clear()
    entry = bench.store.run(count_up, bench.source, on_progress=before.append)
    assert sorted(finished + done) == sorted([*range(20), 99])
    assert before[0] == min(10, len(finished)) / 10
    assert before[-1] == 1.0
    [told] = bench.said
    stage = re.escape(f"{__name__}.count_up")
    assert re.match(rf"going on with {stage}: {len(finished)} tiles, \d+ s of work", told)
    fresh = Store(bench.folder.with_name("other"), say=bench.said.append)
    assert contents(entry.path) == contents(fresh.run(count_up, bench.source).path)
    assert not list(bench.folder.glob(f"{publish.TILES}*"))
    assert bench.store.run(count_up, bench.source).hit


def test_seconds_of_both_runs_are_counted(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    write = tile_files.write
    monkeypatch.setattr(tile_files, "write", lambda p, k, s, batch: write(p, k, 100.0, batch))
    folder = interrupt(bench, 3)
    files = len(list(folder.iterdir()))
    seconds = bench.store.run(count_up, bench.source).seconds
    # Fractions of a second are the second run's own
    assert files * 100 < seconds < files * 100 + 50
    assert bench.store.timings(f"{__name__}.count_up") == [seconds]


def test_without_a_store_nothing_is_written(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    assert tiles.kept(lambda n: n * n, range(4)) == [0, 1, 4, 9]
    assert tiles.once(lambda: 5) == 5
    assert list(tmp_path.iterdir()) == []


def test_what_takes_less_than_some_seconds_writes_nothing(bench: Bench, monkeypatch: Any) -> None:
    monkeypatch.setattr(tiles, "EVERY", 60.0)
    made: list[Path] = []
    monkeypatch.setattr(tile_files, "write", lambda path, *rest: made.append(path) or 0)
    bench.store.run(count_up, bench.source)
    assert made == []


def test_ctrl_c_loses_no_finished_tile(bench: Bench, monkeypatch: Any) -> None:
    monkeypatch.setattr(tiles, "EVERY", 60.0)
    folder = interrupt(bench, 7)
    finished = len(done)
    [path] = folder.iterdir()
    assert len(tile_files.read(path, folder.name)[0]["tiles"]) == finished >= 7


def test_writing_takes_a_small_share_of_the_time(tmp_path: Path, monkeypatch: Any) -> None:
    """By a clock that only tiles of 1 s and files of .5 s move: one part in 10 at a PRICE of 10."""
    now, written = [0.0], []
    monkeypatch.setattr(tiles, "PRICE", 10)
    monkeypatch.setattr(tiles, "perf_counter", lambda: now[0])

    def tile(n: int) -> None:
        now[0] += 1

    def write(path: Path, key: str, seconds: float, batch: list[Any]) -> int:
        now[0] += 0.5
        written.append((seconds, len(batch)))
        return 1

    monkeypatch.setattr(tile_files, "write", write)
    with tiles.shelf(tmp_path / "tiles", "stage", print):
        tiles.kept(tile, range(41))
    # From file to file 5 s: .5 s for the first of them, and 5 tiles, at whose end 5 s are over
    assert written[0] == (1.0, 1)
    assert written[1:] == [(5.5, 5)] * 8


def test_everything_comes_back_as_it_was(tmp_path: Path, rng: np.random.Generator) -> None:
    arrays = [rng.integers(0, 100, (3, 2)).astype(kind) for kind in ("?", "u1", "i4", "f4", "f8")]
    arrays += [np.zeros((0, 3)), np.array(1.5), arrays[-1][:, ::-1], arrays[3].T]
    value = Outer(Inner(arrays[0]), (tuple(arrays), None), 7, 0.1, True)
    kinds, path = (Outer, Inner), tmp_path / "a.tiles"
    settled = tile_files.settled(value, kinds)
    tile_files.write(path, KEY, 1.5, [((0, 1, 0), settled)])
    head, found = tile_files.read(path, KEY)
    [(place, form)] = head["tiles"]
    back = tile_files.restored(form, found, kinds)
    assert (place, head["seconds"]) == ([0, 1, 0], 1.5)
    assert (back.number, back.share, back.flag, back.parts[1]) == (7, 0.1, True, None)
    assert back.inner.nothing is None
    assert type(back.flag) is bool
    for was, ready, now in zip(arrays, settled.parts[0], back.parts[0], strict=True):
        assert (now.dtype, now.shape) == (was.dtype, was.shape)
        np.testing.assert_array_equal(now, was)
        # Sums over other orders in memory would differ in the last bits
        assert ready.flags.c_contiguous
        assert now.flags.c_contiguous
        assert now.flags.writeable


@pytest.mark.parametrize("value", ["text", [1], np.float32(1), np.array(["a"]), Inner(np.ones(1))])
def test_what_cannot_be_kept_is_refused_in_every_run(value: Any) -> None:
    with pytest.raises(TypeError, match="cannot be kept"):
        tiles.kept(lambda tile: value, range(2))


def test_no_flipped_bit_and_no_cut_file_is_believed(tmp_path: Path) -> None:
    path = tmp_path / "a.tiles"
    tile_files.write(path, KEY, 1.0, [((0, 1, 0), np.arange(9.0))])
    data = path.read_bytes()
    for byte in range(0, len(data), 5):
        changed = bytearray(data)
        changed[byte] ^= 1 << byte % 8
        path.write_bytes(changed)
        with pytest.raises(DamagedError, match="not as it was written"):
            tile_files.read(path, KEY)
    for length in range(0, len(data), 29):
        path.write_bytes(data[:length])
        with pytest.raises(DamagedError):
            tile_files.read(path, KEY)
    path.write_bytes(data)
    with pytest.raises(DamagedError, match="key"):
        tile_files.read(path, "6" * 64)


def test_a_damaged_file_costs_its_tiles_and_a_warning(bench: Bench) -> None:
    folder = interrupt(bench, 5)
    finished, files = len(done), sorted(folder.iterdir())
    data = bytearray(files[0].read_bytes())
    data[-1] ^= 1
    files[0].write_bytes(data)
    done.clear()
    entry = bench.store.run(count_up, bench.source)
    assert len(done) == 21 - finished + 1
    assert "computed again" in bench.said[0]
    sums = [n * (n + 1) // 2 for n in (*range(10), 99, *range(10, 20))]
    assert Text.load(entry.path).text == f"ab{sums}"


def test_files_that_another_process_removes_do_no_harm(bench: Bench, monkeypatch: Any) -> None:
    """Without a lock two processes bake the same, and the first to publish clears away."""
    folder = interrupt(bench, 5)
    read = tile_files.read

    def gone(path: Path, key: str) -> Any:
        found = read(path, key)
        publish.discard(folder)
        return found

    monkeypatch.setattr(tile_files, "read", gone)
    assert Text.load(bench.store.run(count_up, bench.source).path).text.startswith("ab")


def test_calls_that_were_shared_out_otherwise_are_not_taken(tmp_path: Path) -> None:
    for count, expected in ((4, 4), (5, 5), (4, 0)):
        ran: list[int] = []
        with tiles.shelf(tmp_path / "tiles", "stage", lambda text: None):
            found = tiles.kept(lambda n, ran=ran: ran.append(n) or n, range(count))
        assert found == list(range(count))
        assert len(ran) == expected


def test_a_full_disk_stops_the_keeping_and_not_the_bake(bench: Bench, monkeypatch: Any) -> None:
    def full(path: Path, *rest: Any) -> int:
        with atomic.replacing(path):
            raise OSError(28, os.strerror(28))

    monkeypatch.setattr(tile_files, "write", full)
    entry = bench.store.run(count_up, bench.source)
    assert not entry.hit
    assert len(bench.said) == 1
    assert "no longer kept" in bench.said[0]
    assert bench.leftovers() == []


def test_a_bake_keeps_so_many_bytes_and_no_more(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(tiles, "MAX_BYTES", 10_000)
    folder = tmp_path / "tiles"
    with tiles.shelf(folder, "stage", print):
        tiles.kept(lambda n: np.zeros(500), range(40))
    # 4,000 bytes a tile and some hundred around it
    assert len(list(folder.iterdir())) == 3


def test_sweeping(bench: Bench) -> None:
    """Finished tiles stay some days, unless their entry is there; a bake's own are never taken."""
    from filelock import FileLock

    folder = interrupt(bench, 5)
    bench.bake()
    assert folder.is_dir()
    os.utime(folder, (time.time() - 8 * 24 * 3600,) * 2)
    with FileLock(bench.folder / ".locks" / f"{folder.name[-64:]}.lock"):
        bench.bake()
        bench.store.gc(())
        assert folder.is_dir()
    bench.bake()
    assert not folder.exists()
    again = interrupt(bench, 5)
    names = {path.name for path in again.iterdir()}
    entry = bench.store.run(count_up, bench.source)
    # As if it was killed between the two
    again.mkdir()
    assert names
    assert entry.key == again.name[-64:]
    bench.bake()
    assert not again.exists()


def test_gc_removes_finished_tiles(bench: Bench) -> None:
    folder = interrupt(bench, 5)
    assert folder in bench.store.gc((), dry_run=True)
    assert folder.is_dir()
    assert folder in bench.store.gc(())
    assert not folder.exists()
