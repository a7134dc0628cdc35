"""The sky: its colours, its sun, and only where nothing opaque stands."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.player import Player

pytestmark = pytest.mark.gpu
HALF = 2.0**-11
SKY = {"zenith": [0.1, 0.2, 0.4], "horizon": [0.9, 0.6, 0.4]}


@pytest.fixture
def shown(kit, write_scene, ctx):
    """Return shown(sky, camera, **tables) -> linear (h, w, 3)."""
    count = iter(range(100))

    def show(sky, camera, size=(65, 65), **tables):
        raw = kit.scene_dict(billboards=None, camera=camera, picture={"sky": sky}, **tables)
        with Player(write_scene(raw, {}, name=f"s{next(count)}"), size=size, context=ctx) as player:
            return player.linear(0.0)[..., :3]

    return show


def looking(direction, focal=50):
    return {
        "position": [0, 1, 0],
        "target": [0 + direction[0], 1 + direction[1], direction[2]],
        "focal_length_mm": focal,
    }


def test_horizon_and_zenith_have_their_own_colours(shown):
    level = shown(SKY, looking([0, 0, -1]))
    np.testing.assert_allclose(level[33:], np.broadcast_to(SKY["horizon"], (32, 65, 3)), rtol=0.003)
    up = shown(SKY, looking([0, 1, 0]))[32, 32]
    # exp(-5.5) of the horizon is left overhead
    expected = np.array(SKY["zenith"]) + np.exp(-5.5) * (np.array(SKY["horizon"]) - SKY["zenith"])
    np.testing.assert_allclose(up, expected, rtol=0.002)
    assert np.all(np.diff(level[:33, 32, 0]) >= 0)


def test_the_sun_stands_where_its_light_comes_from(shown):
    sun = {
        "type": "sun",
        "to_light": [0.2, 0.3, -1],
        "irradiance": [1, 1, 1],
        "angular_diameter": 2,
    }
    sky = SKY | {"glow": [2, 1, 0.5]}
    picture = shown(sky, looking([0.2, 0.3, -1]), lights=[sun])
    rows, columns = np.nonzero(picture[..., 0] > 0.9 * picture[..., 0].max())
    assert (rows.mean(), columns.mean()) == pytest.approx((32, 32), abs=0.25)
    # A disc of 2 degrees over 27 degrees of 65 pixels, limb included
    disc = picture[..., 0] > 0.5 * picture[..., 0].max()
    assert 2 * np.sqrt(disc.sum() / np.pi) == pytest.approx(2 / 27 * 65, rel=0.25)
    away = shown(sky, looking([-0.2, 0.3, 1]), lights=[sun])
    plain = shown(SKY, looking([-0.2, 0.3, 1]), lights=[sun])
    np.testing.assert_allclose(away, plain, atol=1e-3)


def test_the_sky_leaves_the_ground_alone(shown):
    with_sky = shown(SKY, looking([0, -0.3, -1]), ground={"albedo": [0.3, 0.3, 0.3]}, lights=[])
    sky_rows = (with_sky.max(axis=2) > 0).any(axis=1)
    assert sky_rows[0] == (with_sky[0].max() > 0)
    assert not sky_rows[32:].any()


def test_without_a_sky_the_background_is_black(kit, write_scene, ctx):
    raw = kit.scene_dict(billboards=None)
    with Player(write_scene(raw, {}), size=(8, 8), context=ctx) as player:
        assert player.linear(0.0)[..., :3].max() == 0
        assert "sky" not in player.passes
