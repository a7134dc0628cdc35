"""Everything that a result depends on is in its key, and nothing else."""

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy
import pytest

from bake import recipe
from bake.store import Source
from formats.errors import InputError
from tests.bake.small_stages import (
    Bench,
    Params,
    Text,
    bench_in,
    damage,
    read_text,
    repeat,
    unreported,
)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    yield from bench_in(tmp_path)


def test_defaults_are_part_of_the_parameters(bench: Bench) -> None:
    run = bench.store.run
    default = run(repeat, bench.source, params=Params())
    assert run(repeat, bench.source, params=Params(times=2)).hit
    others = [Params(times=3), Params(factor=1.5), Params(joint=","), Params(factor=-0.0)]
    keys = {run(repeat, bench.source, params=params).key for params in others} | {default.key}
    assert len(keys) == 5


def test_one_byte_of_the_source_counts_even_at_the_same_time_of_change(bench: Bench) -> None:
    first = bench.bake()
    damage(bench.path)
    second = bench.bake()
    assert not second.hit
    assert second.key != first.key
    damage(bench.path)
    assert bench.bake().hit


def test_time_of_change_and_folder_of_the_source_do_not_count(bench: Bench, tmp_path: Path) -> None:
    bench.bake()
    os.utime(bench.path, (1, 1))
    assert bench.bake().hit
    (tmp_path / "elsewhere").mkdir()
    moved = shutil.move(bench.path, tmp_path / "elsewhere" / "input.txt")
    assert bench.bake(source=Source((Path(moved),), partial(read_text, Path(moved)))).hit


def test_names_order_and_number_of_files_count(bench: Bench, tmp_path: Path) -> None:
    """A mesh names its textures: the same bytes under exchanged names are another input."""
    a, b = tmp_path / "a", tmp_path / "b"
    a.write_text("x")
    b.write_text("y")

    def key(*more: Path) -> str:
        source = Source((bench.path, *more), partial(read_text, bench.path))
        return bench.bake(source=source).key

    keys = [key(), key(a), key(b), key(a, b), key(b, a)]
    a.write_text("y")
    b.write_text("x")
    keys.append(key(a, b))
    assert len(set(keys)) == 6


def test_arguments_of_the_loader_count(bench: Bench) -> None:
    def key(**options: object) -> str:
        source = Source((bench.path,), partial(read_text, bench.path, **options))
        return recipe.key(recipe.of(repeat, (source,), Params()))

    assert key(up="y") == key(up="y")
    assert len({key(), key(up="y"), key(up="z"), key(scale=[1, 2.0])}) == 4


def test_the_recipe_tells_what_the_entry_is_made_of(bench: Bench) -> None:
    entry = bench.bake()
    told = json.loads((entry.path / "recipe.json").read_text())
    assert told["params"] == {"times": 2, "factor": 1.0, "joint": ""}
    assert told["inputs"][0]["files"] == [["input.txt", hashlib.sha256(b"ab").hexdigest()]]
    assert told["libraries"]["numpy"] == numpy.__version__
    assert str(bench.path.parent) not in json.dumps(told)


def test_a_missing_source_is_named(bench: Bench, tmp_path: Path) -> None:
    missing = tmp_path / "none.obj"
    with pytest.raises(InputError, match=r"none\.obj: No such file"):
        bench.store.run(repeat, Source((missing,), partial(read_text, missing)))
    with pytest.raises(InputError, match="Is a directory"):
        bench.store.run(repeat, Source((tmp_path,), partial(read_text, tmp_path)))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes have names on Unix alone")
def test_a_pipe_or_a_device_is_no_source(bench: Bench, tmp_path: Path) -> None:
    """To hash one would wait for ever, or never end."""
    os.mkfifo(tmp_path / "pipe.hdr")
    (tmp_path / "zero.hdr").symlink_to("/dev/zero")
    for path in (tmp_path / "pipe.hdr", tmp_path / "zero.hdr"):
        with pytest.raises(InputError, match="not a regular file"):
            bench.store.run(repeat, Source((path,), partial(read_text, path)))


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_parameters_must_be_finite(bench: Bench, value: float) -> None:
    with pytest.raises(InputError, match=r"repeat: factor: (nan|inf)"):
        bench.store.run(repeat, bench.source, params=Params(factor=value))


@dataclass
class Loose:
    times: int = 1


def test_misuse_is_told_to_the_programmer(bench: Bench) -> None:
    run = bench.store.run
    with pytest.raises(TypeError, match="top level"):
        run(lambda text, params, progress: Text(text), bench.source)
    with pytest.raises(TypeError, match="top level"):
        run(repeat, Source((bench.path,), lambda: "x"))
    with pytest.raises(TypeError, match="neither a Source nor"):
        run(repeat, "text")  # type: ignore[arg-type]
    for params in ({"times": 1}, Loose(), Params):
        with pytest.raises(TypeError, match="frozen dataclass"):
            run(repeat, bench.source, params=params)
    with pytest.raises(TypeError, match=r"report\.json"):
        run(unreported, bench.source)


def test_what_a_stage_refuses_names_the_users_file(tmp_path: Path) -> None:
    path = tmp_path / "huge.obj"
    source = recipe.Source((path,), dict)
    with pytest.raises(InputError) as told, recipe.naming((source,)):
        raise InputError("mesh", "vertices", 1e30, "scale it down")
    assert str(told.value) == f"{path}: mesh: vertices: 1e+30 -- scale it down"
    # What names the file already, and what has none, stays
    for inputs, file in (((source,), str(path)), ((), "mesh")):
        with pytest.raises(InputError) as told, recipe.naming(inputs):
            raise InputError(file, "vertices", 1e30, "scale it down")
        assert told.value.file == file
