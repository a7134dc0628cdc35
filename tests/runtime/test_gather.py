"""Light gathered on the card against closed forms, and what its knobs do."""

import numpy as np
import pytest

from bake import voxel_faces
from formats.errors import InputError
from formats.voxels import Voxels
from maths.polygon_lights import rectangle_irradiance
from runtime import gather_schedule
from runtime.gather_targets import texel_places
from runtime.voxel_lamps import FreeLamp
from runtime.voxel_world import VoxelVolume
from tests.runtime.cube_worlds import apart, box, ceiling, inside, makers, palette, room

pytestmark = pytest.mark.gpu


@pytest.fixture
def gather(ctx):
    """Give a maker of gathers."""
    yield from makers(ctx)


# truth


@pytest.mark.parametrize(("albedo", "bounces"), [(a, -1) for a in (0, 0.2, 0.5, 0.8, 0.95)])
def test_furnace(gather, albedo, bounces):
    check_furnace(gather, albedo, bounces, 1 / (1 - np.float32(albedo).astype(float)))


@pytest.mark.parametrize("bounces", [0, 1, 4])
def test_furnace_of_so_many_bounces(gather, bounces):
    check_furnace(gather, 0.8, bounces, sum(0.8**k for k in range(bounces + 1)))


def check_furnace(gather, albedo, bounces, expected):
    voxels = box(6, albedo)
    faces = voxel_faces.layout(voxels.cells, texels=2)
    found = gather(voxels, faces, bounces=bounces, error=0.01, seed=3)
    found.step(4096)
    assert found.converged
    light = found.read()[inside(faces, 6)] / np.pi
    # It means a leak of less than .005 (1 - r) / r, .0003 for .95
    assert abs(light.mean() / expected - 1) < 0.005
    # Errors are those that it told, within the spread of 400 texels that read each other's light
    assert apart(light, np.full_like(light, expected), np.s_[:]) < 1.5 * max(found.error(), 0.004)


def test_no_ray_leaks_out_of_a_closed_box(gather):
    """All around is light of radiance 1000: any leak would be seen. .9 million rays inside."""
    voxels = box(5, 0.5, 0.0)
    faces = voxel_faces.layout(voxels.cells, texels=5)
    sky = np.full((4, 8, 3), 1000.0, np.float32)
    found = gather(voxels, faces, environment=sky, error=0.0)
    assert found.step(640) == 640
    dark = found.read()[inside(faces, 5)]
    assert len(dark) == 6 * 9 * 25
    assert dark.max() == 0
    # From the outside of the box half the sky is seen, wherever one stands
    outside = (faces.cell() >= 0) & ~inside(faces, 5)
    np.testing.assert_allclose(found.read()[outside], 1000 * np.pi, rtol=1e-5)


def test_no_ray_leaks_through_cells_that_touch_by_edges_and_corners(gather):
    """The shell of an octahedron, a hole for every neighbour of a cell but those by corners."""
    z, y, x = np.indices((9, 9, 9))
    cells = (np.abs(x - 4) + np.abs(y - 4) + np.abs(z - 4) == 4).astype(np.uint16)
    voxels = Voxels(cells, *palette((0.5, 0.0)))
    faces = voxel_faces.layout(cells, texels=4)
    front = np.nan_to_num(faces.positions() + 0.5 * faces.normals(), nan=-9)
    within = np.abs(np.floor(front) - 4).sum(axis=-1) < 4
    sky = np.full((4, 8, 3), 1000.0, np.float32)
    for mode in ("exact", "sphere"):
        found = gather(voxels, faces, environment=sky, error=0.0, bounces=0, mode=mode)
        found.step(64)
        light = found.read()
        assert within.sum() > 1000
        assert light[within].max() == 0
        assert light[(faces.cell() >= 0) & ~within].min() > 1


def test_a_glowing_rectangle_is_the_closed_form(gather):
    voxels, faces, floor, expected = ceiling(2)
    found = gather(voxels, faces, error=0.006, seed=1)
    found.step(4096)
    light = found.read()[floor]
    # Five standard errors of the mean of 484 texels, and the floor has nearly all the light
    assert abs(light.mean() / expected.mean() - 1) < 5 * 0.006 / np.sqrt(484)
    assert apart(light, expected, np.s_[:]) < 1.5 * found.error()


def test_a_lamp_between_cells_is_its_six_sides(gather):
    """Wherever it is, and again where it moved to."""
    cells = np.zeros((12, 10, 12), np.uint16)
    cells[:, 0] = 1
    voxels = Voxels(cells, *palette((0.5, 0.0)))
    faces = voxel_faces.layout(cells, texels=2)
    floor = (faces.normals()[..., 1] > 0) & (faces.cell() >= 0)
    at = faces.positions()[floor].astype(float)

    def lamp(*middle):
        return FreeLamp(middle, 1.0, (4.0, 2.0, 1.0))

    found = gather(voxels, faces, error=0.01, bounces=0, free=[lamp(5.3, 3.7, 6.1)])
    for middle in ((5.3, 3.7, 6.1), (8.0, 2.25, 4.5)):
        found.set_free([lamp(*middle)])
        found.step(4096)
        expected = np.zeros((len(at), 3))
        for axis, way in np.ndindex(3, 2):
            axes = np.eye(3)[[axis, (axis + 1) % 3, (axis + 2) % 3]] * (1 - 2 * way)
            centre = np.array(middle) + axes[0]
            # Their cross product looks outwards
            sides = axes[1], axes[2] * (1 - 2 * way)
            light = rectangle_irradiance(at, [0, 1, 0], centre, *sides, [4.0, 2.0, 1.0])
            expected += light
        assert apart(found.read()[floor], expected, np.s_[:]) < 1.5 * max(found.error(), 0.01)
        assert abs(found.read()[floor].mean() / expected.mean() - 1) < 0.003


def test_downsampling_shows_means_of_texels(gather):
    voxels = room()
    faces = voxel_faces.layout(voxels.cells, texels=4)
    fine, coarse, one = (gather(voxels, faces, error=0.0, seed=1, downsample=k) for k in (1, 2, 4))
    for found in (fine, coarse, one):
        found.step(16)
    place = texel_places(faces)[..., 3].astype(int)
    u, v = place & 63, place >> 6 & 63
    light, used = fine.read(), faces.cell() >= 0
    for found, k in ((coarse, 2), (one, 4)):
        y, x = np.nonzero(used & (u % k == 0) & (v % k == 0))
        mean = sum(light[y + i // k, x + i % k] for i in range(k * k)) / k**2
        shown = found.read()
        for i in range(k * k):
            np.testing.assert_allclose(shown[y + i // k, x + i % k], mean, rtol=1e-5, atol=1e-6)
    with pytest.raises(InputError, match="downsample"):
        gather(voxels, faces, downsample=3)


def test_a_settled_world_costs_nothing(gather):
    voxels = box(4, 0.5)
    faces = voxel_faces.layout(voxels.cells, texels=1)
    found = gather(voxels, faces, error=0.05)
    assert not found.converged
    done = found.step(5000)
    assert 40 <= done < 5000
    assert found.step(8) == 0
    before = found.read()
    assert found.update(glows=[]) == []
    assert found.converged
    np.testing.assert_array_equal(found.read(), before)
    # The same seed gives the same bytes
    again = gather(voxels, faces, error=0.05)
    again.step(5000)
    np.testing.assert_array_equal(again.read(), before)


def test_the_talks_way_sums_what_destinations_show(gather):
    """One glowing cell in the open: emission max(n.d + .1, 0) A / r^2, r to its middle."""
    cells = np.zeros((9, 7, 9), np.uint16)
    cells[:, 0] = 1
    cells[4, 5, 4] = 2
    voxels = Voxels(cells, *palette((0.5, 0.0), (0.0, 6.0)))
    faces = voxel_faces.layout(cells, texels=1)
    found = gather(voxels, faces, mode="talk", error=0.02)
    found.step(64)
    at = np.nan_to_num(faces.positions(), nan=-1)
    floor = (faces.normals()[..., 1] > 0) & (np.abs(at[..., 1] - 1) < 1e-3)
    to = np.array([4.5, 5.5, 4.5]) - at[floor] - np.array([0, 0.25, 0])
    r = np.linalg.norm(to, axis=1)
    expected = 6.0 * (to[:, 1] / r + 0.1) * 1.5 / r**2
    np.testing.assert_allclose(found.read()[floor][:, 0], expected, rtol=1e-4)


# knobs


def test_what_studies_ask_for(gather):
    voxels = box(6, 0.5)
    faces = voxel_faces.layout(voxels.cells, texels=1)
    aimed = gather(voxels, faces, error=0.02, bounces=0)
    free = gather(voxels, faces, error=0.02, bounces=0, aim=False)
    assert aimed.lamps.count == 6 * 16
    assert free.lamps.count == 0
    for found in (aimed, free):
        found.step(2048)
        # All around glows alike
        light = found.read()[inside(faces, 6)]
        assert light.mean() == pytest.approx(np.pi, rel=0.003)
    # Every ray along the cosine sees radiance 1
    np.testing.assert_allclose(light, np.pi, rtol=1e-5)
    counted = gather(voxels, faces, aim=False, visits=True, error=0.02)
    counted.step(256)
    # The start, and the walls that are crossed: 1 + mean sum |change|, a chord of 4 V / S = 2.67
    visits = counted.read()[inside(faces, 6)].mean()
    assert 1 + 2.67 < visits < 1 + 2.67 * np.sqrt(3) + 1


def test_refusals(gather, ctx):
    voxels = box(4, 0.5)
    faces = voxel_faces.layout(voxels.cells, texels=1)
    for knobs in ({"mode": "fast"}, {"bounces": -2}, {"error": 2.0}, {"samples": 0}):
        with pytest.raises(InputError, match=next(iter(knobs))):
            gather(voxels, faces, **knobs)
    with pytest.raises(InputError, match="storage"):
        VoxelVolume(ctx, voxels, storage="png")


def test_schedules():
    """Every bounce is built on the one before; light is handed on again at all times."""
    for bounces in (1, 3):
        steps = gather_schedule.pairs(bounces, 20)
        first = [next(steps) for _ in range(60)]
        assert first[0].send == "glows"
        assert [p.send for p in first[1:bounces]] == ["latest"] * (bounces - 1)
        assert any(p.send == "glows" for p in first[1:])
    steps = gather_schedule.pairs(-1, 20)
    first = [next(steps) for _ in range(1000)]
    assert all(p.send == "latest" for p in first[:20])
    assert sum(p.send == "mean" for p in first) == 5
    assert gather_schedule.settling(0.0, 0.02) == gather_schedule.LEAST
    # .8^27 = .0024
    assert gather_schedule.settling(0.8, 0.02) == 27
