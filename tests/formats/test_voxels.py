"""The voxels asset: what it says, saved and loaded, and what it refuses."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats import report, seal, voxel_light, voxels
from formats.errors import DamagedError, InputError
from formats.files import ktx2
from formats.voxels import Voxels


@pytest.fixture
def world(rng: np.random.Generator) -> Voxels:
    albedo = rng.random((5, 3)).astype(np.float32) * np.float32(0.98)
    emission = np.zeros((5, 3), np.float32)
    emission[4] = (9.25, 4.1, 0.3)
    albedo[0] = 0
    cells = rng.integers(0, 5, (5, 6, 7)).astype(np.uint16)
    return Voxels(cells, albedo, emission, 0.1, (-0.3, 0.0, 1.7), {"notes": ["a"]})


def test_what_it_says(world: Voxels) -> None:
    assert world.size == (7, 6, 5)
    assert np.array_equal(world.solid, world.cells > 0)
    assert np.array_equal(world.glowing, world.cells == 4)
    assert world.scale == np.float32(9.25)
    dark = replace(world, emission=np.zeros((5, 3), np.float32))
    assert dark.scale == 1.0
    assert not dark.glowing.any()


@pytest.mark.parametrize("sealed", [False, True])
def test_saved_and_loaded(world: Voxels, sealed: bool, tmp_path: Path) -> None:
    world.save(tmp_path)
    if sealed:
        seal.seal(tmp_path)
    loaded = Voxels.load(tmp_path)
    for name in ("cells", "albedo", "emission"):
        stored, expected = getattr(loaded, name), getattr(world, name)
        assert stored.dtype == expected.dtype
        assert np.array_equal(stored, expected)
    assert (loaded.cell_size, loaded.origin) == (world.cell_size, world.origin)
    assert loaded.quality == world.quality
    light, scale = voxels.load_light(tmp_path)
    assert scale == world.scale
    assert np.array_equal(voxel_light.texels(light)[..., 3] > 0, world.solid)
    assert sorted(p.name for p in tmp_path.iterdir() if p.name != "seal.json") == [
        "cells.ktx2",
        "light.ktx2",
        "report.json",
    ]


def test_memory_layout_changes_no_byte(world: Voxels, tmp_path: Path) -> None:
    written = []
    turned = world.cells.transpose(2, 1, 0).copy().transpose(2, 1, 0)
    for i, cells in enumerate([world.cells, turned, world.cells.astype(">i8")]):
        folder = tmp_path / str(i)
        folder.mkdir()
        replace(world, cells=cells, albedo=world.albedo.astype(">f4")).save(folder)
        written.append([p.read_bytes() for p in sorted(folder.iterdir())])
    assert written[0] == written[1] == written[2]


def spoilt(values: np.ndarray, at: tuple[int, ...], value: float) -> np.ndarray:
    changed = values.copy()
    changed[at] = value
    return changed


CASES: dict[str, dict[str, Any]] = {
    "cells of floats": {"cells": np.zeros((2, 2, 2))},
    "cells of two axes": {"cells": np.zeros((2, 2), int)},
    "no cells": {"cells": np.zeros((0, 2, 2), int)},
    "too many cells": {"cells": np.broadcast_to(np.uint16(0), (1, 1, 513))},
    "a row that is not there": {"cells": np.full((1, 1, 1), 5)},
    "a negative row": {"cells": np.full((1, 1, 1), -1)},
    "albedo of another length": {"albedo": np.zeros((4, 3), np.float32)},
    "albedo of text": {"albedo": np.full((5, 3), "a")},
    "emission of a channel": {"emission": np.zeros((5, 1), np.float32)},
    "a cell of nothing": {"cell_size": 0.0},
    "a cell of no number": {"cell_size": float("nan")},
    "an origin of two": {"origin": (0.0, 0.0)},
    "an origin of infinity": {"origin": (0.0, float("inf"), 0.0)},
}


@pytest.mark.parametrize("name", CASES)
def test_wrong_arrays_are_refused(name: str, world: Voxels, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        replace(world, **CASES[name]).save(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["albedo", "emission"])
@pytest.mark.parametrize(
    ("at", "value"),
    [((1, 1), np.nan), ((1, 1), np.inf), ((1, 1), -0.1), ((1, 1), 1.1e6), ((0, 0), 0.1)],
)
def test_colours_out_of_range_are_refused(
    name: str, at: tuple[int, int], value: float, world: Voxels
) -> None:
    with pytest.raises(InputError, match=name):
        replace(world, **{name: spoilt(getattr(world, name), at, value)}).checked()  # type: ignore[arg-type]


def test_albedo_of_the_limit_passes(world: Voxels) -> None:
    full = np.full((5, 3), voxels.ALBEDO_LIMIT, np.float32)
    full[0] = 0
    assert replace(world, albedo=full).checked().albedo.max() == np.float32(0.98)
    with pytest.raises(InputError, match="albedo"):
        replace(world, albedo=spoilt(full, (2, 0), 0.981)).checked()


def test_damaged_folders_are_refused(world: Voxels, tmp_path: Path) -> None:
    world.save(tmp_path)
    seal.seal(tmp_path)
    for name in ("cells.ktx2", "light.ktx2"):
        data = (tmp_path / name).read_bytes()
        changed = bytearray(data)
        changed[-3] ^= 1
        (tmp_path / name).write_bytes(changed)
        read = Voxels.load if name == "cells.ktx2" else voxels.load_light
        with pytest.raises(DamagedError):
            read(tmp_path)
        (tmp_path / name).write_bytes(data)
    assert Voxels.load(tmp_path).size == world.size


def test_files_that_do_not_belong_together_are_refused(world: Voxels, tmp_path: Path) -> None:
    world.save(tmp_path)
    other = ktx2.Texture((np.zeros((5, 6, 8, 1), np.uint16),), "volume")
    ktx2.write(tmp_path / "cells.ktx2", other)
    with pytest.raises(DamagedError, match="size"):
        Voxels.load(tmp_path)
    ktx2.write(tmp_path / "cells.ktx2", ktx2.read(tmp_path / "light.ktx2"))
    with pytest.raises(DamagedError, match="type"):
        Voxels.load(tmp_path)
    data = json.loads((tmp_path / "report.json").read_text())
    report.write(tmp_path, data | {"format": 2})
    with pytest.raises(DamagedError, match="format 2"):
        Voxels.load(tmp_path)
    report.write(tmp_path, data | {"kind": "mesh"})
    with pytest.raises(DamagedError, match="mesh"):
        voxels.load_light(tmp_path)
