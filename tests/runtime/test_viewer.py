"""The viewer: what hands do to its state, and a real window under a virtual display."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from formats.errors import MachineError
from formats.files import image
from runtime import orbit
from runtime.camera import Camera
from runtime.player import Player
from runtime.viewer import Viewer

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
    viewer.key("r")
    assert viewer.player.sun_turn == (0.0, 0.0)


def test_focus_finds_the_ball_in_the_middle(viewer):
    viewer.key("f")
    # The sprite stands in the vertical plane through the origin that faces the camera
    camera = viewer.camera
    expected = 4.0 * np.hypot(4, 0.5) / 4
    assert camera.focus_distance == pytest.approx(expected, rel=1e-9)
    viewer.key(".")
    assert viewer.camera.focus_distance == pytest.approx(1.05 * expected)
    viewer.key(",")
    assert viewer.camera.focus_distance == pytest.approx(expected)


def test_focus_falls_to_the_ground_beside_the_ball(viewer):
    viewer.camera = Camera(
        np.array([3.0, 1, 4]), np.array([3.0, 0, 0]), f_number=1.4, focus_distance=2.0
    )
    viewer.key("f")
    assert viewer.camera.focus_distance == pytest.approx(np.hypot(4, 1))


def test_without_a_lens_focus_says_so(kit, write_scene, ctx, tmp_path):
    folder = write_scene(kit.scene_dict(), {"ball": kit.sphere_asset()})
    said: list[str] = []
    with Player(folder, size=(32, 18), context=ctx) as player:
        Viewer(player, tmp_path, said.append).key("f")
    assert said == ["this scene calls for no lens: add camera.lens and bake it again"]


def test_screenshots_are_the_frame_and_never_overwrite(viewer):
    first, second = viewer.screenshot(), viewer.screenshot()
    assert [first.name, second.name] == ["scene-0001.png", "scene-0002.png"]
    found = image.read(first, space="stored")
    np.testing.assert_array_equal(np.rint(found * 255), viewer.player.frame(0.0)[..., :3])


def test_help_names_every_key(viewer):
    viewer.key("h")
    assert all(
        word in viewer.said[0] for word in ("orbit", "pan", "dolly", "L", "[", "F", "R", "P", "Esc")
    )


def test_a_machine_without_a_display_gets_one_line(scene_folder):
    pytest.importorskip("glfw")
    code = f"from runtime.viewer import view; view({str(scene_folder)!r})"
    quiet = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=quiet, capture_output=True, text=True
    )
    assert MachineError.__name__ in done.stderr
    assert "bakelight render" in done.stderr.splitlines()[-1]


# a real window


@pytest.fixture
def display(tmp_path):
    """The name of a virtual X display."""
    if not shutil.which("Xvfb") or not shutil.which("xdotool"):
        pytest.skip("Xvfb or xdotool is not installed")
    pytest.importorskip("glfw")
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "640x480x24"],
        pass_fds=(write,),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as stream:
        name = ":" + stream.readline().strip()
    yield name
    server.terminate()
    server.wait(timeout=10)


def wait_for(condition, seconds=30.0):
    """Poll until a condition holds; fail after a while."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "the window did not answer in time"
        time.sleep(0.05)


def test_a_window_shows_the_headless_frame_and_obeys_keys_and_mouse(
    scene_folder, display, ctx, tmp_path
):
    pictures = tmp_path / "shots"
    code = (
        "from runtime.viewer import view\n"
        f"view({str(scene_folder)!r}, size=(160, 90), pictures={str(pictures)!r})"
    )
    env = {k: v for k, v in os.environ.items() if k != "WAYLAND_DISPLAY"} | {"DISPLAY": display}
    log = tmp_path / "log"
    with log.open("w") as out:
        window = subprocess.Popen(
            [sys.executable, "-c", code], cwd=ROOT, env=env, stdout=out, stderr=out
        )

    def hand(*words):
        subprocess.run(["xdotool", *words], env=env, check=True, capture_output=True)

    def shot(number):
        path = pictures / f"scene-{number:04}.png"
        wait_for(lambda: f"{path}\n" in log.read_text() or window.poll() is not None)
        assert window.poll() is None, log.read_text()
        return np.rint(image.read(path, space="stored") * 255)

    try:
        wait_for(lambda: "Esc quit" in log.read_text() or window.poll() is not None)
        assert window.poll() is None, log.read_text()
        hand("mousemove", "80", "45")
        hand("key", "p")
        with Player(scene_folder, size=(160, 90), context=ctx) as player:
            expected = player.frame(0.0)[..., :3]
        # One code: GLX and EGL may round the tone curve differently
        assert np.abs(shot(1) - expected).max() <= 1
        hand("mousemove", "80", "45", "mousedown", "1", "mousemove", "110", "45", "mouseup", "1")
        hand("key", "p")
        assert np.abs(shot(2) - expected).max() > 10
        hand("key", "Escape")
        assert window.wait(timeout=20) == 0
    finally:
        window.kill()
        window.wait(timeout=10)
