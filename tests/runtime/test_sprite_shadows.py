"""Sprites in the shadow of sprites: geometry in closed form, on balls."""

from __future__ import annotations

import numpy as np
import pytest

from maths import transforms
from runtime import sprite_shadows
from runtime.player import Player
from tests.runtime import domes

pytestmark = pytest.mark.gpu


@pytest.fixture
def sets(kit, write_scene, ctx):
    """Return sets(positions, heights, **extra) -> the player's sprite sets, one ball set each."""
    count = iter(range(100))

    def make(*groups):
        asset = kit.sphere_asset(size=64)
        billboards = [
            {
                "name": f"ball{i}",
                "source": "meshes/b.glb",
                "height": height,
                "positions": positions,
                **extra,
            }
            for i, (positions, height, extra) in enumerate(groups)
        ]
        raw = kit.scene_dict(billboards=billboards)
        assets = {b["name"]: asset for b in billboards}
        folder = write_scene(raw, assets, name=f"s{next(count)}")
        with Player(folder, size=(8, 8), context=ctx) as player:
            return player.sprites

    return make


@pytest.mark.parametrize("size", [32, 64])
def test_a_dome_casts_what_a_ring_of_its_outline_casts(kit, write_scene, ctx, size):
    assets = {"ball": kit.sphere_asset(size=size), "bowl": domes.matt_ball(size=size, views=2)}
    pair = []
    for name, asset in assets.items():
        raw = kit.scene_dict(ground={"albedo": [0.5, 0.5, 0.5]})
        raw["billboards"][0]["name"] = name
        folder = write_scene(raw, {name: asset}, name=name)
        with Player(folder, size=(48, 32), context=ctx) as player:
            shades = [sprite_shadows._coverage(player.sprites[0], *spots) for spots in SPOTS]
            player.draw(0.0)
            shade = player.targets.texture("shade").read()
            pair.append((player.sprites[0], shades, np.frombuffer(shade, np.float16)))
    (ring, ring_shades, ring_shade), (dome, dome_shades, dome_shade) = pair
    # The same coverage to the code, so the same shadows to the bit
    np.testing.assert_array_equal(dome.coarse, ring.coarse)
    np.testing.assert_array_equal(dome.boxes, ring.boxes)
    assert (dome.foot, dome.crown, dome.cover) == (ring.foot, ring.crown, ring.cover)
    np.testing.assert_array_equal(dome_shades, ring_shades)
    np.testing.assert_array_equal(dome_shade, ring_shade)
    assert ring_shade.astype(float).min() < 0.5


# Metres right of the pivot and up from it
SPOTS = [(np.array([0.0, 0.3, 0.6]), np.array([0.5, 0.2, 0.9]))]
EAST = transforms.normalise([1.0, 0.5, 0.0])


def test_a_sprite_behind_a_larger_one_gets_no_sun(sets):
    # The large ball's middle is at 2 m; its shadow runs to -x from 4 / .5 = 8 m on
    found = sprite_shadows.shares(sets(([[0, 0, 0]], 4.0, {}), ([[-4, 0, 0]], 0.4, {})), EAST)
    assert found[0] == pytest.approx(1.0)
    assert found[1] == pytest.approx(1 - sprite_shadows.OPAQUE, abs=0.01)


@pytest.mark.parametrize("place", [[4.0, 0, 0], [-4.0, 0, 2.5], [-12.0, 0, 0]])
def test_in_front_beside_and_beyond_the_shadow_all_of_it_arrives(sets, place):
    found = sprite_shadows.shares(sets(([[0, 0, 0]], 4.0, {}), ([place], 0.4, {})), EAST)
    assert found[1] == pytest.approx(1.0)


def test_a_sprite_never_shades_itself_but_its_like(sets):
    one_set = sets(([[0, 0, 0], [-6.0, 0, 0]], 4.0, {}))
    found = sprite_shadows.shares(one_set, transforms.normalise([1.0, 0.1, 0.0]))[0]
    assert found[0] == pytest.approx(1.0)
    assert found[1] < 0.3


def test_under_the_crown_at_noon_it_is_dark(sets):
    pair = sets(([[0, 1.0, 0]], 4.0, {}), ([[0.3, 0, 0.2]], 0.3, {}))
    found = sprite_shadows.shares(pair, transforms.normalise([0.01, 1.0, 0.0]))
    assert found[1] < 0.1


def test_a_set_without_shadow_hides_nothing(sets):
    pair = sets(([[0, 0, 0]], 4.0, {"shadow": False}), ([[-4, 0, 0]], 0.4, {}))
    assert sprite_shadows.shares(pair, EAST)[1] == 1.0


def test_a_sun_straight_above_shades_like_one_a_hair_beside_it(sets):
    pair = sets(([[0, 1.0, 0]], 4.0, {}), ([[0.3, 0, 0.2]], 0.3, {}))
    above = sprite_shadows.shares(pair, np.array([0.0, 1.0, 0.0]))
    beside = sprite_shadows.shares(pair, transforms.normalise([0.0, 1.0, -1e-4]))
    assert above[1] < 0.1
    assert above[1] == pytest.approx(beside[1], abs=1e-9)


@pytest.mark.parametrize("direction", [[0, 1, 0], [1, -0.2, 0]])
def test_straight_above_and_below_the_horizon_nothing_is_thrown(sets, direction):
    pair = sets(([[0, 0, 0]], 4.0, {}), ([[-4, 0, 0]], 0.4, {}))
    assert sprite_shadows.shares(pair, transforms.normalise(direction))[1] == 1.0


def test_shares_change_smoothly_as_the_sun_moves(sets):
    pair = sets(([[0, 0, 0]], 4.0, {}), ([[-4, 0, 0]], 0.4, {}))
    turns = np.linspace(-0.6, 0.6, 241)
    found = [sprite_shadows.shares(pair, transforms.rotation("y", t) @ EAST)[1][0] for t in turns]
    assert min(found) < 0.05
    assert found[0] == found[-1] == 1.0
    # A step is 5 mrad: 2 cm at 4 m, where a texel of the coarse level is 33 cm; three parts share
    assert np.abs(np.diff(found)).max() < 0.15


def test_many_sprites_keep_to_the_tallest_casters(sets, monkeypatch):
    monkeypatch.setattr(sprite_shadows, "PAIRS", 3)
    trio = sets(([[0, 0, 0]], 4.0, {}), ([[-4, 0, 0]], 0.4, {}), ([[3, 0, 0]], 1.0, {}))
    kept = sprite_shadows._tallest(trio)
    assert [len(k) for k in kept] == [1, 0, 0]


def test_undergrowth_in_a_shadow_is_drawn_dark(kit, write_scene, ctx):
    assets = {"tall": kit.sphere_asset(), "low": kit.sphere_asset()}
    low = {"name": "low", "source": "meshes/b.glb", "height": 0.5, "positions": [[-4, 0, 0]]}
    tall = {"name": "tall", "source": "meshes/b.glb", "height": 4.0, "positions": [[0, 0, 0]]}
    camera = {"position": [-4, 0.25, 3], "target": [-4, 0.25, 0], "focal_length_mm": 50}
    lights = [{"type": "sun", "to_light": [1, 0.5, 0.2], "irradiance": [3, 3, 3]}]
    brightness = []
    for name, shadow in (("with", True), ("without", False)):
        raw = kit.scene_dict(
            camera=camera, lights=lights, billboards=[low, {**tall, "shadow": shadow}]
        )
        with Player(write_scene(raw, assets, name=name), size=(32, 32), context=ctx) as player:
            brightness.append(player.linear(0.0)[..., :3].max())
    assert brightness[0] < 0.1 * brightness[1]
