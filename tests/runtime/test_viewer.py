"""The viewer: what hands do to its state."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.errors import MachineError
from formats.files import image
from formats.keyed import Keyed
from runtime import orbit, subject
from runtime.camera import Camera
from runtime.edits import Edits
from runtime.player import Player
from runtime.viewer import HELP, Viewer

pytestmark = pytest.mark.gpu
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def scene_folder(kit, write_scene):
    """A ball with a lens on a ground under a sky, twelve seconds long."""
    camera = {"position": [0, 1, 4], "target": [0, 0.5, 0], "focal_length_mm": 50}
    raw = kit.scene_dict(
        camera={**camera, "lens": {"f_number": 1.4, "focus_distance": 9.0}},
        time={"duration": 12.0, "frame_rate": 24},
        ground={"albedo": [0.2, 0.2, 0.2]},
        picture={"sky": {"zenith": [0.1, 0.2, 0.4], "horizon": [0.5, 0.5, 0.5]}},
    )
    return write_scene(raw, {"ball": kit.sphere_asset()})


@pytest.fixture
def viewer(scene_folder, ctx, tmp_path):
    """A viewer without a window; `viewer.said` lists its messages."""
    said: list[str] = []
    with Player(scene_folder, size=(96, 54), context=ctx) as player:
        made = Viewer(player, tmp_path / "pictures", said.append)
        made.said = said
        yield made


def drag(viewer, button, dx, dy, **how):
    viewer.cursor(10.0, 10.0)
    viewer.button(button)
    viewer.cursor(10.0 + dx, 10.0 + dy, **how)
    viewer.release(button)


def test_left_drag_orbits_at_the_same_distance(viewer):
    before = viewer.camera
    drag(viewer, "left", 30.0, 10.0)
    after = viewer.camera
    np.testing.assert_array_equal(after.target, before.target)
    distance = np.linalg.norm(before.position - before.target)
    assert np.linalg.norm(after.position - after.target) == pytest.approx(distance, rel=1e-12)
    assert after.position[0] < before.position[0]
    assert after.position[1] > before.position[1]


@pytest.mark.parametrize(("button", "shift"), [("middle", False), ("left", True)])
def test_pan_moves_what_is_under_the_cursor_with_it(viewer, button, shift):
    before = viewer.camera
    drag(viewer, button, 54.0, 0.0, shift=shift)
    after = viewer.camera
    # A whole picture height at the target's distance
    metres = np.linalg.norm(before.position - before.target) * 0.024 / 0.05
    np.testing.assert_allclose(after.target, before.target - metres * before.right, atol=1e-12)
    np.testing.assert_allclose(
        after.position - after.target, before.position - before.target, atol=1e-12
    )


def test_the_wheel_never_goes_through_the_target(viewer):
    viewer.wheel(500.0)
    assert np.linalg.norm(viewer.camera.position - viewer.camera.target) == pytest.approx(
        orbit.NEAREST
    )
    viewer.wheel(-2000.0)
    assert np.linalg.norm(viewer.camera.position - viewer.camera.target) == pytest.approx(
        orbit.FARTHEST
    )


def test_orbit_stops_short_of_the_pole():
    camera = Camera(np.array([0.0, 0, 4]), np.zeros(3))
    up = orbit.orbit(camera, 0.0, 10.0)
    assert np.degrees(np.arcsin(up.position[1] / 4)) == pytest.approx(89.0)
    assert np.isfinite(up.view_from_world).all()


def test_time_plays_scrubs_and_wraps(viewer):
    viewer.advance(1.0)
    assert viewer.time == 0.0
    viewer.key("space")
    viewer.advance(1.5)
    assert viewer.time == 1.5
    viewer.key("right_arrow")
    assert viewer.time == pytest.approx(1.5 + 1 / 24)
    viewer.key("left_arrow", shift=True)
    viewer.key("left_arrow", shift=True)
    assert viewer.time == pytest.approx(11.5 + 1 / 24)
    viewer.key("home")
    assert viewer.time == 0.0


def test_the_sun_turns_by_keys_and_by_drag_with_l(viewer):
    viewer.key("]")
    viewer.key("-")
    assert np.degrees(viewer.player.sun_turn) == pytest.approx((5, -5))
    camera = viewer.camera
    viewer.key("l")
    drag(viewer, "left", 20.0, 0.0)
    assert viewer.player.sun_turn[0] > np.radians(5)
    np.testing.assert_array_equal(viewer.camera.position, camera.position)
    viewer.key("0")
    assert viewer.player.sun_turn == (0.0, 0.0)


def test_right_drag_looks_round_from_the_same_place(viewer):
    before = viewer.camera
    drag(viewer, "right", 30.0, 0.0)
    after = viewer.camera
    np.testing.assert_allclose(after.position, before.position, atol=1e-12)
    turned = np.arccos(np.clip(after.forward @ before.forward, -1, 1))
    # Turned about +y by 0.006 rad a pixel: a little less as seen along a sloping axis
    level = np.hypot(*before.forward[[0, 2]])
    assert turned == pytest.approx(2 * np.arcsin(level * np.sin(0.5 * 30 * 0.006)), rel=1e-9)
    # Dragging to the right turns to the right
    assert after.forward @ before.right > 0


def test_keys_fly_while_they_are_held(viewer):
    before = viewer.camera
    viewer.key("w")
    assert viewer.moving
    viewer.advance(0.5)
    viewer.release("w")
    viewer.advance(0.5)
    distance = np.linalg.norm(before.position - before.target)
    expected = before.position + 0.5 * 0.7 * distance * before.forward
    np.testing.assert_allclose(viewer.camera.position, expected, atol=1e-12)
    viewer.key("left_shift")
    viewer.key("d")
    viewer.key("a")
    viewer.advance(1.0)
    np.testing.assert_allclose(viewer.camera.position, expected, atol=1e-12)
    viewer.let_go()
    assert not viewer.moving


def test_the_whole_ball_is_framed_from_the_same_side(viewer):
    before = viewer.camera
    viewer.key("f")
    after = viewer.camera
    np.testing.assert_allclose(after.forward, before.forward, atol=1e-12)
    sprites = viewer.player.sprites[0]
    wide, high = sprites.crown * sprites.scale[0], sprites.asset.height * sprites.scale[0]
    assert np.linalg.norm(after.target - [0, 0.5 * high, 0]) < 0.05 * high
    assert after.focus_distance == pytest.approx(np.linalg.norm(after.target - after.position))
    corners = np.array([[x, y, 0] for x in (-wide, wide) for y in (0.0, high)])
    shown = places(after, corners, viewer.size)
    # Up to the margin, and no more room than that
    np.testing.assert_allclose(np.abs(shown).max(), 1 / orbit.MARGIN, atol=1e-9)
    np.testing.assert_allclose(shown[:, 1].max(), -shown[:, 1].min(), atol=1e-9)


def places(camera, points, size):
    """Where points (n, 3) are in the picture, -1..1 (n, 2)."""
    clip = np.c_[points, np.ones(len(points))] @ camera.clip_from_world(size[0] / size[1]).T
    return clip[:, :2] / clip[:, 3:]


def test_points_in_depth_are_framed_as_near_as_may_be():
    camera = Camera(np.array([1.0, 3.0, 5.0]), np.zeros(3))
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3)) * [3, 1, 8]
    framed = orbit.frame(camera, points, 1.5)
    np.testing.assert_allclose(framed.forward, camera.forward, atol=1e-12)
    assert np.abs(places(framed, points, (300, 200))).max() == pytest.approx(1 / orbit.MARGIN)
    nearer = replace(framed, position=framed.position + 0.01 * framed.forward)
    assert np.abs(places(nearer, points, (300, 200))).max() > 1 / orbit.MARGIN
    # A single point is not met by the camera
    alone = orbit.frame(camera, points[:1], 1.5)
    np.testing.assert_allclose(alone.depth(points[:1]), orbit.NEAREST)


def test_the_outermost_of_many_sprites_are_no_subject(viewer):
    sprites = viewer.player.sprites[0]
    sprites.positions = np.random.default_rng(2).uniform(-2, 2, (40, 3)) * [1, 0, 1]
    sprites.scale = np.ones(40)
    viewer.player.look(0.0)
    before = subject.points(viewer.player, 0.0)
    assert before.shape == (4 * 36, 3)
    sprites.positions[[3, 9]] *= 100
    assert np.abs(subject.points(viewer.player, 0.0)).max() < 5


def test_a_picture_that_cannot_be_written_is_told_until_the_next_key(viewer):
    viewer.pictures.write_text("no folder")
    viewer.key("p")
    assert str(viewer.pictures) in viewer.failed
    assert "\n" not in viewer.failed
    assert viewer.said == []
    viewer.key("space")
    assert viewer.failed is None


def test_what_is_under_the_cursor_is_found_where_the_camera_is_now(viewer):
    viewer.player.draw(0.0)
    viewer.changed = False
    viewer.cursor(48.0, 27.0)
    viewer.key("c")
    before = viewer.camera.focus_distance
    viewer.wheel(5.0)
    viewer.key("c")
    assert viewer.camera.focus_distance < 0.8 * before


def test_focus_finds_the_ball_under_the_cursor(viewer):
    viewer.player.draw(0.0)
    viewer.cursor(48.0, 27.0)
    viewer.key("c")
    # The sprite stands in the vertical plane through the origin that faces the camera
    expected = 4.0 * np.hypot(4, 0.5) / 4
    camera = viewer.camera
    # The middle of the pixel lies half a pixel of 54 off the axis
    assert camera.focus_distance == pytest.approx(expected, rel=2e-3)
    np.testing.assert_allclose(camera.forward, viewer.player.view.forward, atol=1e-12)
    distance = np.linalg.norm(camera.target - camera.position)
    assert distance == pytest.approx(camera.focus_distance)
    viewer.key(".")
    assert viewer.camera.focus_distance == pytest.approx(1.05 * camera.focus_distance)
    viewer.key(",")
    assert viewer.camera.focus_distance == pytest.approx(camera.focus_distance)


def test_focus_reads_the_ground_beside_the_ball(viewer):
    viewer.camera = Camera(
        np.array([3.0, 1, 4]), np.array([3.0, 0, 0]), f_number=1.4, focus_distance=2.0
    )
    viewer.player.draw(0.0)
    viewer.cursor(20.0, 40.0)
    viewer.double_click()
    across = np.array([2 * 20.5 / 96 - 1, 1 - 2 * 40.5 / 54, 1.0])
    ray = viewer.player.view.world_from_ray(96 / 54) @ across
    # Depth has 24 bits: at 3 m steps of z^2 / near / 2^24, some 5e-6 m
    assert viewer.camera.focus_distance == pytest.approx(-1.0 / ray[1], rel=1e-4)


def test_nothing_lies_under_a_cursor_on_the_sky(viewer):
    viewer.player.draw(0.0)
    viewer.cursor(2.0, 2.0)
    before = viewer.camera
    viewer.key("c")
    assert viewer.said == ["there is nothing under the cursor"]
    np.testing.assert_array_equal(viewer.camera.target, before.target)


def test_without_a_lens_focus_says_so(kit, write_scene, ctx, tmp_path):
    folder = write_scene(kit.scene_dict(), {"ball": kit.sphere_asset()})
    said: list[str] = []
    with Player(folder, size=(32, 18), context=ctx) as player:
        Viewer(player, tmp_path, said.append).key(".")
    assert said == ["this scene calls for no lens: add camera.lens and bake it again"]


def test_edits_reach_the_picture_and_undo_leaves_no_trace(viewer):
    before = viewer.player.frame(0.0)
    viewer.edit(viewer.edits.value("film.exposure", Keyed.hold(-2.0)))
    viewer.changed = False
    darker = viewer.player.frame(0.0)
    assert darker.mean() < 0.7 * before.mean()
    viewer.edit(Edits())
    assert viewer.changed
    np.testing.assert_array_equal(viewer.player.frame(0.0), before)


def test_edits_go_over_to_another_player(viewer, scene_folder, ctx):
    viewer.edit(viewer.edits.show("billboard/ball", False))
    hidden = viewer.player.frame(0.0)
    with Player(scene_folder, size=(96, 54), context=ctx) as other:
        viewer.take(other)
        np.testing.assert_array_equal(other.frame(0.0), hidden)
        viewer.edit(Edits())
        assert np.abs(other.frame(0.0).astype(int) - hidden).max() > 30


def test_screenshots_are_the_frame_and_never_overwrite(viewer):
    first, second = viewer.screenshot(), viewer.screenshot()
    assert [first.name, second.name] == ["scene-0001.png", "scene-0002.png"]
    found = image.read(first, space="stored")
    np.testing.assert_array_equal(np.rint(found * 255), viewer.player.frame(0.0)[..., :3])


def test_a_picture_is_whole_though_a_coarse_one_is_shown(viewer):
    viewer.player.targets.resize((24, 13))
    path = viewer.screenshot()
    assert image.read(path, space="stored").shape == (54, 96, 3)


def test_radiance_goes_to_who_writes_it(viewer):
    viewer.key("p", shift=True)
    assert "EXR" in viewer.said[-1]
    written = []
    viewer._write_exr = lambda path, radiance: written.append((path.name, radiance))
    viewer.key("p", shift=True)
    name, radiance = written[0]
    assert name == "scene-0001.exr"
    np.testing.assert_array_equal(radiance, viewer.player.linear(0.0)[..., :3])


def test_keys_of_the_window_toggle_and_quit(viewer):
    viewer.key("h")
    assert not viewer.panel
    viewer.key("f1")
    assert viewer.helping
    viewer.key("escape")
    assert not viewer.helping
    assert not viewer.quitting
    viewer.key("escape")
    assert viewer.quitting


def test_reload_says_where_there_is_nothing_to_read(viewer):
    viewer.key("r")
    assert "scene file" in viewer.said[-1]


def test_help_names_every_key(viewer):
    named = " ".join(keys for keys, _ in HELP).lower()
    names = {"left_arrow": "left", "right_arrow": "right", "escape": "esc"}
    assert all(names.get(key, key) in named for key in viewer._actions(False))


def test_a_machine_without_a_display_gets_one_line(scene_folder):
    pytest.importorskip("glfw")
    pytest.importorskip("imgui_bundle")
    code = f"from runtime.window import view; view({str(scene_folder)!r})"
    quiet = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=quiet, capture_output=True, text=True
    )
    assert MachineError.__name__ in done.stderr
    assert "bakelight render" in done.stderr.splitlines()[-1]


def test_a_machine_without_imgui_gets_one_line(scene_folder):
    code = (
        "import sys; sys.modules['imgui_bundle'] = None\n"
        f"from runtime.window import view; view({str(scene_folder)!r})"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert "imgui-bundle: not installed" in done.stderr.splitlines()[-1]


# a real window
