"""Light on cubes against closed forms: rooms, furnaces, glowing shapes, plates, skies."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bake import lightmap
from bake.lightmap import Params
from formats.environment import Environment
from formats.lightmap import Lightmap
from maths.area_lights import disc_irradiance, sphere_irradiance
from tests.bake import cell_worlds
from tests.bake.cell_worlds import at_interior, of, room

Array = NDArray[np.float64]
FEW = Params(texels=1, rays=256, target=0)


def z_squared(found: Array, error: Array, truth: Array) -> float:
    """Mean square of errors in standard errors; 8 sets give 7 / 5 (Student's t of 7 degrees)."""
    off = found - truth
    return float(np.mean((off / np.maximum(error, 1e-6 + 1e-5 * np.abs(truth))) ** 2))


@pytest.mark.parametrize("albedo", [0.0, 0.2, 0.5, 0.8, 0.95])
def test_white_furnace(albedo: float) -> None:
    world = of(room(6), [albedo], [1.0])
    found = lightmap.light(world, params=replace(FEW, rays=1024))
    walls = cell_worlds.inside(found.faces, 6)
    sent = 1 + albedo / np.pi * found.irradiance[walls].astype(float)
    # Of 216 texels the mean is as good as 2e5 rays
    assert abs(sent.mean() * (1 - albedo) - 1) < 0.002
    # Each one: half a percent of what it sends, RMS; measured .2 %
    assert np.sqrt(np.mean((sent * (1 - albedo) - 1) ** 2)) < 0.005
    # Rays that are lost would show as q = 1 - (1 - E / B) / albedo
    if albedo:
        lost = 1 - (1 - 1 / sent.mean()) / albedo
        assert abs(lost) < 0.002 * (1 - albedo) / albedo + 1e-4


def test_a_furnace_without_aim_is_exact() -> None:
    # By the cosine alone every ray finds the same: what is left is rounding, and lost rays
    world = of(room(5), [0.8], [1.0])
    found = lightmap.light(world, params=replace(FEW, sample_lights=False, bounces=40))
    walls = cell_worlds.inside(found.faces, 5)
    truth = np.pi * (1 - 0.8**41) / (1 - 0.8)
    np.testing.assert_allclose(found.irradiance[walls], truth, rtol=1e-6)
    assert 1 - found.irradiance[walls].mean() / truth < 1e-6


@pytest.mark.parametrize("bounces", [0, 1, 3])
def test_bounces_are_counted(bounces: int) -> None:
    world = of(room(4), [0.6], [2.0])
    params = replace(FEW, bounces=bounces, sample_lights=False)
    found = lightmap.light(world, params=params)
    walls = cell_worlds.inside(found.faces, 4)
    truth = 2 * np.pi * (1 - 0.6 ** (bounces + 1)) / (1 - 0.6)
    np.testing.assert_allclose(found.irradiance[walls], truth, rtol=1e-6)
    assert found.quality["bounces"] == bounces


@pytest.mark.parametrize("aimed", [False, True])
@pytest.mark.parametrize("bounces", [0, 2, -1])
def test_a_coloured_room(bounces: int, aimed: bool) -> None:
    world = cell_worlds.coloured_room(3, seed=5, glowing=0.2)
    params = replace(FEW, bounces=bounces, rays=2048, sample_lights=aimed)
    found = lightmap.light(world, params=params)
    which, truth = cell_worlds.room_truth(world, found.faces, 3, bounces)
    light, error = (values[which] for values in at_interior(found))
    # 54 texels of 3 channels, about a dozen sources: +-.5 over many seeds
    assert 0.5 < z_squared(light, error, truth) < 3
    assert np.sqrt(np.mean((light - truth) ** 2) / np.mean(truth**2)) < 0.02


def floor_and_lamp(lamp: NDArray[np.bool_], height: int) -> NDArray[np.uint16]:
    """A black floor 24 cells wide (row 1) and glowing cells (row 2) over it, lamp (nz, ny, nx)."""
    cells = np.zeros((24, height + lamp.shape[1] + 2, 24), np.uint16)
    cells[:, 0] = 1
    z, x = ((24 - side) // 2 for side in (lamp.shape[0], lamp.shape[2]))
    part = cells[
        z : z + lamp.shape[0], 1 + height : 1 + height + lamp.shape[1], x : x + lamp.shape[2]
    ]
    part[lamp] = 2
    return cells


def floor_points(found: Lightmap) -> Array:
    """Texels' centres on the floor, in the order of `on_the_floor`."""
    position, normal = found.faces.positions(), found.faces.normals()
    return position[(normal[..., 1] > 0) & (position[..., 1] == 1)].astype(float)


def on_the_floor(world: NDArray[np.uint16], rays: int = 512) -> tuple[Lightmap, Array, Array]:
    """Light, and light and error on the floor's texels."""
    voxels = of(world, [0.0, 0.0], [0.0, 3.0])
    found = lightmap.light(voxels, params=replace(FEW, rays=rays))
    y, x = np.nonzero((found.faces.normals()[..., 1] > 0) & (found.faces.positions()[..., 1] == 1))
    return found, found.irradiance[y, x].astype(float), found.error[y, x].astype(float)


@pytest.mark.parametrize("height", [1, 5])
def test_a_glowing_slab(height: int) -> None:
    """All faces of a slab, seen from a floor: nothing of a convex body hides its front."""
    world = floor_and_lamp(np.ones((4, 2, 7), bool), height)
    found, light, error = on_the_floor(world)
    faces = found.faces
    sources, glow = cell_worlds.glowing_patches(faces, of(world, [0.0, 0.0], [0.0, 3.0]))
    centre = floor_points(found)
    truth = cell_worlds.from_patches(centre, np.tile([0.0, 1, 0], (len(centre), 1)), sources, glow)
    assert 0.9 < z_squared(light, error, truth) < 2.2
    # Most of what the lamp is aimed at looks away: 1.7 and 2.7 % measured
    assert np.sqrt(np.mean((light - truth) ** 2) / np.mean(truth**2)) < 0.04
    assert abs(light.sum() / truth.sum() - 1) < 0.002
    # Never more than what a sky of that radiance would give
    assert light.max() < 3 * np.pi


def test_light_that_touches_its_receiver_stays_bounded() -> None:
    world = floor_and_lamp(np.ones((2, 3, 2), bool), 0)
    found, light, _ = on_the_floor(world, rays=64)
    # At the foot of an endless wall: half a sky
    assert 0.9 < light.max() < 3 * np.pi / 2 * 1.1
    assert np.all(found.irradiance[found.faces.cell() >= 0] <= 3 * np.pi)


def test_a_disc_in_a_ceiling() -> None:
    z, x = np.mgrid[:13, :13] - 6
    cells = np.ones((16, 10, 16), np.uint16)
    cells[:, 1:9] = 0
    disc = z**2 + x**2 <= 6.2**2
    # One layer glows, flush with the ceiling
    cells[1:14, 9, 1:14][disc] = 2
    found, light, error = on_the_floor(cells)
    faces, points = found.faces, floor_points(found)
    up = np.tile([0.0, 1, 0], (len(points), 1))
    sources, glow = cell_worlds.glowing_patches(faces, of(cells, [0.0, 0.0], [0.0, 3.0]))
    below = sources[0][:, 1] == 9
    squares = cell_worlds.from_patches(points, up, [part[below] for part in sources], glow[below])
    assert 0.9 < z_squared(light, error, squares) < 2.2
    # A circle of the same area, 8 cells away: -.27 % measured, most of it the squares' own
    radius = np.sqrt(disc.sum() / np.pi)
    circle = disc_irradiance(points, up, [7.5, 9.0, 7.5], [0.0, -1, 0], radius, 3.0)
    assert abs(light[:, 0].sum() / circle.sum() - 1) < 0.006


def test_a_ball_of_cells_lies_between_two_balls() -> None:
    z, y, x = np.mgrid[:9, :9, :9] - 4
    solid = z**2 + y**2 + x**2 <= 4.4**2
    found, light, error = on_the_floor(floor_and_lamp(solid, 7))
    points = floor_points(found)
    # The ball within the cells, and the one about them
    nearest = np.stack([np.maximum(np.abs(a) - 0.5, 0) for a in (x, y, z)])
    farthest = np.stack([np.abs(a) + 0.5 for a in (x, y, z)])
    inner = min(4.5, np.sqrt((nearest**2).sum(axis=0))[~solid].min())
    outer = np.sqrt((farthest**2).sum(axis=0))[solid].max()
    assert 1 < outer / inner < 1.4
    low, high = (
        sphere_irradiance(points, [0.0, 1, 0], [11.5, 12.5, 11.5], radius, 3.0)
        for radius in (inner, outer)
    )
    slack = 6 * error[:, 0]
    assert np.all(light[:, 0] + slack > low)
    assert np.all(light[:, 0] - slack < high)
    assert low.sum() < light[:, 0].sum() < high.sum()


def test_wide_parallel_plates() -> None:
    cells = np.zeros((36, 3, 36), np.uint16)
    cells[:, 0], cells[:, 2] = 1, 2
    albedo, emission = [0.3, 0.7], [1.0, 2.0]
    found = lightmap.light(of(cells, albedo, emission), params=FEW)
    faces = found.faces
    position, normal = faces.positions(), faces.normals()
    with np.errstate(invalid="ignore"):
        middle = np.abs(position[..., ::2] - 18).max(axis=-1) < 4
    for height, sign, row in ((1, 1, 0), (2, -1, 1)):
        at = middle & (position[..., 1] == height) & (normal[..., 1] == sign)
        sent = emission[row] + albedo[row] / np.pi * found.irradiance[at].mean()
        truth = (emission[row] + albedo[row] * emission[1 - row]) / (1 - albedo[0] * albedo[1])
        # Past the rim, 14 gaps away, goes 1 / 14^2 = .5 % of what a plate sends
        assert -0.006 < sent / truth - 1 < 0.002


def test_a_sky_over_a_plain_and_between_walls() -> None:
    even = Environment(np.full((8, 16, 3), 2.0, np.float32))
    plain = np.ones((6, 1, 6), np.uint16)
    found = lightmap.light(of(plain, [0.5], [0.0]), even, params=FEW)
    top = found.faces.normals()[..., 1] > 0
    # Aimed samples of the sky bring noise where the cosine alone had none
    np.testing.assert_allclose(found.irradiance[top].mean(), 2 * np.pi, rtol=0.005)
    # Between endless walls, twice as high as the floor's middle is far, the sine is left
    lane = np.zeros((41, 3, 3), np.uint16)
    lane[:, 0] = lane[:, :, ::2] = 1
    found = lightmap.light(of(lane, [0.0], [0.0]), even, params=replace(FEW, rays=1024))
    position = found.faces.positions()
    with np.errstate(invalid="ignore"):
        floor = (position[..., 1] == 1) & (np.abs(position[..., 2] - 20.5) < 6)
        floor &= found.faces.normals()[..., 1] > 0
    expected = 2 * np.pi * np.sin(np.arctan2(0.5, 2.0))  # 14 cells to the ends: 1 %
    assert abs(found.irradiance[floor].mean() / expected - 1) < 0.02


def test_a_sun_in_the_sky_is_aimed_at() -> None:
    sky = np.zeros((64, 128, 3), np.float32)
    sky[16, 32] = (800.0, 400.0, 200.0)
    world = of(np.ones((4, 1, 4), np.uint16), [0.0], [0.0])
    found = lightmap.light(world, Environment(sky), params=FEW)
    top = found.faces.normals()[..., 1] > 0
    # Irradiance of one texel: its solid angle times the cosine, even over its height
    solid = 2 * np.pi / 128 * (np.cos(np.pi * 16 / 64) - np.cos(np.pi * 17 / 64))
    cosine = np.cos(np.pi * 16.5 / 64)
    np.testing.assert_allclose(
        found.irradiance[top].mean(axis=0), sky[16, 32] * solid * cosine, rtol=2e-3
    )
    # A ray in 10,000 finds it by itself
    assert found.quality["relative_error"] < 0.01
