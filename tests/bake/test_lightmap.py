"""The stage that lights cubes: error bars, layouts of a changing world, threads, refusals."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bake import lightmap, workers
from bake.lightmap import Params
from bake.voxel_faces import layout
from formats.errors import InputError
from tests.bake import cell_worlds, stage_battery
from tests.bake.cell_worlds import at_interior, of, room

Array = NDArray[np.float64]
FEW = Params(texels=1, rays=256, target=0)


def z_squared(found: Array, error: Array, truth: Array) -> float:
    """Mean square of errors in standard errors; 8 sets give 7 / 5 (Student's t of 7 degrees)."""
    off = found - truth
    return float(np.mean((off / np.maximum(error, 1e-6 + 1e-5 * np.abs(truth))) ** 2))


def test_error_bars_hold_in_rounds_towards_a_target() -> None:
    world = cell_worlds.coloured_room(4, seed=2, glowing=0.05)
    params = Params(texels=1, rays=1 << 14, target=0.02)
    found = lightmap.light(world, params=params)
    which, truth = cell_worlds.room_truth(world, found.faces, 4)
    light, error = (values[which] for values in at_interior(found))
    assert found.quality["rays"] < 1 << 14
    # Later rounds weigh more: between 7 and 21 degrees of freedom
    assert 0.5 < z_squared(light, error, truth) < 3
    assert found.quality["relative_error"] <= 0.02
    # The outside of the room is dark and counts for nothing
    off = np.sqrt(np.sum((light - truth) ** 2) / np.sum(truth**2))
    assert 0.3 < off / found.quality["relative_error"] < 2


def test_faces_that_are_covered_now_get_no_light() -> None:
    # A door that opens: the layout has its faces at any time
    shut, opened = room(4), room(4)
    shut[2, 1:5, 1:5] = 2
    faces = layout([shut, opened], texels=2)
    world = of(shut, [0.5, 0.5], [1.0, 0.0])
    found = lightmap.gather(world, faces, params=replace(FEW, texels=2, bounces=1))
    own = lightmap.light(world, params=replace(FEW, texels=2, bounces=1))
    lit = {}
    for each in (found, own):
        position, normal, cell = (
            each.faces.positions(), each.faces.normals(), each.faces.cell()
        )  # fmt: skip
        at = np.nonzero(cell >= 0)
        rows = np.concatenate([position[at], normal[at]], axis=1).round(3)
        lit[id(each)] = dict(
            zip(map(tuple, rows.tolist()), map(tuple, each.irradiance[at].tolist()), strict=True)
        )
    more, less = lit[id(found)], lit[id(own)]
    assert set(less) < set(more)
    # Random numbers belong to faces, not to places in an atlas
    assert all(more[key] == less[key] for key in less)
    assert all(more[key] == (0, 0, 0) for key in set(more) - set(less))


def test_any_number_of_threads_gives_the_same_bytes(tmp_path: Path) -> None:
    world = cell_worlds.coloured_room(4, seed=1, glowing=0.1)
    before, files = workers.count(), []
    try:
        for threads in (1, 3):
            workers.use(threads)
            folder = tmp_path / str(threads)
            folder.mkdir()
            lightmap.light(world, params=replace(FEW, texels=3, rays=256)).save(folder)
            files.append({p.name: p.read_bytes() for p in folder.iterdir()})
    finally:
        workers.use(before)
    assert files[0] == files[1]


def test_batches_of_rays_change_nothing_but_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    from bake import lightmap_rounds

    world = cell_worlds.coloured_room(3, seed=5, glowing=0.2)
    whole = lightmap.light(world, params=replace(FEW, bounces=0))
    monkeypatch.setattr(lightmap_rounds, "MAX_ENDS", 1000)
    parts = lightmap.light(world, params=replace(FEW, bounces=0))
    np.testing.assert_allclose(parts.irradiance, whole.irradiance, rtol=1e-5, atol=1e-6)


def test_progress_runs_to_the_end() -> None:
    told: list[float] = []
    world = cell_worlds.coloured_room(3, seed=5, glowing=0.2)
    lightmap.light(world, params=Params(rays=256, target=0.001), progress=told.append)
    assert told[-1] == 1.0
    assert all(a <= b + 1e-12 for a, b in pairwise(told))


def test_a_dark_world_is_dark() -> None:
    found = lightmap.light(of(room(3), [0.5], [0.0]), params=Params(rays=64))
    assert not found.irradiance.any()
    assert not found.error.any()
    assert found.quality["relative_error"] == 0


@pytest.mark.parametrize(
    ("name", "value"),
    [("texels", 0), ("rays", 7), ("bounces", -2), ("target", -0.1), ("target", float("nan"))],
)
def test_knobs_out_of_range_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError) as refused:
        lightmap.light(of(room(2), [0.5], [1.0]), params=replace(FEW, **{name: value}))
    assert refused.value.field == name


BATTERY = cell_worlds.coloured_room(1, seed=3, glowing=0.3)


@pytest.mark.parametrize("case", stage_battery.cases(BATTERY), ids=str)
def test_battery(case: stage_battery.Case, tmp_path: Path) -> None:
    params = Params(texels=1, rays=16, target=0, bounces=1)
    stage_battery.check(case, lightmap.light, (BATTERY,), params, tmp_path)
