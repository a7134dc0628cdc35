"""The ground: Lambert in closed form, shadows that take the sun's share only, no aliasing."""

from __future__ import annotations

import numpy as np
import pytest

from maths import area_lights
from runtime.player import Player

pytestmark = pytest.mark.gpu
HALF = 2.0**-11
GREY = {"albedo": [0.4, 0.2, 0.1]}
DOWN = {"position": [0, 6, 0], "target": [0, 0, 0], "focal_length_mm": 24}


@pytest.fixture
def shown(write_scene, ctx):
    """Return shown(raw, assets, size, environment) -> linear (h, w, 3)."""
    count = iter(range(100))

    def show(raw, assets=(), size=(64, 64), environment=None):
        folder = write_scene(raw, dict(assets), environment=environment, name=f"scene{next(count)}")
        with Player(folder, size=size, context=ctx) as player:
            return player.linear(0.0)[..., :3]

    return show


def test_a_sun_lights_by_the_cosine(kit, shown):
    raw = kit.scene_dict(billboards=None, ground=GREY, camera=DOWN)
    found = shown(raw)
    x, y, z = kit.SUN
    expected = np.array(GREY["albedo"]) / np.pi * 3 * y / np.sqrt(x * x + y * y + z * z)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=2 * HALF)


def test_an_even_sky_of_unit_radiance_gives_pi(kit, shown):
    lights = [{"type": "environment", "source": "environments/e.hdr", "scale": [1.0, 2.0, 3.0]}]
    raw = kit.scene_dict(billboards=None, ground=GREY, camera=DOWN, lights=lights)
    found = shown(raw, environment=np.ones((16, 32, 3), np.float32))
    expected = np.array(GREY["albedo"]) * [1, 2, 3]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=2 * HALF)


def test_a_ball_lights_by_its_solid_angle(kit, shown):
    lights = [{"type": "sphere", "position": [0, 2, 0], "radius": 0.5, "radiance": [4, 4, 4]}]
    raw = kit.scene_dict(billboards=None, ground=GREY, camera=DOWN, lights=lights)
    found = shown(raw, size=(65, 65))[32, 32]
    # Straight below: pi L sin^2
    expected = np.array(GREY["albedo"]) * 4 * (0.5 / 2) ** 2
    np.testing.assert_allclose(found, expected, rtol=1e-3)


FLAT = {
    "disc": {"type": "disc", "position": [0.5, 1, 0.2], "facing": [0.5, -1, 0], "radius": 0.6},
    "rectangle": {"type": "rectangle", "position": [0, 0.5, 0], "facing": [1, 0, 0.3],
                  "size": [1, 2], "two_sided": True},
    "polygon": {"type": "polygon", "outline": [[-1, 1, -1], [1, 1, -1], [0.5, 1, 1]],
                "offset": [0, 0.5, 0]},
}  # fmt: skip


@pytest.mark.parametrize("name", FLAT)
def test_flat_lights_light_by_their_closed_forms(kit, write_scene, ctx, name):
    """The rectangle reaches under the ground: what is below the horizon gives nothing."""
    lights = [{**FLAT[name], "radiance": [1, 2, 4]}]
    raw = kit.scene_dict(billboards=None, ground=GREY, camera=DOWN, lights=lights)
    size = 48
    with Player(write_scene(raw, {}), size=(size, size), context=ctx) as player:
        found = player.linear(0.0)[..., :3]
        state = player.lights
        rays = player.view.world_from_ray(1.0)
    x = 2 * (np.arange(size) + 0.5) / size - 1
    ray = np.stack([*np.meshgrid(x, -x), np.ones((size, size))], axis=-1) @ rays.T
    point = np.array(DOWN["position"]) - 6 * ray / ray[..., 1:2]
    up = np.broadcast_to([0.0, 1.0, 0.0], point.shape)
    if name == "disc":
        (disc,) = state.discs
        expected = area_lights.disc_irradiance(
            point, up, disc.position, disc.axis, disc.radius, disc.radiance
        )
    else:
        (flat,) = state.polygons
        expected = area_lights.polygon_irradiance(
            point, up, flat.corners, flat.radiance, two_sided=flat.two_sided
        )
    expected = expected * GREY["albedo"] / np.pi
    assert expected.max() > 0.05
    # Half floats, and 1e-5 of the light by single precision
    np.testing.assert_allclose(found, expected, rtol=2 * HALF, atol=1e-4 * expected.max())


def test_a_sun_below_the_horizon_gives_nothing(kit, shown):
    lights = [{"type": "sun", "to_light": [1, -0.02, 0], "irradiance": [9, 9, 9]}]
    raw = kit.scene_dict(ground=GREY, lights=lights)
    assert shown(raw, {"ball": kit.sphere_asset()}).max() == 0


def shadow_scene(kit, to_light, **extra):
    """The ball seen from straight above: the sprite itself is edge on and hides nothing."""
    lights = [
        {"type": "sun", "to_light": to_light, "irradiance": [3, 3, 3]},
        {"type": "environment", "source": "environments/e.hdr", "scale": 0.1},
    ]
    return kit.scene_dict(ground=GREY, camera=DOWN, lights=lights, **extra)


EVEN = np.ones((8, 16, 3), np.float32)


def test_a_shadow_takes_the_sun_and_leaves_the_sky(kit, shown):
    # The sun stands in +x at 45 degrees: the shadow's middle lies half a metre to -x
    raw = shadow_scene(kit, [1, 1, 0])
    picture = shown(raw, {"ball": kit.sphere_asset()}, size=(129, 129), environment=EVEN)
    metre = 129 * 24 / 24 / 6
    spot = picture[64, round(64 - 0.6 * metre)]
    far = picture[64, 5]
    albedo = np.array(GREY["albedo"])
    np.testing.assert_allclose(far, albedo * (0.1 + 3 / np.pi * np.sqrt(0.5)), rtol=0.01)
    # What is left is sky, under the contact of the ball: between half and all of it
    assert np.all(spot <= albedo * 0.1 * 1.01)
    assert np.all(spot >= albedo * 0.1 * 0.5)
    lit = picture[64, round(64 + 1.5 * metre)]
    np.testing.assert_allclose(lit, far, rtol=0.02)


def test_a_shadow_of_a_ball_is_the_ellipse_of_a_ball(kit, shown):
    # Half axes r across and r / sin(elevation) along, middle at height / tan(elevation)
    tangent = 1.0
    raw = shadow_scene(kit, [1, tangent, 0])
    asset = kit.sphere_asset(size=128)
    picture = shown(raw, {"ball": asset}, size=(257, 257), environment=EVEN)[..., 0]
    metre = 257 / 6
    dark = picture < 0.5 * picture[128, 10]
    columns = np.flatnonzero(dark.any(axis=0))
    rows = np.flatnonzero(dark.any(axis=1))
    along = (columns[-1] - columns[0] + 1) / metre
    across = (rows[-1] - rows[0] + 1) / metre
    # Slices of the body miss its ends by less than half of one in eight
    assert along == pytest.approx(1 / np.sin(np.arctan(tangent)), rel=1 / 16)
    assert across == pytest.approx(1.0, rel=1 / 16)
    middle = (columns[0] + columns[-1]) / 2
    assert (128 - middle) / metre == pytest.approx(0.5 / tangent, abs=0.08)


def test_a_lopsided_body_throws_a_shadow_without_a_seam(kit, shown):
    # Half a ball: right of its axis there is nothing
    asset = kit.sphere_asset(size=128)
    for level in asset.levels:
        level[..., level.shape[2] // 2 :, :] = np.where(np.arange(len(level)) == 0, 0, 128)[
            :, None, None, None
        ]
    raw = shadow_scene(kit, [1, 1, 0])
    picture = shown(raw, {"ball": asset}, size=(257, 257), environment=EVEN)[..., 0]
    sun = picture[128, 10] - 0.1 * GREY["albedo"][0]
    # The slices nearest the axis are half a slice of one in eight off it, a sixteenth of a metre:
    # a row, 1/43 m, turns at most half of 43/16 rows' worth of one side into the other
    beside = picture[100:157, 128 - 45 : 128 - 25] / sun
    assert np.ptp(beside) > 0.4
    assert np.abs(np.diff(beside, axis=0)).max() < 0.5 * 16 / 43 * 1.5


def test_at_noon_the_shadow_is_a_disc_under_the_ball(kit, shown):
    raw = shadow_scene(kit, [0, 1, 0])
    picture = shown(raw, {"ball": kit.sphere_asset(size=128)}, size=(257, 257), environment=EVEN)[
        ..., 0
    ]
    dark = picture < 0.5 * picture[128, 10]
    assert np.sqrt(dark.sum() / np.pi) / (257 / 6) == pytest.approx(0.5, rel=1 / 8)


def test_a_wide_sun_softens_the_far_end_of_the_shadow(kit, shown):
    def edge(diameter):
        raw = shadow_scene(kit, [1, 0.5, 0])
        raw["lights"][0]["angular_diameter"] = diameter
        row = shown(raw, {"ball": kit.sphere_asset(size=128)}, size=(257, 257), environment=EVEN)[
            128
        ]
        # From the open ground to the middle of the shadow, 1 m from the foot
        tip = row[10:85, 0] / row[10, 0]
        share = (tip - tip[-1]) / (1 - tip[-1])
        return np.count_nonzero((share > 0.1) & (share < 0.9))

    # Light from the top travels 1 / sin(26.6 degrees) = 2.2 m: 12 degrees blur over .47 m, 20
    # pixels across the ray and twice that along the ground; the real sun's blur is under two
    assert edge(0.53) < 12
    assert 20 < edge(12.0) < 60


def test_a_set_may_throw_no_shadow(kit, shown):
    ball = {"name": "ball", "source": "meshes/b.glb", "height": 1.0, "positions": [[0, 0, 0]]}
    raw = shadow_scene(kit, [1, 1, 0], billboards=[{**ball, "shadow": False}])
    picture = shown(raw, {"ball": kit.sphere_asset()}, size=(65, 65), environment=EVEN)
    assert np.ptp(picture[10, :, 0]) < 1e-3
    assert picture[32, :24].min() > 0.99 * picture[10, 10].min()


def test_mottling_dies_out_before_it_can_alias(kit, shown):
    ground = {"albedo": [0.1] * 3, "accent": [0.9] * 3, "scale": 0.5}
    camera = {"position": [0, 1.5, 0], "target": [0, 1.2, -4], "focal_length_mm": 30}
    raw = kit.scene_dict(billboards=None, ground=ground, camera=camera)
    fine, coarse = shown(raw, size=(256, 256)), shown(raw, size=(64, 64))
    mean = fine.reshape(64, 4, 64, 4, 3).mean(axis=(1, 3))
    ground_rows = slice(40, 64)
    # A pixel is near the mean of its own sixteenths: off by the width of its filter, where aliasing
    # would show the noise's own deviation
    difference = (coarse - mean)[ground_rows, :, 0]
    spread = fine[160:, :, 0]
    assert np.sqrt(np.mean(difference**2)) < 0.3 * np.std(spread)
    assert np.ptp(spread) > 0.2
    far = fine[int(np.argmax(fine[:, 128, 0] > 0)) + 3]
    assert np.ptp(far[:, 0]) < 0.05 * np.ptp(spread)
