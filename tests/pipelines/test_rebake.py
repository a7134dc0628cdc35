"""A scene baked beside its window: progress, the folder, refusals; which files it depends on."""

from __future__ import annotations

import json
import time

import pytest

from pipelines import rebake
from pipelines.bake_scene import bake_scene
from pipelines.beside import Beside
from pipelines.rebake import Rebake, Request, watched
from pipelines.view_scene import Bakes


@pytest.fixture
def asked(assets, tmp_path):
    return Request(assets / "scenes/plain.toml", None, tmp_path / "build")


def ended(bake, seconds=60.0):
    """Every step until the last one."""
    steps, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        step = bake.poll()
        if not steps or step != steps[-1]:
            steps.append(step)
        if step.busy is None:
            return steps
        time.sleep(0.01)
    raise AssertionError("the bake did not end in time")


def test_a_bake_tells_how_far_it_is_and_drops_what_is_not_wanted(asked):
    told = []
    rebake.bake(asked, told.append)
    *progress, folder = told
    assert folder == asked.build / "scenes/plain"
    assert (folder / "manifest.json").is_file()
    moved = [step for step in progress if step is not None]
    assert {name for name, _ in moved} == {"billboard/tent"}
    assert moved[-1][1] == 100
    assert len(set(moved)) == len(moved)


def test_edits_are_baked_beside_and_a_mistake_is_one_line(assets, tmp_path):
    path = assets / "scenes/plain.toml"
    bakes = Bakes(path, None, tmp_path / "build")
    try:
        steps = ended(bakes.start())
        assert steps[0].busy == "baking plain"
        assert steps[-1].folder == tmp_path / "build/scenes/plain"
        good = path.read_text()
        path.write_text(good.replace("[0, 0.5, 0]", '"here"'))
        last = ended(bakes.start())[-1]
        assert last.folder is None
        assert str(path) in last.error
        assert "camera.target" in last.error
        path.write_text(good.replace("[0, 0.5, 0]", "[0, 0.6, 0]"))
        last = ended(bakes.start())[-1]
        assert (last.error, last.folder) == (None, tmp_path / "build/scenes/plain")
        scene = json.loads((last.folder / "manifest.json").read_text())["scene"]
        assert scene["camera"]["target"] == [0, 0.6, 0]
        # One that is closed under way stops, and the next one begins anew
        bake = bakes.start()
        bake.close()
        assert ended(bakes.start())[-1].folder is not None
    finally:
        bakes.close()


def test_a_bake_that_ended_leaves_the_process_to_the_next(asked):
    stopped = []

    class Still(Beside):
        def ask(self, request):
            self.asked = request

        def poll(self):
            from pipelines.beside import Ended

            return [("billboard/tent", 40), asked.build, Ended()]

        def stop(self):
            stopped.append(True)

    bake = Rebake(Still(rebake.bake), asked)
    assert bake.poll().folder == asked.build
    bake.close()
    assert stopped == []


def test_what_is_watched_is_what_the_bake_read(assets, tmp_path):
    path = assets / "scenes/all.toml"
    folder = tmp_path / "build/scenes/all"
    names = {"all.toml", "tent.glb", "even.hdr"}
    assert {file.name for file in watched(path, None, folder)} == names
    bake_scene(path, build_folder=tmp_path / "build")
    found = watched(path, None, folder)
    assert {file.name for file in found} == names
    assert len(found) == len(names)
    # A broken file: what was baked is still looked at
    path.write_text("format = [")
    assert {file.name for file in watched(path, None, folder)} == names
    # A source that is not there yet is waited for
    path.write_text("")
    path.unlink()
    assert watched(path, None, folder)[0] == path.resolve()
