"""The studies of light among cubes: worlds, lookups and errors by closed forms, on tiny worlds."""

import numpy as np
import pytest

from bake import voxel_faces
from pipelines.studies import (
    cube_gathers,
    gather_lights,
    gather_modes,
    gather_rays,
    importance,
    lightmap_texels,
    voxel_storage,
)
from tests.runtime.cube_worlds import box, inside, room

pytestmark = pytest.mark.gpu


@pytest.fixture(scope="module")
def card():
    with cube_gathers.card() as made:
        yield made


# what they share


def test_errors_and_slopes_are_their_closed_forms() -> None:
    truth = np.full((2, 3, 3), 2.0, np.float32)
    used = np.ones((2, 3), bool)
    used[0, 0] = False
    found = truth * np.float32(1.25)
    found[0, 0] = 99
    assert cube_gathers.error_of(found, truth, used) == pytest.approx(0.25)
    passes = [4, 8, 64]
    assert cube_gathers.slope(passes, [3 * p**-0.7 for p in passes]) == pytest.approx(-0.7)
    assert gather_rays.net(5.0, 3.0) == pytest.approx(4.0)
    assert gather_rays.net(5.0, 6.0) == pytest.approx(1.25)


def test_the_nook_has_a_doorway_and_light() -> None:
    nook = cube_gathers.nook()
    assert nook.size == (18, 12, 16)
    assert nook.emission.any(axis=1)[nook.cells].any()
    # Rays go in and out
    assert 0.2 < nook.solid.mean() < 0.6


# lights


def test_so_many_cells_glow_as_bright_together() -> None:
    world = room()
    faces = voxel_faces.layout(world.cells, texels=1)
    lit = []
    for count in (1, 10, 60):
        found = gather_lights.glowing(world, faces, count)
        glows = found.emission.any(axis=1)[found.cells]
        assert glows.sum() == count
        total = found.emission[found.cells].sum(axis=(0, 1, 2))
        np.testing.assert_allclose(total, gather_lights.POWER, rtol=1e-5)
        np.testing.assert_array_equal(found.solid, world.solid)
        np.testing.assert_array_equal(found.albedo[found.cells], world.albedo[world.cells])
        lit.append(set(np.flatnonzero(glows)))
    assert lit[0] < lit[1] < lit[2]
    with pytest.raises(ValueError, match="cannot glow"):
        gather_lights.glowing(world, faces, 10_000)


def test_rows_of_lights_hold_what_they_name() -> None:
    rows = gather_lights.measured(room(), (1, 20), rounds=1, passes=8, rays=40, more=16)
    assert [row["glowing"] for row in rows] == [1, 20]
    for row in rows:
        assert row["talk_ms"] > 0
        # A ray looks at its start at least; the world is 9 + 7 + 8 cells long
        assert 1 < row["aimed_visits"] < 25
        assert row["exact_ns_a_cell"] > 0
        for name in ("error", "baked"):
            assert 0 < row[f"{name}_low"] <= row[name] <= row[f"{name}_high"] < 1
    # What rays along the cosine cross does not depend on what glows
    assert rows[0]["free_visits"] == rows[1]["free_visits"]
    points = gather_lights.points(rows)
    assert {p["series"] for p in points} == {"gathered", "baked lightmap"}
    assert gather_lights.spread_of([2.0, 3.0, 2.5]) == 1.5


def test_aiming_finds_one_small_lamp(card) -> None:
    world = gather_lights.glowing(room(), faces := gather_modes.laid_out(room(), 1), 1)
    row = importance.errors(card, world, faces, passes=8, rays=40)
    # Rays at random hardly find it
    assert row["aimed_mean"] < 0.5 * row["free_mean"]
    assert {p["series"] for p in importance.points([row | {"glowing": 1}])} == set(
        importance.NAMES.values()
    )


# modes


@pytest.mark.parametrize("longest", [128, 16])
def test_lookups_between_texels(longest, monkeypatch) -> None:
    """What is linear on a wall stays so between texels; at texels they are the texels.

    longest : side of a rectangle, texels; of 16 the finer layout cuts walls that the coarser has in
    one piece.
    """
    monkeypatch.setattr(voxel_faces, "LONGEST", longest)
    world = box(6, 0.5)
    coarse, fine = (voxel_faces.layout(world.cells, texels=n) for n in (2, 5))
    image = np.nan_to_num(coarse.positions())
    assert (len(fine.rectangles) > len(coarse.rectangles)) == (longest == 16)
    rows, tu, tv, x, y = coarse.interior
    found = lightmap_texels.looked_up(coarse, image, coarse)
    np.testing.assert_array_equal(found, image[y, x])
    rows, tu, tv, x, y = fine.interior
    found = lightmap_texels.looked_up(coarse, image, fine)
    r = fine.rectangles[rows]
    # Half a coarse texel from a rim, gutters count, which hold no line here
    away = (tu > 0) & (tv > 0) & (tu < 5 * r["width"] - 1) & (tv < 5 * r["height"] - 1)
    assert away.sum() > 1000
    np.testing.assert_allclose(found[away], fine.positions()[y, x][away], atol=1e-5)
    other = voxel_faces.layout(room().cells, texels=1)
    with pytest.raises(ValueError, match="differ"):
        lightmap_texels.looked_up(coarse, image, other)


def test_error_falls_to_that_of_a_white_furnace(card) -> None:
    world = box(4, 0.5)
    faces = voxel_faces.layout(world.cells, texels=1)
    gather = card.gather(world, faces, bounces=0)
    truth = np.zeros((faces.size[1], faces.size[0], 3), np.float32)
    truth[inside(faces, 4)] = np.pi
    rows = gather_modes.followed(card, gather, [16, 256], faces, truth)
    assert [row["passes"] for row in rows] == [16, 256]
    assert rows[0]["ms"] < rows[1]["ms"]
    # Evenly spread rays: better than 1 / sqrt(16) of 16 times fewer
    assert rows[1]["error"] < 0.3 * rows[0]["error"]
    # Measured .017, of 24 texels
    assert rows[1]["error"] < 0.025


def test_a_lightmap_of_more_texels_errs_less() -> None:
    """Light of a lamp in a box, between texels, baked on one texel a face and on four."""
    world = gather_lights.glowing(room(), gather_modes.laid_out(room(), 1), 20)
    fine = gather_modes.laid_out(world, lightmap_texels.PLACES)
    truth = cube_gathers.traced(world, fine, 64).irradiance
    used = fine.cell() >= 0
    errors = []
    for texels in (1, 4):
        faces = gather_modes.laid_out(world, texels)
        light, seconds = lightmap_texels.baked(world, faces, 128)
        assert seconds > 0
        found = lightmap_texels.shown_at(faces, light, fine)
        errors.append(cube_gathers.error_of(found, truth, used))
    assert errors[1] < 0.8 * errors[0]


# storage


def test_finer_worlds_and_colours() -> None:
    world = room()
    fine, ramp, many = (voxel_storage.subject(world, 2, name) for name in voxel_storage.COLOURS)
    assert fine.size == tuple(2 * side for side in world.size)
    assert fine.cell_size == world.cell_size / 2
    np.testing.assert_array_equal(fine.cells[1::2, ::2, 1::2], world.cells)
    lit = [each.emission.any(axis=1)[each.cells] for each in (fine, ramp, many)]
    for each in lit[1:]:
        np.testing.assert_array_equal(lit[0], each)
    assert len(np.unique(fine.emission[fine.cells[lit[0]]], axis=0)) == 2
    # 32 cells, of 512 colours
    assert len(np.unique(many.emission[many.cells[lit[2]]], axis=0)) > 20
    ends = ramp.emission[len(world.albedo)], ramp.emission[-1]
    share = np.linspace(0, 1, voxel_storage.SHADES)[:, None]
    expected = (1 - share) * ends[0] + share * ends[1]
    np.testing.assert_allclose(ramp.emission[len(world.albedo) :], expected, rtol=1e-5)
    z, y, x = np.nonzero(lit[1])
    assert np.all(np.diff(ramp.cells[z, y, x][np.argsort(x + y + z)].astype(int)) >= 0)


def test_rows_of_storage_hold_what_they_name(card) -> None:
    world = voxel_storage.subject(cube_gathers.nook(), 1, "one")
    rows = voxel_storage.measured(card, world, 1, {"finer": 1, "colours": "one"})
    assert [row["storage"] for row in rows] == list(voxel_storage.STORAGES)
    for row in rows:
        volume = card.volume(world, storage=str(row["storage"]))
        assert voxel_storage.writes(card, volume).nbytes == row["bytes"]
        assert row["dark_that_glow"] == row["solid_that_differ"] == 0
        assert row["pass_ms"] > 0
        # Two places of eight cells; in blocks of 4 x 4, two to four of them in each of two slices
        assert row["move_bytes"] <= (4 * 24 if row["storage"] == "rgba8" else 8 * 2 * 8)
    # Codes are rounded to 1 of 255; of 5 and 6 bits in blocks: 1 of 31
    assert rows[0]["largest_error"] < 0.5 / 255 * np.sqrt(3)
    assert 0 < rows[1]["largest_error"] < 0.5 / 31 * np.sqrt(3)
    assert rows[1]["emission_error"] == rows[2]["emission_error"]
