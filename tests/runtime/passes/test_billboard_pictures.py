"""Pictures drawn as they are: texel to pixel, rolled, facing the camera, over and under others."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from formats.picture import Picture
from formats.scene import NEAR
from maths import transforms
from runtime.camera import Camera
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = 64
HALF = 2.0**-10  # two roundings to half floats: the texture's and the target's, cut off on llvmpipe


def halved(level):
    n = len(level) // 2
    small = level.reshape(n, 2, n, 2, 4).mean(axis=(1, 3))
    small[[0, -1]] = small[:, [0, -1]] = 0
    return small


def picture_asset(size=SIZE, alpha=1.0, seed=3, max_lod=4.0):
    """A smooth pattern of colours in a border of an eighth, one metre high."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size] / size
    waves = [np.sin(rng.uniform(3, 9) * x + rng.uniform(3, 9) * y + k) for k in range(3)]
    values = np.concatenate([0.5 + 0.4 * np.moveaxis(waves, 0, 2), alpha + 0 * x[..., None]], -1)
    values[..., :3] *= alpha
    edge = size // 8
    values[[*range(edge), *range(-edge, 0)]] = 0
    values[:, [*range(edge), *range(-edge, 0)]] = 0
    levels = [values]
    while len(levels[-1]) > 4:
        levels.append(halved(levels[-1]))
    return Picture(
        levels=tuple(level[None].astype(np.float16) for level in levels),
        metres_per_texel=1 / (0.75 * size),
        pivot=(size / 2, size * 7 / 8),
        height=1.0,
        max_lod=max_lod,
        lens_scale=0.45,
    )


def dots(name="dot", positions=((0, 0, 0),), **extra):
    return {
        "name": name,
        "source": f"pictures/{name}.png",
        "height": 1.0,
        "positions": [list(p) for p in positions],
        **extra,
    }


@pytest.fixture
def shown(kit, write_scene, ctx):
    """Return shown(sets, assets, ...) -> linear (h, w, 3) with a pixel a texel at the origin."""
    count = iter(range(100))

    def show(sets, assets, camera=None, size=(SIZE, SIZE), calls=None, **parts):
        asset = next(iter(assets.values()))
        raw = kit.texel_to_pixel(asset, billboards=sets, **{"lights": [], **parts})
        folder = write_scene(raw, assets, name=f"scene{next(count)}")
        with Player(folder, size=size, context=ctx) as player:
            player.camera = camera
            found = player.linear(0.0)
            if calls is not None:
                calls.append(player.profile)
        return found[..., :3]

    return show


def test_a_picture_is_shown_as_it_is(shown):
    asset = picture_asset()
    found = shown([dots(radiance=[2.0, 1.0, 0.5], tint=[[1, 0.5, 1]])], {"dot": asset})
    expected = asset.levels[0][0, ..., :3].astype(float) * [2.0, 0.5, 0.5]
    # 8-bit weights of the bilinear filter besides
    np.testing.assert_allclose(found, expected, rtol=2 * HALF, atol=2e-3)
    assert expected.max() > 0.5


def test_no_light_changes_it(shown):
    asset = picture_asset()
    sun = [{"type": "sun", "to_light": [0, 1, 1], "irradiance": [9, 9, 9]}]
    dark, lit = (shown([dots()], {"dot": asset}, lights=lights) for lights in ([], sun))
    np.testing.assert_array_equal(dark, lit)


@pytest.mark.parametrize(("degrees", "turns"), [(90, 1), (180, 2), (-90, 3)])
def test_a_roll_turns_it_counter_clockwise_about_its_middle(shown, degrees, turns):
    asset = picture_asset()
    plain, rolled = (
        shown([dots(facing="camera", positions=[[0, 0.5, 0]], roll=[r])], {"dot": asset})
        for r in (0.0, degrees)
    )
    # The middle of the picture is in the middle of the frame here
    border = asset.pivot[1] - 0.5 / asset.metres_per_texel
    assert border == SIZE / 2
    np.testing.assert_allclose(rolled, np.rot90(plain, turns), atol=4e-3)
    assert np.abs(rolled - plain).max() > 0.1


def test_a_flip_comes_before_the_roll(shown):
    asset = picture_asset()
    where = {"facing": "camera", "positions": [[0, 0.5, 0]]}
    plain = shown([dots(**where)], {"dot": asset})
    both = shown([dots(**where, flip=[True], roll=[90])], {"dot": asset})
    np.testing.assert_allclose(both, np.rot90(plain[:, ::-1]), atol=4e-3)


def test_one_that_faces_the_camera_looks_the_same_from_above(shown):
    asset = picture_asset()
    sets = [dots(facing="camera", positions=[[0, 0.5, 0]])]
    plain = shown(sets, {"dot": asset})
    away = asset.metres_per_texel * SIZE * 50 / 24
    from_above = transforms.rotation("y", 0.7) @ transforms.rotation("x", -0.9) @ [0, 0, away]
    middle = np.array([0, 0.5, 0])
    found = shown(sets, {"dot": asset}, camera=Camera(middle + from_above, middle))
    np.testing.assert_allclose(found, plain, atol=4e-3)
    upright = shown([dots()], {"dot": asset}, camera=Camera(middle + from_above, middle))
    assert np.abs(upright - plain).max() > 0.1


def test_without_opacity_it_only_adds_light(shown):
    behind, before = picture_asset(), picture_asset(seed=8)
    sky = {"picture": {"sky": {"zenith": [0.2] * 3, "horizon": [0.2] * 3}}}
    assets = {"behind": behind, "before": before}
    low = dots("behind", [[0, 0, -1e-3]])
    parts = [shown([one], assets, **sky) for one in (low, dots("before", opacity=0))]
    both = shown([low, dots("before", opacity=0)], assets, **sky)
    np.testing.assert_allclose(both, parts[0] + parts[1] - 0.2, rtol=4 * HALF, atol=4e-3)
    covered = shown([low, dots("before")], assets, **sky)
    alone = shown([dots("before")], assets, **sky)
    np.testing.assert_allclose(covered, alone, atol=4e-3)


def test_pictures_of_several_sets_are_one_draw(shown):
    rng = np.random.default_rng(5)
    assets = {"a": picture_asset(), "b": picture_asset(32, seed=4), "c": picture_asset(seed=9)}
    sets = [dots(name, rng.uniform(-1, 1, (40, 3)), facing="camera") for name in assets]
    calls: list = []
    whole = shown(sets, assets, calls=calls)
    assert calls[0]["by_pass"]["billboard"]["draw_calls"] == 1
    assert calls[0]["by_pass"]["billboard"]["programs"] == 1
    assert np.isfinite(whole).all()
    # Each alone looks as it does in a texture of its own
    for name, asset in assets.items():
        one = [dots(name, [[0, 0, 0]])]
        others = [dots(other, [[0, 0, 90]]) for other in assets if other != name]
        together = shown([*one, *others], {name: asset, **assets})
        np.testing.assert_allclose(together, shown(one, {name: asset}), atol=4e-3)


def test_it_fades_out_before_the_nearest_plane_cuts_it(shown):
    asset = picture_asset()
    sets = [dots(facing="camera")]
    found = []
    for away in (0.5, 2.5 * NEAR, 1.5 * NEAR, 1.1 * NEAR, 1.001 * NEAR):
        # A picture of one colour per distance: its middle
        camera = Camera(np.array([0, 0, away]), np.array([0, 0, -1.0]))
        found.append(shown(sets, {"dot": asset}, camera=camera)[SIZE // 2, SIZE // 2].max())
    full = found[0]
    # smoothstep(NEAR, 2 NEAR): 1, 1, 1/2, .028, 3e-6
    np.testing.assert_allclose(np.array(found) / full, [1, 1, 0.5, 0.028, 0], atol=0.02)
    behind = Camera(np.array([0, 0, -1.0]), np.array([0, 0, -3.0]))
    assert shown(sets, {"dot": asset}, camera=behind).max() == 0


def test_what_is_out_of_the_picture_costs_nothing_and_leaves_no_gap(shown):
    """Sprites that only reach into the picture are drawn; all that are drawn twice are the same."""
    asset = picture_asset()
    edge = asset.metres_per_texel * SIZE / 2
    half_out = shown([dots(positions=[[edge, 0, 0]])], {"dot": asset})
    whole = shown([dots()], {"dot": asset})
    np.testing.assert_allclose(half_out[:, SIZE // 2 :], whole[:, : SIZE // 2], atol=4e-3)


ONLY = """
import sys
from runtime.player import Player
with Player(sys.argv[1], size=(32, 32)) as player:
    player.frame(0.0)
    assert player.profile["programs"] == 2, player.profile
lit = ("formats.billboard", "formats.dome", "runtime.dome_series", "runtime.sprite_shadows")
print([name for name in lit if name in sys.modules])
"""


def test_a_scene_of_pictures_alone_loads_nothing_of_light(kit, write_scene):
    raw = kit.scene_dict(billboards=[dots()], lights=[])
    folder = write_scene(raw, {"dot": picture_asset()})
    done = subprocess.run(
        [sys.executable, "-c", ONLY, str(folder)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
