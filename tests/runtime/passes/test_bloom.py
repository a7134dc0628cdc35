"""Bloom on the card against its numpy twin; light is neither added nor lost; counts."""

from __future__ import annotations

import numpy as np
import pytest

from maths import bloom
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = (96, 54)
HALF = 2.0**-11  # what one rounding to a half float changes at most


@pytest.fixture
def player_of(kit, write_scene, ctx):
    """Return player_of(bloom table, size) -> a player of nothing but bloom and film."""
    made = []

    def make(table, size=SIZE):
        raw = kit.scene_dict(billboards=None, picture={"bloom": table})
        made.append(Player(write_scene(raw, {}, name=f"s{len(made)}"), size=size, context=ctx))
        return made[-1]

    yield make
    for player in made:
        player.close()


def bloomed(player, picture):
    """What the pass makes of radiance (h, w, 3), row 0 at the bottom as on the card."""
    h, w, _ = picture.shape
    player.draw(0.0, finished=False)
    full = np.ones((h, w, 4), np.float16)
    full[..., :3] = picture
    colour = player.targets.texture("colour")
    colour.write(full.tobytes(), alignment=1)
    player.passes["bloom"].draw(0.0)
    found = np.frombuffer(colour.read(alignment=1), np.float16).reshape(h, w, 4)
    return found[..., :3].astype(np.float64)


@pytest.mark.parametrize(
    ("size", "table"),
    [
        (SIZE, {"strength": 0.6}),
        (SIZE, {"strength": 0.6, "threshold": 1.0}),
        ((67, 41), {"strength": 1.0, "radius": 0.4}),
        ((1, 3), {"strength": 0.5, "radius": 0.5}),
    ],
)
def test_it_is_its_twin(player_of, rng, size, table):
    picture = np.exp(rng.normal(-1, 2, (size[1], size[0], 3))).astype(np.float16).astype(float)
    found = bloomed(player_of(table, size), picture)
    expected = bloom.bloom(
        picture, table["strength"], table.get("threshold", 0.0), table.get("radius", 0.1) * size[1]
    )
    # Each of at most 5 levels is rounded twice, and the picture once
    np.testing.assert_allclose(found, expected, rtol=11 * HALF, atol=1e-6)


@pytest.mark.parametrize("strength", [0.1, 0.7])
@pytest.mark.parametrize(("threshold", "steps"), [(0.0, 1), (0.25, 2)])
def test_a_constant_picture_stays_but_for_a_rounding(player_of, rng, strength, threshold, steps):
    player = player_of({"strength": strength, "threshold": threshold, "radius": 0.3})
    for value in rng.uniform(0.3, 4.0, (20, 3)).astype(np.float16):
        even = np.broadcast_to(value.astype(float), (54, 96, 3))
        found = bloomed(player, even)
        # The weights sum to 1 in single precision, of which a driver may cut off what no half float
        # holds: a step. What is over a threshold is no half float itself; measured one step too
        assert (np.abs(found - even) <= steps * np.spacing(value).astype(float)).all()


@pytest.mark.parametrize("place", [(128, 64), (131, 77), (110, 70)])
@pytest.mark.parametrize("threshold", [0.0, 100.0])
def test_the_light_of_one_pixel_sums_to_what_it_was(player_of, place, threshold):
    picture = np.zeros((144, 256, 3))
    picture[place[1], place[0]] = [40000.0, 10000.0, 2000.0]
    player = player_of({"strength": 0.8, "threshold": threshold, "radius": 0.08}, (256, 144))
    found = bloomed(player, picture)
    total = found.sum(axis=(0, 1))
    # A driver that cuts off half floats loses 0.7 * 2^-11 at each writing on average: five to six
    # on the way of the light, measured 0.0019. The sum itself is proven of the twin
    np.testing.assert_allclose(total, picture.sum(axis=(0, 1)), rtol=3e-3)
    assert found[place[1], place[0], 0] < 0.4 * 40000.0


def test_strength_nought_leaves_every_bit_and_makes_nothing(player_of, rng):
    strength = {"times": [0.0, 1.0], "values": [0.0, 1.0]}
    player = player_of({"strength": strength})
    picture = rng.uniform(0, 4, (54, 96, 3)).astype(np.float16).astype(float)
    np.testing.assert_array_equal(bloomed(player, picture), picture)
    textures = player.targets.texture_count
    player.draw(0.5, finished=False)
    # Half sizes down to a deviation of 5 pixels: octaves 1 and 2, and part of the third
    assert player.targets.texture_count == textures + 3


def test_under_the_threshold_not_a_bit_changes(player_of, rng):
    picture = rng.uniform(0, 0.99, (54, 96, 3)).astype(np.float16).astype(float)
    found = bloomed(player_of({"strength": 1.0, "threshold": 1.0}), picture)
    np.testing.assert_array_equal(found, picture)


@pytest.mark.parametrize(("threshold", "textures"), [(0.0, 3), (0.5, 4)])
def test_it_takes_two_programs_and_the_textures_of_its_levels(
    kit, write_scene, ctx, threshold, textures
):
    table = {"strength": 0.5, "threshold": threshold}
    profiles = []
    for name, picture in (("without", {}), ("with", {"bloom": table})):
        raw = kit.scene_dict(billboards=None, picture=picture)
        with Player(write_scene(raw, {}, name=name), size=SIZE, context=ctx) as player:
            player.frame(0.0)
            profiles.append(player.profile)
    less, more = profiles
    assert more["programs"] - less["programs"] == 2
    assert more["textures"] - less["textures"] == textures
    texels = 48 * 27 + 24 * 14 + 12 * 7 + (96 * 54 if threshold else 0)
    assert more["bytes"] - less["bytes"] == 8 * texels
    assert more["by_pass"]["bloom"]["draw_calls"] == 6


@pytest.mark.parametrize("name", ["bloom", "radial_blur"])
def test_a_strength_that_changes_is_seen_by_frames_that_start_from_the_last(
    kit, write_scene, ctx, name
):
    strength = {"times": [0, 1, 2, 3], "values": [0.0, 0.2, 0.2, 0.9], "interpolation": "step"}
    picture = {
        "sky": {"zenith": [0.1, 0.2, 0.4], "horizon": [2.0, 0.6, 0.4]},
        "bloom": {"strength": 0.3},
        "radial_blur": {"strength": 0.3},
        name: {"strength": strength},
    }
    raw = kit.scene_dict(picture=picture, time={"duration": 4.0, "frame_rate": 10})
    folder = write_scene(raw, {"ball": kit.sphere_asset(size=16)})
    with (
        Player(folder, size=SIZE, context=ctx) as player,
        Player(folder, size=SIZE, context=ctx) as plain,
    ):
        plain.reuse = False
        for time in (0.0, 1.0, 1.5, 2.0, 2.5, 3.0, 3.1, 0.0, 3.0):
            np.testing.assert_array_equal(player.frame(time), plain.frame(time))
            if time == 2.5:
                # Nothing but the dither of the film changed
                assert player.skipped == ("sky", "billboard", "radial_blur", "bloom")
        assert (player.linear(1.0) != player.linear(0.0)).any()
