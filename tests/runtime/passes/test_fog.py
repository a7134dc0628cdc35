"""Fog: one function for the ground, for sprites and, at the horizon only, for the sky."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.player import Player

pytestmark = pytest.mark.gpu
FOG = {"extinction": 0.08, "radiance": [0.2, 0.4, 0.8]}
SKY = {"zenith": [0.5, 0.1, 0.1], "horizon": [0.5, 0.1, 0.1]}


@pytest.fixture
def shown(write_scene, ctx):
    """Return shown(raw, assets, size) -> linear (h, w, 3)."""
    count = iter(range(100))

    def show(raw, assets=(), size=(65, 65)):
        with Player(
            write_scene(raw, dict(assets), name=f"s{next(count)}"), size=size, context=ctx
        ) as p:
            return p.linear(0.0)[..., :3]

    return show


@pytest.mark.parametrize("falloff", [0.0, 0.4])
def test_fog_over_the_ground_is_exponential_in_the_distance(kit, shown, falloff):
    camera = {"position": [0, 2, 0], "target": [0, 0, -5], "focal_length_mm": 24}
    ground = {"albedo": [0.5, 0.5, 0.5]}
    raw = kit.scene_dict(billboards=None, ground=ground, camera=camera)
    clear = shown(raw)
    raw["picture"] = {"fog": FOG | {"falloff": falloff}}
    foggy = shown(raw)
    distance = np.hypot(2, 5)
    mean = (1 - np.exp(-2 * falloff)) / (2 * falloff) if falloff else 1.0
    passes = np.exp(-0.08 * distance * mean)
    expected = clear[32, 32] * passes + np.array(FOG["radiance"]) * (1 - passes)
    # 24 bits of depth, and two roundings to half floats
    np.testing.assert_allclose(foggy[32, 32], expected, rtol=2e-3)


def test_a_sprite_takes_the_fog_of_its_distance_and_keeps_its_alpha(kit, shown):
    asset = kit.sphere_asset()
    raw = kit.texel_to_pixel(asset)
    clear = shown(raw, {"ball": asset}, size=(64, 64))
    raw["picture"] = {"fog": FOG}
    foggy = shown(raw, {"ball": asset}, size=(64, 64))
    distance = raw["camera"]["position"][2]
    passes = np.exp(-0.08 * distance)
    radiance = np.array(FOG["radiance"])
    expected = clear[32, 32] * passes + radiance * (1 - passes)
    np.testing.assert_allclose(foggy[32, 32], expected, rtol=3e-3)
    # Outside the ball there is fog before nothing: the fog pass at infinity
    corner = foggy[60, 2]
    assert np.all(corner <= radiance * 1.001)


def test_the_sky_drowns_at_the_horizon_only(kit, shown):
    picture = {"sky": SKY, "fog": FOG}
    camera = {"position": [0, 1, 0], "target": [0, 1, -5], "focal_length_mm": 24}
    column = shown(kit.scene_dict(billboards=None, camera=camera, picture=picture))[:, 32]
    # At most 1e-4 / sin(3 degrees) of the sky is left, and a half float's rounding
    np.testing.assert_allclose(column[34], FOG["radiance"], rtol=0.004)
    np.testing.assert_allclose(column[0], SKY["zenith"], rtol=0.01)


def test_ground_and_sky_meet_without_a_seam(kit, shown):
    picture = {"sky": SKY, "fog": FOG}
    camera = {"position": [0, 1, 0], "target": [0, 1, -5], "focal_length_mm": 24}
    raw = kit.scene_dict(
        billboards=None, ground={"albedo": [0, 0, 0]}, camera=camera, picture=picture
    )
    column = shown(raw, size=(9, 1024))[:, 4]
    # The sky clears by 1 / sin(3 degrees) a radian, a row is a milliradian; a seam would jump
    assert np.abs(np.diff(column, axis=0)).max() < 0.8 / np.sin(np.radians(3)) / 1024 * 1.05
