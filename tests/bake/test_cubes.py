"""The world of a scene: light of its cells put together, faces of all states."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bake import cubes, lightmap, voxel_faces
from bake.cubes import Params
from formats.environment import Environment
from formats.errors import InputError
from formats.lightmap import Lightmap
from formats.voxels import Voxels
from maths.transforms import latlong_direction, latlong_solid_angles
from tests.bake import stage_battery
from tests.bake.cell_worlds import at_interior, looking, of

Array = NDArray[np.float64]
FEW = Params((0.0, 0.0, 0.0), texels=1, rays=64, bounces=1, target=0.0)


def floor(width: int = 6, height: int = 5, depth: int = 4) -> Voxels:
    """A floor of one cell under air, and a glowing cell on it."""
    cells = np.zeros((depth, height, width), np.uint16)
    cells[:, 0], cells[1, 1, 1] = 1, 2
    return replace(of(cells, [0.6, 0.3], [0.0, 2.0]), cell_size=0.5)


def block() -> Voxels:
    """A block of its own colour, which glows a little."""
    return replace(of(np.ones((1, 2, 1), np.uint16), [[0.2, 0.4, 0.8]], [0.5]), cell_size=0.5)


def same(found: Lightmap, truth: Lightmap) -> None:
    np.testing.assert_array_equal(found.faces.rectangles, truth.faces.rectangles)
    np.testing.assert_array_equal(found.irradiance, truth.irradiance)
    assert found.irradiance.any()


def lit(voxels: Voxels, faces_of: NDArray[np.uint16], sky: Array | None = None) -> Lightmap:
    """The light of these cells on the faces of those, by the stage for one world."""
    faces = voxel_faces.layout(
        faces_of, texels=FEW.texels, cell_size=voxels.cell_size, origin=voxels.origin
    )
    knobs = lightmap.Params(FEW.texels, FEW.rays, FEW.bounces, FEW.target)
    radiance = None if sky is None else sky.astype(np.float32)
    return lightmap.gather(voxels, faces, params=knobs, environment=radiance)


def test_light_is_that_of_the_cells_put_together() -> None:
    # The middle of the underside lies over the origin: x from -1.5 to 1.5 m
    cells = floor().cells.copy()
    cells[2, 1:3, 4] = 3
    world = of(cells, [[0.6] * 3, [0.3] * 3, [0.2, 0.4, 0.8]], [[0.0] * 3, [2.0] * 3, [0.5] * 3])
    truth = lit(replace(world, cell_size=0.5, origin=(-1.5, 0.0, -1.0)), cells)
    moments = (((0.75, 0.5, 0.25),),)
    same(cubes.light(floor(), block(), params=replace(FEW, moments=moments)), truth)
    # Everything elsewhere by whole cells is the same light
    away = replace(FEW, position=(7.0, -2.0, 4.0), moments=(((7.75, -1.5, 4.25),),))
    moved = cubes.light(floor(), block(), params=away)
    np.testing.assert_array_equal(moved.irradiance, truth.irradiance)
    shift = moved.faces.positions() - truth.faces.positions()
    there = np.isfinite(shift[..., 0])
    assert there.sum() == (truth.faces.cell() >= 0).sum()
    # Rounding of metres to float32
    np.testing.assert_allclose(shift[there] - (7, -2, 4), 0.0, atol=1e-6)


def test_a_still_lamp_is_a_cell_that_glows_and_reflects_nothing() -> None:
    cells = floor().cells.copy()
    cells[2, 3, 4] = 3
    world = of(cells, [0.6, 0.3, 0.0], [0.0, 2.0, 8.0])
    # Faces of the lamp itself have no texels
    truth = lit(replace(world, cell_size=0.5, origin=(-1.5, 0.0, -1.0)), floor().cells)
    # In the cell, and near it: it snaps
    for place in ((0.75, 1.75, 0.25), (0.9, 1.6, 0.3)):
        lamps = ((place, (8.0, 8.0, 8.0), 1),)
        same(cubes.light(floor(), params=replace(FEW, lamps=lamps)), truth)
    # In a wall, or outside, it lights nothing
    dark = cubes.light(floor(), params=FEW)
    for at in ((0.25, 0.25, 0.25), (9.0, 1.0, 0.0)):
        hidden = replace(FEW, lamps=((at, (8.0, 8.0, 8.0), 1),))
        same(cubes.light(floor(), params=hidden), dark)


def test_lamps_that_meet_add_up() -> None:
    one = ((0.25, 1.75, 0.25), (3.0, 5.0, 7.0), 1)
    twice = (one[0], (6.0, 10.0, 14.0), 1)
    found = [
        cubes.light(floor(), params=replace(FEW, lamps=lamps)) for lamps in ((one, one), (twice,))
    ]
    same(*found)


def test_every_state_has_its_faces_and_the_first_is_lit() -> None:
    """A block slides along x, two frames of which are the same cells."""
    moments = tuple(((x, 0.5, 0.25),) for x in (0.25, 0.3, 0.75, 1.25))
    found = cubes.light(floor(), block(), params=replace(FEW, rays=0, moments=moments))
    states = []
    for x in (3, 4, 5):
        states.append(floor().cells.copy())
        states[-1][2, 1:3, x] = 3
    truth = voxel_faces.layout(states, texels=1, cell_size=0.5, origin=(-1.5, 0.0, -1.0))
    np.testing.assert_array_equal(found.faces.rectangles, truth.rectangles)
    assert found.quality["states"] == 3
    assert not found.irradiance.any()
    # Lit is the first alone: faces that come out later are still covered
    bright = cubes.light(floor(), block(), params=replace(FEW, moments=moments))
    now = np.unique(bright.faces.cell()[bright.irradiance.any(axis=2)])
    z, _, x = np.unravel_index(now, states[0].shape)
    assert 3 in x[z == 2]
    assert (states[0].ravel()[now] > 0).all()


def test_maps_are_joined_as_they_stand() -> None:
    """Of two sizes, tinted and turned, against sums over every texel of the smaller ones' grid."""
    rng = np.random.default_rng(5)
    large, small = rng.uniform(0, 2, (16, 32, 3)), rng.uniform(0, 2, (8, 16, 3))
    turns = (np.pi / 2, 0.3)
    factors = ((1.0, 0.5, 2.0), (0.25, 1.0, 0.0))
    post = np.zeros((1, 1, 1), np.uint16) + 1
    world = of(post, [0.0], [0.0])
    maps = [Environment(values.astype(np.float32)) for values in (large, small)]
    params = replace(
        FEW, rays=4096, bounces=0, environments=tuple(zip(factors, turns, strict=True))
    )
    found = cubes.light(world, *maps, params=params)
    irradiance, error = at_interior(found)
    normals = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])
    for face in (0, 1, 2, 4, 5):
        # Many directions a texel of the finest map; texels stay even where they are
        h, w = 256, 512
        u, v = np.meshgrid((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)
        d = latlong_direction(np.stack([u, v], axis=-1))
        weight = latlong_solid_angles(h, w)[:, None] * np.maximum(d @ normals[face], 0)
        truth = np.zeros(3)
        for values, factor, turn in zip((large, small), factors, turns, strict=True):
            # What a turned map shows towards d is what it has towards d turned back
            c, s = np.cos(turn), np.sin(turn)
            x, z = c * d[..., 0] - s * d[..., 2], s * d[..., 0] + c * d[..., 2]
            u = 0.5 + np.arctan2(x, -z) / (2 * np.pi)
            v = np.arccos(np.clip(d[..., 1], -1, 1)) / np.pi
            rows = np.minimum((v * values.shape[0]).astype(int), values.shape[0] - 1)
            columns = (u * values.shape[1]).astype(int) % values.shape[1]
            radiance = values[rows, columns] * factor
            truth += np.einsum("hw,hwc->c", weight, radiance)
        at = looking(found.faces, face)
        off = np.abs(irradiance[at].mean(axis=0) - truth)
        # Turned by a share of a texel, columns are mixed: their sum stays, the cosine over a
        # texel's width of pi / 8 changes by at most its square over 8
        assert np.all(off < 4 * error[at].mean(axis=0) + 0.01 * truth), (face, off, truth)


def test_a_world_of_other_cells_is_refused() -> None:
    with pytest.raises(InputError, match=r"cells of 0\.5 m as the world has"):
        cubes.light(floor(), replace(block(), cell_size=0.25), params=FEW)


def test_a_part_that_never_is_in_the_world_is_refused() -> None:
    """One that passes through is not, at whichever moment."""
    gone, there = ((9.0, 0.5, 0.25),), ((1.25, 0.5, 0.25),)
    with pytest.raises(InputError, match=r"x -1\.5 to 1\.5, y 0 to 2\.5, z -1 to 1 m") as refused:
        cubes.light(floor(), block(), params=replace(FEW, moments=(gone, gone)))
    assert refused.value.field == "bodies[0].position"
    assert cubes.light(floor(), block(), params=replace(FEW, rays=0, moments=(gone, there)))


def test_too_many_states_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cubes, "MAX_STATES", 2)
    moments = tuple(((x, 0.5, 0.25),) for x in (0.25, 0.75, 1.25))
    with pytest.raises(InputError, match=r"3 states.*at most 2 places"):
        cubes.light(floor(), block(), params=replace(FEW, moments=moments))


def test_too_many_kinds_of_cells_are_refused() -> None:
    full = np.zeros((1 << 16, 3), np.float32)
    many = replace(floor(), albedo=full, emission=full)
    with pytest.raises(InputError, match=r"together have at most 65,536"):
        cubes.light(many, block(), params=replace(FEW, moments=(((0.25, 0.5, 0.25),),)))
    lamps = (((0.25, 1.75, 0.25), (1.0, 1.0, 1.0), 1),)
    with pytest.raises(InputError, match=r"fewer lamps.*65,536"):
        cubes.light(many, params=replace(FEW, lamps=lamps))


def test_a_world_without_faces_is_refused() -> None:
    empty = replace(floor(), cells=np.zeros_like(floor().cells))
    with pytest.raises(InputError, match="nothing is exposed"):
        cubes.light(empty, params=FEW)


BATTERY = floor(3, 3, 2)


@pytest.mark.parametrize("case", stage_battery.cases(BATTERY), ids=str)
def test_battery(case: stage_battery.Case, tmp_path: Path) -> None:
    lamps = (((0.25, 1.25, 0.25), (1.0, 1.0, 1.0), 1),)
    params = replace(FEW, rays=16, lamps=lamps)
    stage_battery.check(case, cubes.light, (BATTERY,), params, tmp_path)
