"""A real window under a virtual display: real keys, mouse and edits, judged by screenshots."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from formats.files import image
from pipelines import current
from pipelines.bake_scene import bake_scene
from runtime import gui
from runtime.player import Player
from tests.pipelines.desk import desk, wait_until

pytestmark = [
    pytest.mark.gpu,
    pytest.mark.slow,
]
ROOT = Path(__file__).resolve().parents[2]
GALLERY = sorted(path.stem for path in (ROOT / "assets/scenes").glob("*.toml"))
MORE = """
[ground]
albedo = [0.3, 0.3, 0.3]
[[meshes]]
name = "house"
source = "meshes/tent.glb"
position = [1.5, 0, -1]
"""
FILM = "film = { exposure = 0.0 }\n"


class Stage:
    """A scene of its own, and a copy of runtime whose shaders may be edited."""

    def __init__(self, folder: Path, assets: Path) -> None:
        self.cwd, self.build = folder / "code", folder / "build"
        self.scene = assets / "scenes/stage.toml"
        self.shader = self.cwd / "runtime/passes/film.frag"
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / "runtime", self.cwd / "runtime", ignore=ignored)
        text = (assets / "scenes/all.toml").read_text()
        # Bloom adds some light everywhere: what moves is seen in every part of the picture
        self.scene.write_text(text.replace("[picture]", MORE + "[picture]") + FILM)
        bake_scene(self.scene, build_folder=self.build)


@pytest.fixture(scope="module")
def screen():
    with desk() as made:
        yield made


@pytest.fixture(scope="module")
def stage(tmp_path_factory, writing_assets):
    folder = tmp_path_factory.mktemp("window")
    return Stage(folder, writing_assets(folder / "assets"))


@pytest.fixture(scope="module")
def open_window(screen, stage):
    """The window that most tests share: opening one takes seconds."""
    with screen.window(stage.scene, stage.build, stage.cwd) as seen:
        seen.wait("drawn")
        yield seen


@pytest.fixture
def seen(open_window):
    """That window, at the scene's own view, with its panel."""
    with open_window.drawing():
        open_window.key("0")
    return open_window


def off(a, b):
    """Mean difference in codes."""
    assert a.shape == b.shape
    return np.abs(a - b).mean()


def test_it_shows_the_picture_that_p_writes(seen, stage):
    count = len(seen.events)
    seen.key("p")
    said = seen.wait("said", count, text=lambda text: text.startswith("picture "))
    written = Path(stage.cwd / said["text"].removeprefix("picture "))
    expected = np.rint(255 * image.read(written, space="stored"))
    seen.wait("drawn", said["number"])
    shown = seen.picture()
    np.testing.assert_array_equal(shown, expected[: len(shown)])
    # The same as without a window, but for how GLX and EGL round
    size = expected.shape[1::-1]
    with Player(stage.build / "scenes/stage", size=size, roaming=True) as player:
        assert np.abs(player.frame(0.0)[..., :3] - expected).max() <= 1
    assert expected.std() > 10


def test_a_drag_on_the_picture_orbits_and_0_goes_back(seen):
    before = seen.picture()
    with seen.drawing():
        seen.drag((100, 100), (160, 110))
    assert off(seen.picture(), before) > 2
    with seen.drawing():
        seen.key("0")
    np.testing.assert_array_equal(seen.picture(), before)


@pytest.mark.parametrize("hands", ["wheel", "pan", "look", "f"])
def test_other_hands_move_it_too(seen, hands):
    before = seen.picture()
    with seen.drawing():
        if hands == "wheel":
            seen.move(100, 100)
            seen.hand("click", 4)
        elif hands == "pan":
            seen.drag((100, 100), (140, 110), button=2)
        elif hands == "look":
            seen.drag((100, 100), (140, 110), button=3)
        else:
            seen.key("f")
    assert off(seen.picture(), before) > 1
    with seen.drawing():
        seen.key("0")


def test_space_plays_and_pauses(seen):
    count, seconds = len(seen.events), set()
    seen.key("space")
    # The panel shows how time passes
    wait_until(lambda: seconds.add(seen.shot()[:80, -300:].tobytes()) or len(seconds) > 5, "stands")
    with seen.drawing(time=lambda time: time > 0):
        seen.key("space")
    assert [e for e in seen.events[count:] if e["event"] == "drawn"][-1]["frames"] > 5
    with seen.drawing(time=0.0):
        seen.key("Home")


def test_h_gives_the_whole_window_to_the_picture(seen):
    width, height = seen.size
    panel = seen.shot()[:, -300:]
    with seen.drawing(size=[width, height]):
        seen.key("h")
    assert off(seen.shot()[:, -300:], panel) > 10
    with seen.drawing(size=lambda size: size[0] < width):
        seen.key("h")
    # But for the number of milliseconds
    assert off(seen.shot()[60:, -300:], panel[60:]) < 2


def test_a_click_on_a_light_turns_it_off(seen):
    before = seen.picture()
    left = before.shape[1]
    # The first check mark from the top of the panel
    mark = np.abs(seen.shot()[:, left : left + 60] - 255 * np.array(gui.ACCENT)).max(axis=-1) < 24
    row, column = np.argwhere(mark)[len(np.argwhere(mark[: np.argwhere(mark)[0, 0] + 6])) // 2]
    with seen.drawing():
        seen.click(left + column, row)
    dark = seen.picture()
    assert before.mean() - dark.mean() > 3
    with seen.drawing():
        seen.click(left + column, row)
    np.testing.assert_array_equal(seen.picture(), before)


def test_it_survives_a_size_of_one_pixel(seen):
    before, (width, height) = seen.picture(), seen.size
    for size in ((1, 1), (700, 1), (1, 300)):
        with seen.drawing():
            seen.hand("windowsize", seen.id, *size)
    with seen.drawing(size=[before.shape[1], height]):
        seen.hand("windowsize", seen.id, width, height)
    np.testing.assert_array_equal(seen.picture(), before)


def test_it_survives_being_minimised(seen):
    before = seen.picture()
    seen.hand("windowminimize", "--sync", seen.id)
    # openbox takes the focus away after that; the key is then nobody's
    wait_until(lambda: seen.hand("getwindowfocus") != seen.id, "it keeps the focus")
    seen.key("space")
    with seen.drawing():
        seen.hand("windowmap", "--sync", seen.id)
        seen.hand("windowactivate", "--sync", seen.id)
    np.testing.assert_array_equal(seen.picture(), before)


def banner(shot):
    """Share of the first rows that has the colour of a warning."""
    colour = 255 * np.array(gui.WARNING)
    return (np.abs(shot[4:20] - colour).max(axis=-1) < 40).mean()


def test_a_broken_shader_is_told_and_the_picture_stays(seen, stage):
    before, good, count = seen.picture(), stage.shader.read_text(), len(seen.events)
    rest = slice(120, None)
    stage.shader.write_text(good.replace("vec3 encoded = ", "vec3 encoded = wrong * "))
    said = seen.wait("error", count)
    assert said["text"].startswith("film.frag:30: ")
    wait_until(lambda: banner(seen.picture()) > 0.5, "no banner")
    np.testing.assert_array_equal(seen.picture()[rest], before[rest])
    # Hands work on
    with seen.drawing():
        seen.drag((100, 150), (160, 160))
    assert off(seen.picture()[rest], before[rest]) > 1
    with seen.drawing():
        seen.key("0")
    count = len(seen.events)
    stage.shader.write_text(good.replace("exposure;\n    vec2", "exposure * 0.25;\n    vec2"))
    seen.wait("error", count, text=None)
    seen.wait("drawn", seen.wait("reloaded", count)["number"])
    wait_until(lambda: banner(seen.picture()) == 0, "the banner stays")
    assert before.mean() - seen.picture().mean() > 10
    count = len(seen.events)
    stage.shader.write_text(good)
    seen.wait("drawn", seen.wait("reloaded", count)["number"])
    np.testing.assert_array_equal(seen.picture(), before)


def test_a_broken_scene_is_told_and_a_mended_one_is_baked_and_shown(seen, stage):
    good, rest = stage.scene.read_text(), slice(120, None)
    with seen.drawing():
        seen.drag((100, 100), (130, 110))
    before, count = seen.picture(), len(seen.events)
    stage.scene.write_text(good.replace("height = 1.0", 'height = "tall"'))
    said = seen.wait("error", count)
    for word in ("stage.toml", "billboards[0].height", "tall"):
        assert word in said["text"]
    wait_until(lambda: banner(seen.picture()) > 0.5, "no banner")
    np.testing.assert_array_equal(seen.picture()[rest], before[rest])
    # A knob of the picture, and a sprite of another size, in one edit
    count = len(seen.events)
    mended = good.replace("exposure = 0.0", "exposure = 1.5").replace("[0, 0, 0]", "[0.4, 0, 0]")
    stage.scene.write_text(mended)
    seen.wait("error", count, text=None)
    seen.wait("drawn", seen.wait("reloaded", count)["number"])
    wait_until(lambda: banner(seen.picture()) == 0, "the banner stays")
    assert seen.picture().mean() - before.mean() > 10
    # Back: the camera is still where hands have put it
    count = len(seen.events)
    stage.scene.write_text(good)
    seen.wait("drawn", seen.wait("reloaded", count)["number"])
    np.testing.assert_array_equal(seen.picture(), before)


def test_r_reads_the_scene_again(seen):
    before, count = seen.picture(), len(seen.events)
    seen.key("r")
    seen.wait("drawn", seen.wait("reloaded", count)["number"])
    np.testing.assert_array_equal(seen.picture(), before)


def test_the_truth_comes_up_beside_the_live_picture(seen):
    before = seen.picture()
    half = before.shape[1] // 2
    seen.key("Tab")
    # Coarse at first; what is right of the line stays live, if coarse too while machines are busy
    right = (slice(80, None), slice(half + 40, None))
    left = (slice(80, None), slice(0, half - 40))

    def traced():
        shots.append(seen.picture())
        same = np.array_equal(shots[-1][right], before[right])
        return same and off(shots[-1][left], before[left]) > 0.5

    shots: list[np.ndarray] = []
    wait_until(traced, "no traced picture")
    shot = shots[-1]
    # The same scene: about as bright
    assert shot[left].mean() == pytest.approx(before[left].mean(), rel=0.25)
    seen.key("Tab")


def test_a_picture_that_cannot_be_written_is_told_in_a_line(seen, stage):
    folder, count = stage.build / "renders", len(seen.events)
    aside = folder.rename(folder.with_name("aside"))
    folder.write_text("no folder")
    seen.key("p")
    said = seen.wait("error", count)["text"]
    assert str(folder) in said
    assert "\n" not in said
    wait_until(lambda: banner(seen.picture()) > 0.5, "no banner")
    folder.unlink()
    aside.rename(folder)
    seen.key("0")
    seen.wait("error", count, text=None)
    wait_until(lambda: banner(seen.picture()) == 0, "the banner stays")


def interrupted(seen):
    seen.interrupt()
    code, said = seen.end()
    assert code == 130
    assert said.strip() == "bakelight: interrupted; what was finished is kept"


def test_ctrl_c_ends_it_when_a_key_has_just_gone_down(screen, stage):
    # It meets the window inside a callback, where exceptions get lost
    with screen.window(stage.scene, stage.build, stage.cwd) as seen:
        seen.wait("drawn")
        seen.key("r")
        interrupted(seen)


def test_ctrl_c_ends_it_while_a_bake_runs(seen):
    # The last test of the window that they share
    count = len(seen.events)
    seen.key("r")
    seen.wait("baking", count)
    interrupted(seen)


@contextmanager
def opened(screen, baked):
    """A window on a baked scene; skipped where code of another day baked what is no asset now."""
    with ExitStack() as stack:
        try:
            seen = stack.enter_context(screen.baked(baked, baked.name))
        except AssertionError as error:
            older = json.loads((baked / "manifest.json").read_text())["code"] != current.code()
            if not older or "bake it again" not in str(error):
                raise
            pytest.skip(f"{baked.name} was baked by older code: bakelight bake")
        yield seen


@pytest.mark.parametrize("name", GALLERY)
def test_each_gallery_scene_opens_and_answers(screen, name):
    baked = ROOT / "build/scenes" / name
    if not baked.is_dir():
        pytest.skip(f"{name} is not baked: bakelight bake assets/scenes/{name}.toml")
    with opened(screen, baked) as seen:
        # There is something to see beside the panel
        before = seen.picture()
        assert before.std() > 8
        assert len(np.unique(before // 16)) > 4
        # Light may go on settling for long, by less than that
        seen.drag((100, 60), (240, 70))
        wait_until(lambda: off(seen.picture(), before) > 4, "a drag does nothing")
        seen.key("alt+F4" if name == GALLERY[0] else "Escape")
        assert seen.end() == (0, "")
        assert seen.events[-1]["event"] == "closed"


def test_without_a_display_it_is_one_line(stage):
    quiet = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "pipelines.cli", "view", str(stage.scene), "--json"]
    command += ["--build", str(stage.build)]
    done = subprocess.run(command, cwd=stage.cwd, env=quiet, capture_output=True, text=True)
    assert done.returncode == 3
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "bakelight render" in done.stderr
    assert not json.loads(done.stdout or "{}")
