"""The lens on sprites: level = max(hardware level, lens level), blur by the circle of confusion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maths import optics
from runtime.camera import Camera
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = 64


@pytest.fixture
def shown(kit, write_scene, ctx):
    """Return shown(asset, lens, distance, size) -> linear (h, w, 3) of the ball, straight on."""
    count = iter(range(100))

    def show(asset, lens, distance=None, size=SIZE):
        raw = kit.texel_to_pixel(asset)
        if lens:
            raw["camera"]["lens"] = {"f_number": 1.0, "focus_distance": 1.0} | lens
        folder = write_scene(raw, {"ball": asset}, name=f"scene{next(count)}")
        with Player(folder, size=(size, size), context=ctx) as player:
            if distance is not None:
                player.camera = replace(
                    player.view,
                    position=np.array([0, raw["camera"]["position"][1], distance]),
                )
            return player.linear(0.0)[..., :3]

    return show


def lens_for(texels, asset, distance, focus):
    """The f-number at which the ball at `distance` blurs by so many texels."""
    one = optics.circle_of_confusion(distance, 0.05, 1.0, focus)
    return float(optics.texels(one, distance, 0.05, asset.metres_per_texel) / texels)


def test_a_ball_in_focus_is_as_sharp_as_without_a_lens(kit, shown):
    asset = kit.sphere_asset(size=SIZE)
    distance = asset.metres_per_texel * SIZE * 50 / 24
    sharp = shown(asset, None)
    focused = shown(asset, {"focus_distance": distance})
    np.testing.assert_array_equal(focused, sharp)


@pytest.mark.parametrize("level", [1, 2, 3])
def test_the_lens_reads_the_level_of_its_circle_of_confusion(kit, shown, level):
    # Levels of one colour each: red, then green, then blue, then white
    asset = kit.sphere_asset(size=SIZE, terms=1, packing="full")
    paint = np.array([[200, 0, 0], [0, 200, 0], [0, 0, 200], [200, 200, 200]])
    levels = [lv.copy() for lv in asset.levels]
    for n, lv in enumerate(levels):
        lv[..., :3] = paint[min(n, 3)] * (lv[..., 3:] > 0)
    asset = replace(asset, levels=tuple(levels), lens_scale=0.5, max_lod=5.0)
    distance = asset.metres_per_texel * SIZE * 50 / 24
    number = lens_for(2**level / asset.lens_scale, asset, distance, focus=0.8)
    found = shown(asset, {"f_number": number, "focus_distance": 0.8})[SIZE // 2, SIZE // 2]
    expected = paint[level] * asset.scales[0, :3]
    np.testing.assert_allclose(found / found.max(), expected / expected.max(), atol=0.01)


def test_the_hardware_level_is_not_counted_twice(kit, shown):
    asset = kit.sphere_asset(size=SIZE)
    # Four texels a pixel: hardware level 2; the lens asks for level 1 of itself
    far = 4 * asset.metres_per_texel * SIZE * 50 / 24
    number = lens_for(2 / asset.lens_scale, asset, far, focus=2.0)
    sharp = shown(asset, None, distance=far)
    blurred = shown(asset, {"f_number": number, "focus_distance": 2.0}, distance=far)
    np.testing.assert_array_equal(blurred, sharp)
    # Were the two added, this would be level 3
    wide = shown(asset, {"f_number": number / 4, "focus_distance": 2.0}, distance=far)
    assert np.abs(wide - sharp).max() > 0.05


def test_the_lens_never_asks_beyond_max_lod(kit, shown):
    asset = replace(kit.sphere_asset(size=SIZE), max_lod=2.0)
    pictures = [shown(asset, {"f_number": n, "focus_distance": 0.2}) for n in (0.5, 0.1)]
    np.testing.assert_array_equal(*pictures)


def test_crossing_a_level_changes_next_to_nothing(kit, shown):
    asset = kit.sphere_asset(size=SIZE)
    distance = asset.metres_per_texel * SIZE * 50 / 24
    number = lens_for(4 / asset.lens_scale, asset, distance, focus=0.8)
    below, above = (
        shown(asset, {"f_number": number * (1 + s * 0.5e-4), "focus_distance": 0.8})
        for s in (1, -1)
    )
    assert np.abs(below - above).max() < 1 / 255


def test_blur_keeps_the_light_of_the_ball(kit, shown):
    asset = kit.sphere_asset(size=SIZE)
    distance = asset.metres_per_texel * SIZE * 50 / 24
    sharp = shown(asset, None).sum()
    number = lens_for(4 / asset.lens_scale, asset, distance, focus=0.8)
    blurred = shown(asset, {"f_number": number, "focus_distance": 0.8}).sum()
    # Codes of 8 bits and the reconstruction of level 2 between its texels
    assert blurred == pytest.approx(sharp, rel=0.01)


def test_a_blurred_foot_is_not_cut_hard_by_the_ground(kit, write_scene, ctx):
    asset = kit.sphere_asset(size=SIZE)
    raw = kit.scene_dict(ground={"albedo": [0, 0, 0]}, lights=[])
    raw["lights"] = [{"type": "sun", "to_light": [0, 0.5, 1], "irradiance": [3, 3, 3]}]
    raw["camera"] |= {
        "position": [0, 1.5, 4],
        "lens": {"f_number": 0.3, "focus_distance": 1.0},
    }
    with Player(write_scene(raw, {"ball": asset}), size=(SIZE, SIZE), context=ctx) as player:
        column = player.linear(0.0)[:, SIZE // 2, 0]
    lit = np.flatnonzero(column > 1e-3)
    below = column[lit[-1]]
    # The last lit row fades out; a hard cut would end at a good part of the maximum
    assert below < 0.1 * column.max()


def test_the_lens_moves_with_the_camera_override(kit, write_scene, ctx):
    asset = kit.sphere_asset(size=SIZE)
    raw = kit.texel_to_pixel(asset)
    raw["camera"]["lens"] = {"f_number": 1.0, "focus_distance": 0.5}
    with Player(write_scene(raw, {"ball": asset}), size=(SIZE, SIZE), context=ctx) as player:
        blurred = player.linear(0.0)
        own = player.view
        distance = float(own.position[2])
        player.camera = Camera(own.position, own.target, f_number=1.0, focus_distance=distance)
        assert np.abs(player.linear(0.0) - blurred).max() > 0.1
