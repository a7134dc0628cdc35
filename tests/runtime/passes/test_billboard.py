"""Sprites drawn texel to pixel against the numpy twin, and how they stand in the scene."""

from __future__ import annotations

import numpy as np
import pytest

from maths import circular_harmonics, colour, sprite_packing, transforms
from runtime.camera import Camera
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = 64
HALF = 2.0**-11  # relative rounding of the RGBA16F target


def relit(asset, light_direction, irradiance, view=0):
    """Slow truth: decode view `view`, unpack every term, sum over terms, clamp: (h, w, 4)."""
    P = asset.planes
    planes = sprite_packing.decode(asset.levels[0][view * P : view * P + P], asset.scales).astype(
        float
    )
    L = circular_harmonics.project_sun(
        light_direction,
        irradiance,
        asset.ring.terms,
        axis=asset.ring.axis,
        elevation=asset.ring.elevation,
        one_sided=asset.ring.one_sided,
    )
    twelve = asset.packing == "twelve" and asset.ring.terms >= 5
    if twelve and asset.unpack == "talk":
        L = np.concatenate([L[:3], np.repeat(colour.luminance(L[3:])[:, None], 3, axis=1)])
    Y = sprite_packing.unpack(planes, asset.ring.terms, asset.packing, asset.unpack)
    rgb = np.maximum(np.einsum("khwc,kc->hwc", Y, L), 0)
    return np.concatenate([rgb, planes[0, ..., 3:]], axis=-1)


@pytest.mark.parametrize("half", [False, True], ids=["rgba8", "rgba16f"])
@pytest.mark.parametrize(
    ("terms", "packing", "unpack"),
    [(k, "full", "chroma") for k in (1, 3, 5, 9, 11)]
    + [(k, "twelve", u) for k in (5, 9) for u in ("chroma", "talk")],
)
def test_the_shader_shows_what_the_twin_computes(
    kit, write_scene, ctx, terms, packing, unpack, half
):
    asset = kit.sphere_asset(terms=terms, packing=packing, unpack=unpack, size=SIZE, half=half)
    folder = write_scene(kit.texel_to_pixel(asset), {"ball": asset})
    with Player(folder, size=(SIZE, SIZE), context=ctx) as player:
        found = player.linear(0.0)
    sun = transforms.normalise(kit.SUN)
    expected = relit(asset, sun, kit.IRRADIANCE)
    # 1/255 of the range is asked for; an eighth of it holds (8-bit weights of the bilinear filter)
    limit = expected[..., :3].max() / 255 / 8
    np.testing.assert_allclose(found[..., :3], expected[..., :3], rtol=2 * HALF, atol=limit)
    assert expected[..., :3].max() > 0.3


@pytest.fixture
def shown(write_scene, ctx):
    """Return shown(raw, assets, size, time=0, camera=None) -> linear (h, w, 3)."""
    count = iter(range(100))

    def show(raw, assets, size=(SIZE, SIZE), time=0.0, camera=None):
        folder = write_scene(raw, assets, name=f"scene{next(count)}")
        with Player(folder, size=size, context=ctx) as player:
            player.camera = camera
            return player.linear(time)[..., :3]

    return show


def ball_set(name, positions, **extra):
    return {
        "name": name,
        "source": "meshes/ball.glb",
        "height": 1.0,
        "positions": positions,
        **extra,
    }


def test_a_flipped_sprite_is_the_mirror_image_under_the_mirrored_light(kit, shown):
    asset = kit.sphere_asset()
    x, y, z = kit.SUN
    left, right = (
        kit.texel_to_pixel(
            asset,
            lights=[{"type": "sun", "to_light": d, "irradiance": [3, 3, 3]}],
            billboards=[ball_set("ball", [[0, 0, 0]], flip=[flip])],
        )
        for d, flip in (([x, y, z], False), ([-x, y, z], True))
    )
    plain, flipped = (shown(raw, {"ball": asset}) for raw in (left, right))
    # Half-float rounding of coordinates that are mirrored, not equal
    np.testing.assert_allclose(flipped[:, ::-1], plain, atol=2 * HALF * plain.max())
    assert np.abs(plain[:, ::-1] - plain).max() > 0.1


def test_walking_round_with_the_sun_changes_nothing(kit, shown):
    asset = kit.sphere_asset()
    raw = kit.texel_to_pixel(asset)
    reference = shown(raw, {"ball": asset})
    turn = transforms.rotation("y", 2.0)
    camera = Camera(
        turn @ np.array(raw["camera"]["position"]), np.array(raw["camera"]["target"], float)
    )
    raw["lights"][0]["to_light"] = (turn @ np.array(kit.SUN)).tolist()
    found = shown(raw, {"ball": asset}, camera=camera)
    np.testing.assert_allclose(found, reference, atol=2 * HALF * reference.max())


def test_the_nearest_of_the_views_is_shown(kit, shown):
    asset = kit.sphere_asset(views=4)
    raw = kit.texel_to_pixel(asset)
    distance, height = raw["camera"]["position"][2], raw["camera"]["target"][1]
    brightness = []
    for degrees in (0, 40, 50, 100, 180, 271):
        azimuth = np.radians(degrees)
        towards = np.array([np.sin(azimuth), 0, np.cos(azimuth)])
        camera = Camera(distance * towards + [0, height, 0], np.array([0, height, 0]))
        raw["lights"][0]["to_light"] = (towards * 0.9 + [0, 0.6, 0]).tolist()
        brightness.append(shown(raw, {"ball": asset}, camera=camera).max())
    # The fixture darkens view v > 0 to (v + 1) / 5 of view 0
    expected = np.array([5, 5, 2, 2, 3, 4]) / 5
    np.testing.assert_allclose(np.array(brightness) / brightness[0], expected, rtol=0.01)


def test_a_turned_instance_shows_another_view(kit, shown):
    asset = kit.sphere_asset(views=4)
    raw = kit.texel_to_pixel(asset)
    plain = shown(raw, {"ball": asset}).max()
    raw["billboards"] = [ball_set("ball", [[0, 0, 0]], yaw=[-90.0])]
    # An object turned by -90 degrees shows what stands at +90 degrees of it: view 1
    assert shown(raw, {"ball": asset}).max() / plain == pytest.approx(2 / 5, rel=0.01)


def test_tint_multiplies_each_channel(kit, shown):
    asset = kit.sphere_asset()
    raw = kit.texel_to_pixel(asset)
    plain = shown(raw, {"ball": asset})
    raw["billboards"] = [ball_set("ball", [[0, 0, 0]], tint=[[0.5, 1.0, 2.0]])]
    tinted = shown(raw, {"ball": asset})
    np.testing.assert_allclose(tinted, plain * [0.5, 1, 2], rtol=2 * HALF, atol=1e-6)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_near_sprites_cover_far_ones_whatever_their_order(kit, shown, order):
    assets = {
        "red": kit.sphere_asset(colour=(0.9, 0.0, 0.0)),
        "blue": kit.sphere_asset(colour=(0, 0, 0.9)),
    }
    sets = [ball_set("red", [[0, 0, 0]]), ball_set("blue", [[0, 0, -3]])]
    raw = kit.scene_dict(billboards=[sets[i] for i in order])
    middle = shown(raw, assets, size=(65, 65))[32, 32]
    assert middle[0] > 0.1
    assert middle[2] == 0


def test_runs_of_one_set_are_drawn_at_once(kit, write_scene, ctx):
    assets = {name: kit.sphere_asset(size=16) for name in ("a", "b")}
    places = {"a": [[0, 0, -1], [1, 0, -2], [0, 0, -9]], "b": [[0, 0, -3], [2, 0, -4]]}
    raw = kit.scene_dict(billboards=[ball_set(name, where) for name, where in places.items()])
    with Player(write_scene(raw, assets), size=(32, 32), context=ctx) as player:
        player.frame(0.0)
        # a | b b | a a, and the film
        assert player.profile["draw_calls"] == 3 + 1


def test_the_ground_hides_what_is_below_it(kit, shown):
    asset = kit.sphere_asset()
    raw = kit.scene_dict(
        ground={"albedo": [0, 0, 0]}, billboards=[ball_set("ball", [[0, -0.5, 0]])]
    )
    raw["camera"] = {"position": [0, 0.4, 4], "target": [0, 0, 0], "focal_length_mm": 50}
    picture = shown(raw, {"ball": asset}, size=(64, 64))
    lit = np.flatnonzero(picture.max(axis=(1, 2)) > 0)
    # Half a metre at 4.02 m is 16.6 rows; the middle row is the ground line at the sprite
    assert lit[0] in (15, 16)
    assert abs(lit[-1] - 31) <= 1


def test_light_from_a_far_ball_is_that_of_a_sun(kit, shown):
    asset = kit.sphere_asset()
    raw = kit.texel_to_pixel(asset)
    sun = shown(raw, {"ball": asset})
    direction = transforms.normalise(kit.SUN)
    radius, distance = 1.0, 1000.0
    radiance = 3.0 / (np.pi * (radius / distance) ** 2)
    raw["lights"] = [
        {
            "type": "sphere",
            "position": (direction * distance + [0, 0.5, 0]).tolist(),
            "radius": radius,
            "radiance": [radiance] * 3,
        }
    ]
    # The cap of 1 mrad radius: errors of the order of its square
    np.testing.assert_allclose(shown(raw, {"ball": asset}), sun, rtol=4 * HALF, atol=1e-4)


def test_each_sprite_has_its_own_light_from_a_near_ball(kit, shown):
    asset = kit.sphere_asset()
    raw = kit.scene_dict(
        billboards=[ball_set("ball", [[-1.2, 0, 0], [1.2, 0, 0]])],
        lights=[{"type": "sphere", "position": [0, 0.5, 0.3], "radius": 0.1, "radiance": [30] * 3}],
    )
    picture = shown(raw, {"ball": asset}, size=(128, 64)).sum(axis=(0, 2))
    left, right = picture[:64], picture[64:]
    # Both are lit on the side that faces the middle
    assert np.average(np.arange(64), weights=left) > np.average(np.arange(64), weights=left > 0) + 1
    assert (
        np.average(np.arange(64), weights=right) < np.average(np.arange(64), weights=right > 0) - 1
    )


def test_radiance_is_clamped_after_the_sum(kit, shown):
    asset = kit.sphere_asset()
    raw = kit.texel_to_pixel(
        asset, lights=[{"type": "sun", "to_light": [1, 0, 0.01], "irradiance": [9] * 3}]
    )
    expected = relit(asset, transforms.normalise([1, 0, 0.01]), [9] * 3)[..., :3]
    found = shown(raw, {"ball": asset})
    assert found.min() == 0
    np.testing.assert_allclose(found, expected, rtol=2 * HALF, atol=expected.max() / 255 / 8)
