"""A player that follows its files: edits are taken, broken ones are told and change nothing."""

from __future__ import annotations

import ctypes
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.errors import InputError
from runtime import capture, live, shader
from runtime.camera import Camera
from runtime.live import Live, Step
from runtime.passes import film, fog, sky
from runtime.player import Player
from tests.runtime.gl_objects import counted

pytestmark = pytest.mark.gpu


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Bench:
    """A tiny scene whose shaders are copies that a test may edit. baking : the latest Rebuild."""

    def __init__(self, folder, shaders, ctx, source):
        self.clock, self.shaders, self.source = Clock(), shaders, source
        self.bakes: list[Baking] = []

        def make(place: Path) -> Player:
            return Player(place, size=(48, 32), context=ctx, roaming=True)

        def rebuild():
            self.bakes.append(Baking())
            return self.bakes[-1]

        self.live = Live(
            make,
            folder,
            watched=lambda: [source],
            rebuild=rebuild,
            shaders=shaders,
            clock=self.clock,
        )

    def wait(self, seconds=1.0):
        """Poll as a window does for some seconds; return whether anything to show changed."""
        changed = False
        for _ in range(round(seconds / 0.05)):
            self.clock.now += 0.05
            changed |= self.live.poll()
        return changed

    def edit(self, name, old, new):
        file = self.shaders / name
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new))

    def picture(self):
        return self.live.player.frame(0.0)


class Baking:
    """A bake that a test moves on by hand."""

    def __init__(self):
        self.step, self.closed = Step(busy="baking billboard/ball 40 %"), False

    def poll(self):
        return self.step

    def close(self):
        self.closed = True


@pytest.fixture
def bench(kit, write_scene, ctx, tmp_path, monkeypatch):
    shaders = tmp_path / "shaders"
    shutil.copytree(shader.GLSL, shaders / "glsl")
    (shaders / "passes").mkdir()
    for module in (film, fog, sky):
        for file in module.HERE.glob(f"{module.__name__.split('.')[-1]}.frag"):
            shutil.copy(file, shaders / "passes")
        monkeypatch.setattr(module, "HERE", shaders / "passes")
    monkeypatch.setattr(shader, "GLSL", shaders / "glsl")
    shader.forget()
    raw = kit.scene_dict(
        picture={
            "sky": {"zenith": [0.1, 0.2, 0.4], "horizon": [0.5, 0.5, 0.5]},
            "fog": {"extinction": 0.1, "radiance": [0.5, 0.5, 0.5]},
        }
    )
    folder = write_scene(raw, {"ball": kit.sphere_asset(size=16)})
    source = tmp_path / "scene.toml"
    source.write_text("first")
    made = Bench(folder, shaders, ctx, source)
    yield made
    made.live.close()
    monkeypatch.undo()
    shader.forget()


NOBODY = "float nobody(float x);\nvoid main() { if (nobody(screen.x) > 2.0) discard;"
LONGER = "uniform vec3 half_size;\n#define half_size half_size.xy"
RED = "picture = vec4(", "picture = vec4(1.0, 0.0, 0.0, 1.0) + 0.0 * vec4("


def test_an_edit_of_a_shader_is_taken_and_what_hands_did_is_kept(bench):
    player, before = bench.live.player, bench.picture()
    player.camera = replace(Camera.of_scene(player.scene, 0.0), focal_length=0.04)
    player.sun_turn = (0.2, 0.1)
    player.targets.resize((64, 40))
    camera = player.camera
    bench.edit("passes/film.frag", *RED)
    assert bench.wait()
    after = bench.live.player
    assert after is not player
    assert (after.camera, after.sun_turn, after.targets.size) == (camera, (0.2, 0.1), (64, 40))
    assert (bench.picture()[..., :3] == (255, 0, 0)).all()
    assert not (before[..., :3] == (255, 0, 0)).all()
    assert bench.live.error is None
    assert not bench.wait()


def test_an_edit_of_a_library_reaches_the_pass_that_includes_it(bench):
    before = bench.picture()
    old = "return mix(zenith, horizon"
    bench.edit("glsl/sky.glsl", old, "return 0.0 * mix(zenith, horizon")
    bench.wait()
    assert bench.picture().mean() < before.mean() - 5
    bench.edit("glsl/sky.glsl", "return 0.0 * mix", "return mix")
    bench.wait()
    np.testing.assert_array_equal(bench.picture(), before)


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("passes/film.frag", "vec3 encoded = ", "vec3 encoded = wrong * ", "film.frag:30: "),
        ("glsl/sky.glsl", "return mix(", "return wrong(", "sky.glsl:5: "),
        ("passes/sky.frag", '"sky.glsl"', '"wrong.glsl"', "sky.frag:2: unknown include"),
        ("passes/film.frag", "FILMIC", "WRONG", "film.frag: flag FILMIC"),
        ("passes/film.frag", "#if FILMIC", "#if FILMIC + WRONG", "film.frag: flag WRONG"),
        # It compiles, but cannot be linked
        ("passes/film.frag", "void main() {", NOBODY, "nobody"),
        # It is linked, but what the pass sets is of another type
        ("passes/film.frag", "uniform vec2 half_size;", LONGER, "shader.py:"),
    ],
)
def test_a_broken_edit_is_told_in_a_line_and_changes_nothing(bench, name, old, new, said):
    player, before = bench.live.player, bench.picture()
    file = bench.shaders / name
    good = file.read_text()
    bench.edit(name, old, new)
    assert bench.wait()
    assert bench.live.player is player
    assert said in bench.live.error
    assert "\n" not in bench.live.error
    np.testing.assert_array_equal(bench.picture(), before)
    # It is not tried again and again
    assert not bench.wait()
    file.write_text(good)
    assert bench.wait()
    assert bench.live.error is None
    assert bench.live.player is not player
    np.testing.assert_array_equal(bench.picture(), before)


def test_a_file_that_is_written_in_steps_is_taken_when_it_rests(bench):
    player, file = bench.live.player, bench.shaders / "passes/film.frag"
    text = file.read_text()
    whole = text.replace(*RED)
    for end in range(0, len(whole), len(whole) // 20):
        file.write_text(whole[:end])
        assert not bench.wait(0.15)
    assert bench.live.player is player
    file.write_text(whole)
    assert bench.wait()
    assert bench.live.error is None
    assert bench.live.player is not player


def test_a_file_that_is_renamed_and_back_is_no_error(bench):
    file = bench.shaders / "passes/film.frag"
    aside = file.rename(file.with_suffix(".old"))
    assert not bench.wait(1.0)
    aside.rename(file)
    assert not bench.wait(1.0)
    assert bench.live.reloads == 0


def test_a_shader_that_stays_away_is_told_and_may_come_back(bench):
    file = bench.shaders / "passes/film.frag"
    text = file.read_text()
    file.unlink()
    assert bench.wait(3.0)
    assert "film.frag" in bench.live.error
    file.write_text(text)
    assert bench.wait()
    assert bench.live.error is None


def test_a_source_is_baked_beside_and_then_played(bench):
    player = bench.live.player
    bench.source.write_text("second")
    assert bench.wait()
    assert bench.live.busy == "baking billboard/ball 40 %"
    assert bench.live.player is player
    # An edit meanwhile begins again
    bench.source.write_text("third, longer")
    bench.wait()
    first, second = bench.bakes
    assert first.closed
    assert not second.closed
    second.step = Step(folder=player.folder)
    assert bench.wait()
    assert second.closed
    assert (bench.live.busy, bench.live.error) == (None, None)
    assert bench.live.player is not player
    assert not bench.wait()


def test_a_bake_that_fails_is_told_until_one_does_not(bench):
    player = bench.live.player
    bench.source.write_text("second")
    bench.wait()
    bench.bakes[-1].step = Step(error="scene.toml: camera: 3 -- write a table")
    assert bench.wait()
    assert bench.live.error == "scene.toml: camera: 3 -- write a table"
    assert bench.live.player is player
    # A shader that breaks meanwhile is told too, and mended by itself
    bench.edit("passes/film.frag", "vec3 encoded = ", "vec3 encoded = wrong * ")
    bench.wait()
    assert len(bench.live.error.splitlines()) == 2
    bench.edit("passes/film.frag", "wrong * ", "")
    bench.wait()
    assert bench.live.error == "scene.toml: camera: 3 -- write a table"
    bench.source.write_text("mended by now")
    bench.wait()
    bench.bakes[-1].step = Step(folder=player.folder)
    assert bench.wait()
    assert bench.live.error is None


def test_reload_takes_everything_anew(bench):
    bench.live.reload()
    assert bench.live.busy == "baking"
    bench.bakes[-1].step = Step(folder=bench.live.player.folder)
    assert bench.wait()
    assert bench.live.reloads == 1


def test_a_scene_without_bakes_is_read_again(bench):
    player = bench.live.player
    alone = Live(bench.live._make, player.folder, shaders=bench.shaders, clock=bench.clock)
    alone.reload()
    assert (alone.error, alone.busy, alone.reloads) == (None, None, 1)
    alone.close()


def test_the_first_player_must_be_good(bench):
    with pytest.raises(InputError):
        Live(bench.live._make, bench.source.parent / "gone", shaders=bench.shaders)


def test_close_stops_a_bake(bench):
    bench.source.write_text("second")
    bench.wait()
    bench.live.close()
    assert bench.bakes[-1].closed
    assert bench.live.busy is None
    bench.live.player = bench.live._make(bench.live.player.folder)


def test_a_hundred_reloads_leave_as_many_objects_on_the_card(bench, ctx):
    bench.picture()
    bench.live.reload()
    bench.live._renew(0.0)
    before = counted(ctx)
    assert min(before[kind] for kind in ("Texture", "Program", "VertexArray", "Framebuffer")) > 0
    for number in range(100):
        # Every fourth is broken: in a program, where half a player is made, and in a draw
        if number % 8 == 3:
            bench.edit("passes/film.frag", "vec3 encoded = ", "vec3 encoded = wrong * ")
        elif number % 8 == 7:
            bench.edit("passes/film.frag", "uniform vec2 half_size;", LONGER)
        bench.live._renew(0.0)
        assert (bench.live.error is None) == (number % 4 != 3)
        if number % 4 == 3:
            bench.edit("passes/film.frag", "wrong * ", "") if number % 8 == 3 else bench.edit(
                "passes/film.frag", LONGER, "uniform vec2 half_size;"
            )
    bench.live._renew(0.0)
    bench.picture()
    after = counted(ctx)
    # moderngl itself forgets a program and its vertex shader where the other does not compile
    broken = len(range(3, 100, 8))
    for kind in ("Program", "Shader"):
        assert after.pop(kind) - before.pop(kind) <= broken
    assert after == before


def test_what_opengl_refuses_in_a_frame_is_told(bench, ctx, monkeypatch):
    player = bench.live.player

    def carried(old, new):
        draw = new.draw

        def refused(time):
            draw(time)
            ctypes.CFUNCTYPE(None, ctypes.c_uint)(capture.loader(ctx)("glEnable"))(0xFFFF)

        new.draw = refused

    monkeypatch.setattr(bench.live, "_carry", carried)
    bench.live._renew(0.0)
    assert bench.live.error.startswith("live.py:")
    assert bench.live.player is player


def test_errors_are_told_in_one_line():
    assert live.told(InputError("a.toml", "camera", 3, "write a table")) == (
        "a.toml: camera: 3 -- write a table"
    )
    assert live.told(shader.ShaderError("\n\nLinking failed\n====\n\nerror: screen\n")) == (
        "Linking failed: error: screen"
    )
    assert live.told(KeyError("half_size")) == "KeyError: 'half_size'"
