"""Sprites under a dome: drawn texel to pixel against the numpy twin, under every kind of light."""

from __future__ import annotations

import numpy as np
import pytest

from formats.errors import InputError
from maths import hemispherical_lights, transforms
from runtime.player import Player
from tests.runtime import domes

pytestmark = pytest.mark.gpu
SIZE = 64
HALF = 2.0**-11  # relative rounding of the RGBA16F target


def relit(asset, series, view=0):
    """Slow truth: every channel by its own slot, summed, then clamped: (h, w, 3)."""
    P = asset.planes
    codes = asset.levels[0][view * P : view * P + P].astype(float)
    light = asset.constants(series)
    rgb = np.zeros((*codes.shape[1:3], 3))
    for k in range(asset.channels):
        place = k if k < 3 else k + 1
        plane, slot = place // 4, place % 4
        value = (codes[plane, ..., slot] - 128) / 127 * asset.scales[plane, slot]
        rgb += value[..., None] * light[k]
    return np.maximum(rgb, 0)


def bands_of(asset):
    return round(asset.components.shape[1] ** 0.5)


@pytest.fixture
def shown(write_scene, ctx):
    """Return shown(raw, assets, environment=None) -> linear (h, w, 4)."""
    count = iter(range(100))

    def show(raw, assets, environment=None):
        folder = write_scene(raw, assets, name=f"scene{next(count)}", environment=environment)
        with Player(folder, size=(SIZE, SIZE), context=ctx) as player:
            return player.linear(0.0)

    return show


def check(found, expected):
    # 1/255 of the range is asked for; an eighth of it holds (8-bit weights of the bilinear filter)
    limit = expected.max() / 255 / 8
    np.testing.assert_allclose(found[..., :3], expected, rtol=2 * HALF, atol=limit)
    assert expected.max() > 0.2


# 3 channels share a plane with coverage; 9 are the most whose light goes through the vertex shader
@pytest.mark.parametrize("channels", [2, 3, 9, 15, 19])
def test_the_shader_shows_what_the_twin_computes(kit, shown, channels):
    asset = domes.matt_ball(channels=channels)
    found = shown(kit.texel_to_pixel(asset), {"ball": asset})
    sun = hemispherical_lights.project_sun(kit.SUN, kit.IRRADIANCE, bands_of(asset))
    check(found, relit(asset, sun))


def test_a_matt_ball_looks_like_one(kit, shown):
    """The whole way, against Lambert's law."""
    asset = domes.matt_ball(bands=5)
    found = shown(kit.texel_to_pixel(asset), {"ball": asset})[..., 2]
    x, y = np.meshgrid(*[(np.arange(SIZE) + 0.5 - SIZE / 2) / 24] * 2)
    inside = x**2 + y**2 < 0.9
    normals = np.stack([x, -y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)
    truth = 0.4 * 3 / np.pi * np.maximum(normals @ transforms.normalise(kit.SUN), 0)
    # Five bands of a half-lit ball, cut at fifteen channels: measured .0091 RMS, .037 at most
    assert np.sqrt(np.mean((found - truth)[inside] ** 2)) < 0.012
    assert np.abs(found - truth)[inside].max() < 0.05


def test_a_map_lights_by_its_own_quadrature(kit, shown):
    asset = domes.matt_ball()
    lights = [{"type": "environment", "source": "environments/e.hdr", "scale": 2, "rotate": 40}]
    raw = kit.texel_to_pixel(asset, lights=lights)
    radiance = np.random.default_rng(5).uniform(0, 1, (16, 32, 3)).astype(np.float32)
    found = shown(raw, {"ball": asset}, environment=radiance)
    # The asset of the map holds half floats
    stored = radiance.astype(np.float16).astype(float)
    seen = hemispherical_lights.project_environment(stored, bands_of(asset), yaw=-np.radians(40))
    check(found, relit(asset, 2 * seen))


def test_a_near_ball_lights_by_its_cap(kit, shown):
    asset = domes.matt_ball()
    ball = {"type": "sphere", "position": [1.0, 1.2, 0.8], "radius": 0.4, "radiance": [9, 6, 3]}
    raw = kit.texel_to_pixel(asset, lights=[ball])
    series = hemispherical_lights.project_sphere([1.0, 0.7, 0.8], 0.4, [9, 6, 3], bands_of(asset))
    check(shown(raw, {"ball": asset}), relit(asset, series))


@pytest.mark.parametrize("kind", ["sun", "sphere"])
def test_a_flipped_sprite_is_the_mirror_image_under_the_mirrored_light(kit, shown, kind):
    asset = domes.matt_ball()
    x, y, z = kit.SUN
    pictures = []
    for side, flip in ((1, False), (-1, True)):
        light = {"type": "sun", "to_light": [side * x, y, z], "irradiance": [3, 3, 3]}
        if kind == "sphere":
            place = [side * 2 * x, 2 * y, 2 * z]
            light = {"type": "sphere", "position": place, "radius": 0.3, "radiance": [30, 30, 30]}
        raw = kit.texel_to_pixel(asset, lights=[light])
        raw["billboards"][0]["flip"] = [flip]
        pictures.append(shown(raw, {"ball": asset})[..., :3])
    plain, flipped = pictures
    # Half-float rounding of coordinates that are mirrored, not equal
    np.testing.assert_allclose(flipped[:, ::-1], plain, atol=2 * HALF * plain.max())
    assert np.abs(plain[:, ::-1] - plain).max() > 0.1


def test_views_and_coverage_are_those_of_the_asset(kit, shown):
    asset = domes.matt_ball(views=4)
    raw = kit.texel_to_pixel(asset)
    raw["billboards"][0]["yaw"] = [-90.0]
    found = shown(raw, {"ball": asset})
    sun = hemispherical_lights.project_sun(kit.SUN, kit.IRRADIANCE, bands_of(asset))
    expected = relit(asset, sun, view=1)
    np.testing.assert_allclose(found[..., :3], expected, rtol=2 * HALF, atol=4e-4)
    assert expected.max() > 0.1
    # What stands behind shows where coverage ends, and only there
    back = {"name": "back", "source": "meshes/b.glb", "height": 9.0, "positions": [[0, -4, -3]]}
    raw["billboards"].append({**back, "shadow": False})
    both = shown(raw, {"ball": asset, "back": kit.sphere_asset(colour=(0.9, 0.9, 0.9))})
    solid = asset.alpha() == 1
    # 8-bit weights of the bilinear filter: a 256th of what stands behind at the edge
    np.testing.assert_allclose(both[solid], found[solid], rtol=2 * HALF, atol=1 / 256)
    assert both[~solid][:, 0].mean() > 0.1


def test_rings_and_domes_stand_in_one_scene(kit, write_scene, ctx):
    assets = {"ball": kit.sphere_asset(), "bowl": domes.matt_ball(size=32)}
    raw = kit.scene_dict()
    raw["billboards"].append(
        {"name": "bowl", "source": "meshes/b.glb", "height": 1.0, "positions": [[1, 0, 0]]}
    )
    raw["lights"].append({"type": "environment", "source": "environments/e.hdr"})
    folder = write_scene(raw, assets, environment=np.ones((8, 16, 3), np.float32))
    with Player(folder, size=(96, 64), context=ctx) as player:
        picture = player.linear(0.0)[..., 0]
        assert picture[:, :24].max() == 0
        # Two balls of one metre, of albedos .8 and .9 where they are lightest
        left, right = picture[:, 24:60].max(), picture[:, 60:].max()
        assert right / left == pytest.approx(0.9 / 0.8, rel=0.1)
        turned = player.sprite_lighting._kept
        assert {key[1] for key in turned} == {"ring", "dome"}


@pytest.mark.parametrize(
    ("wrong", "says"), [({"coverage": False}, "coverage"), ({"space": "stored"}, "linear")]
)
def test_photographs_that_no_scene_can_show_are_refused(kit, write_scene, ctx, wrong, says):
    asset = domes.matt_ball(size=16, **wrong)
    folder = write_scene(kit.scene_dict(), {"ball": asset})
    with pytest.raises(InputError, match=says):
        Player(folder, size=(8, 8), context=ctx)
