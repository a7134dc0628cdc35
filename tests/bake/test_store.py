"""What was baked once is found again, and what is damaged is never served."""

import os
import shutil
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from bake import recipe
from bake.store import Baked, Entry, Source, Store
from formats.errors import DamagedError, InputError, MachineError
from tests.bake.small_stages import (
    Bench,
    Params,
    Text,
    bench_in,
    calls,
    contents,
    damage,
    exhausted,
    failing,
    read_and_touch,
    repeat,
    shout,
    threads,
)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    yield from bench_in(tmp_path)


def test_the_second_run_is_a_hit_and_loads_nothing(bench: Bench) -> None:
    first = bench.bake()
    assert (first.hit, calls) == (False, ["read", "repeat"])
    second = bench.bake()
    assert (second.hit, calls) == (True, ["read", "repeat"])
    assert (second.path, second.key) == (first.path, first.key)
    assert Text.load(first.path).text == "abab"
    assert second.seconds == first.seconds > 0


def test_progress_and_parameters_reach_the_stage(bench: Bench) -> None:
    seen: list[float] = []
    entry = bench.store.run(repeat, bench.source, params=Params(3), on_progress=seen.append)
    assert (seen, Text.load(entry.path).text) == ([1.0], "ababab")


def test_a_stage_has_one_thread_of_blas(bench: Bench) -> None:
    """Whose last bits depend on how many there are."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=2):
        told = Text.load(bench.store.run(threads, bench.source).path).text
    assert told.endswith(" 1 threads"), told


def test_an_entry_is_the_input_of_a_later_stage(bench: Bench) -> None:
    store = bench.store
    first = bench.bake(store)
    joined = store.run(shout, Baked(first, Text.load), Baked(first, Text.load))
    assert Text.load(joined.path).text == "ABABABAB"
    other = bench.bake(times=1)
    assert store.run(shout, Baked(other, Text.load), Baked(other, Text.load)).key != joined.key
    assert store.run(shout, Baked(first, Text.load), Baked(first, Text.load)).hit


def test_the_same_inputs_give_the_same_bytes_in_another_store(bench: Bench, tmp_path: Path) -> None:
    here = bench.bake()
    there = bench.bake(Store(tmp_path / "other"))
    assert not there.hit
    assert there.path.name == here.path.name
    assert contents(there.path) == contents(here.path)


@pytest.mark.parametrize("name", ["text.txt", "report.json", "recipe.json", "seal.json"])
def test_a_damaged_entry_is_set_aside_and_baked_again(bench: Bench, name: str) -> None:
    entry = bench.bake()
    damage(entry.path / name)
    assert [finding.path for finding in bench.store.verify()] == [entry.path]
    again = bench.bake()
    assert (again.hit, again.path) == (False, entry.path)
    assert Text.load(again.path).text == "abab"
    assert len(bench.said) == 1
    assert name in bench.said[0]
    assert bench.leftovers()[0].startswith(".bad-")


@pytest.mark.parametrize("name", ["text.txt", "seal.json", "recipe.json"])
def test_a_missing_file_is_damage(bench: Bench, name: str) -> None:
    entry = bench.bake()
    (entry.path / name).unlink()
    assert not bench.bake().hit
    assert bench.bake().hit


def test_timings_are_outside_the_seal(bench: Bench) -> None:
    entry = bench.bake()
    (entry.path / "timings.json").unlink()
    again = bench.bake()
    assert (again.hit, again.seconds) == (True, 0)


def test_an_entry_under_the_name_of_another_is_damage(bench: Bench) -> None:
    store = bench.store
    one = bench.bake(store)
    two = bench.bake(times=5)
    shutil.rmtree(one.path)
    shutil.copytree(two.path, one.path)
    assert [finding.path for finding in bench.store.verify()] == [one.path]
    assert Text.load(bench.bake().path).text == "abab"


def test_a_damaged_input_is_never_loaded(bench: Bench) -> None:
    """The entry went bad after it was handed out: the later stage refuses, the next run mends."""
    entry = bench.bake()
    damage(entry.path / "text.txt")
    with pytest.raises(DamagedError, match="run the command again"):
        bench.store.run(shout, Baked(entry, Text.load))
    store = bench.store
    mended = bench.bake(store)
    assert Text.load(store.run(shout, Baked(mended, Text.load)).path).text == "ABAB"


def test_verify_finds_what_does_not_belong_there(bench: Bench) -> None:
    bench.bake()
    foreign = [bench.folder / "notes.txt", bench.folder / ("x-" + "0" * 64)]
    foreign[0].write_text("hello")
    foreign[1].mkdir()
    assert {finding.path for finding in bench.store.verify()} == set(foreign)
    foreign[0].unlink()
    foreign[1].rmdir()


def test_a_stage_that_refuses_leaves_nothing(bench: Bench) -> None:
    with pytest.raises(InputError, match=r"mesh\.obj"):
        bench.store.run(failing, bench.source)
    assert bench.names() <= {".locks", ".syntax.json"}


def test_memory_that_runs_out_is_an_error_of_the_machine(bench: Bench) -> None:
    with pytest.raises(MachineError, match="lower the resolution"):
        bench.store.run(exhausted, bench.source)


def test_a_source_written_to_while_it_is_read_is_refused(bench: Bench) -> None:
    with pytest.raises(InputError, match="changed while it was read"):
        bench.store.run(repeat, Source((bench.path,), partial(read_and_touch, bench.path)))


def test_code_edited_under_a_running_process_is_refused(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its old text runs, its new text would be in the key."""
    from bake import fingerprint

    monkeypatch.setattr(fingerprint, "edited", lambda files: list(files)[:1])
    with pytest.raises(InputError, match="edited since this process started"):
        bench.bake()


def test_a_store_that_cannot_be_made_is_an_error_of_the_machine(bench: Bench) -> None:
    with pytest.raises(MachineError, match="choose a folder"):
        Store(bench.path / "store")


def test_gc_keeps_what_it_is_told_and_scenes_keep_their_links(bench: Bench, tmp_path: Path) -> None:
    store = bench.store
    kept = bench.bake(store)
    gone = bench.bake(times=5)
    bad = bench.bake(times=6)
    damage(bad.path / "text.txt")
    bench.bake(times=6)
    linked = tmp_path / "scene.txt"
    linked.hardlink_to(gone.path / "text.txt")

    planned = bench.store.gc({kept.key, bad.key}, dry_run=True)
    assert gone.path.exists()
    assert bench.store.gc({kept.key, bad.key}) == planned
    assert planned[0] == gone.path
    assert planned[1].name.startswith(".bad-")
    assert not any(path.exists() for path in planned)
    assert linked.read_text() == "ab" * 5
    assert bench.leftovers() == []
    assert bench.bake(store).hit
    assert not bench.bake(times=5).hit


def leave_temporary(bench: Bench, key: str, hours: float) -> Path:
    """Leave what a process killed that long ago leaves."""
    folder = bench.store.folder / f".tmp-{key}-123-abc"
    folder.mkdir()
    (folder / "half").write_text("x")
    then = time.time() - 3600 * hours
    os.utime(folder, (then, then))
    return folder


def test_old_leftovers_are_swept_and_young_or_locked_ones_are_not(bench: Bench) -> None:
    from filelock import FileLock

    old, young = leave_temporary(bench, "a" * 64, 7), leave_temporary(bench, "b" * 64, 1)
    held = leave_temporary(bench, "c" * 64, 7)
    file = bench.folder / ".tmp-123-abc"
    file.write_text("half")
    os.utime(file, (0, 0))
    with FileLock(bench.folder / ".locks" / f"{'c' * 64}.lock"):
        bench.bake()
        assert (old.exists(), young.exists(), held.exists()) == (False, True, True)
        assert not file.exists()
    assert bench.store.gc(()) != []
    assert not held.exists()


def test_timings_are_kept_for_forecasts(bench: Bench) -> None:
    store, name = bench.store, f"{repeat.__module__}.repeat"
    entries: list[Entry] = [bench.bake(times=n) for n in (1, 2, 3)]
    for n, entry in enumerate(entries):
        os.utime(entry.path, (n, n))
    assert store.timings(name) == [entry.seconds for entry in entries]
    assert store.timings(name, Params(times=2)) == [entries[1].seconds]
    assert store.timings("bake.unknown.stage") == []
    (entries[0].path / "timings.json").chmod(0o644)
    (entries[0].path / "timings.json").write_text("{ damaged")
    assert store.timings(name) == [entry.seconds for entry in entries[1:]]


def test_waiting_is_said_and_patience_ends(bench: Bench) -> None:
    """A lock that never comes free costs work, never correctness."""
    from filelock import FileLock

    store = Store(bench.folder, say=bench.said.append, patience_seconds=0.1)
    key = recipe.key(recipe.of(repeat, (bench.source,), Params()))
    with FileLock(bench.folder / ".locks" / f"{key}.lock"):
        entry = bench.bake(store)
    assert (entry.key, entry.hit) == (key, False)
    assert bench.said == [f"waiting for another process that bakes {repeat.__module__}.repeat"]
