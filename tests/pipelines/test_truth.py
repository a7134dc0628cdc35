"""The traced truth beside a window: what it traces is what the player shows, and it gets better."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake import reference
from bake.reference_film import develop
from formats import scene as scenes
from formats.keyed import Keyed
from pipelines import trace_truth
from pipelines.bake_scene import bake_scene
from pipelines.trace_truth import Request, trace
from pipelines.truth import Truth, shown
from runtime.camera import Camera
from runtime.player import Player
from runtime.truth import Traced

pytestmark = pytest.mark.gpu
SIZE = (40, 24)


@pytest.fixture
def path(assets):
    """A mesh, sprites, a sun, sky and a lens, on a ground."""
    found = assets / "scenes/surface.toml"
    text = found.read_text().replace("[picture]", "[ground]\n[picture]\nbloom = { strength = 0.3 }")
    found.write_text(
        text.replace("[camera]", "[camera]\nlens = { f_number = 4, focus_distance = 5 }")
    )
    return found


@pytest.fixture
def player(path, tmp_path):
    """The player of that scene, with a context of its own."""
    folder = bake_scene(path, build_folder=tmp_path / "build").folder
    with Player(folder, size=SIZE, roaming=True) as made:
        yield made


def told(request):
    """All messages of a tracing, in this process."""
    found = []
    trace(request, found.append)
    return [message for message in found if message is not None]


def test_an_untouched_player_shows_the_declared_scene(player, path):
    scene, declared = shown(player, 0.5, path, None if path is None else path.parents[1]), None
    declared = scenes.load(path)
    for field in ("meshes", "billboards"):
        pairs = zip(getattr(scene, field), getattr(declared, field), strict=True)
        assert all(a.source == b.source and a.source.is_file() for a, b in pairs)
    params = reference.Params(width=16, height=9, time=0.5, samples=4)
    np.testing.assert_array_equal(
        reference.render(scene, params=params).radiance,
        reference.render(declared, params=params).radiance,
    )


def test_what_hands_did_is_traced(player, path):
    root = path.parents[1]
    view = replace(
        Camera.of_scene(player.scene, 0.0),
        position=np.array([1.0, 2.0, 3.0]),
        focal_length=0.035,
        focus_distance=2.5,
    )
    player.camera, player.sun_turn = view, (0.3, -0.1)
    player.change(hidden=["mesh/house"], off=["sky"])
    player.look(0.0)
    scene = shown(player, 0.0, path, root)
    assert scene.camera.position.at(9.0).tolist() == [1.0, 2.0, 3.0]
    assert scene.camera.focal_length_mm.at(0.0) == pytest.approx(35.0)
    assert scene.camera.lens.focus_distance.at(0.0) == 2.5
    assert scene.meshes == ()
    assert len(scene.billboards) == 1
    assert scene.picture.sky is None
    np.testing.assert_allclose(scene.lights[0].direction(0.0), player.lights.suns[0].to_light)
    player.change(hidden=["billboard/tent"], off=["lens"])
    scene = shown(player, 0.0, path, root)
    assert (len(scene.meshes), scene.billboards, scene.camera.lens) == (1, (), None)
    assert scene.picture.sky is not None


def test_lights_that_the_plan_left_out_are_back(player, path):
    changed = replace(player.scene.lights[0], irradiance=Keyed.hold([9, 9, 9]))
    text = path.read_text()
    text = text.replace(
        "[[lights]]",
        "[[lights]]\ntype = 'sun'\nto_light = [0, 1, 0]\nirradiance = [0, 0, 0.125]\n[[lights]]",
        1,
    )
    path.write_text(text)
    raw = scenes.load(path).raw
    player.plan = {"lights": [{"index": 0, "kept": False}, {"index": 1, "kept": True}]}
    player.change(replace(player.scene, lights=(changed,), raw=raw))
    found = shown(player, 0.0, path, path.parents[1])
    assert [light.irradiance.at(0.0).tolist() for light in found.lights] == [
        [0, 0, 0.125],
        [9, 9, 9],
    ]


def test_it_begins_coarse_and_adds_up_independent_samples(player, path, monkeypatch):
    monkeypatch.setattr(trace_truth, "MOST", 36)
    scene = shown(player, 0.0, path, path.parents[1])
    scene = replace(scene, picture=replace(scene.picture, bloom=None))
    messages = told(Request(scene, 0.0, SIZE))
    pictures = [m for m in messages if isinstance(m, Traced)]
    assert [p.samples for p in pictures] == [4 / 16, 4 / 4, 4, 20, 36]
    assert [p.done for p in pictures] == [False] * 4 + [True]
    assert all(p.picture.shape == (SIZE[1], SIZE[0], 3) for p in pictures)
    assert pictures[-1].error < pictures[2].error
    said = [m for m in messages if isinstance(m, str)]
    assert said[0] == "placing what stands in the scene"
    assert said[-1] == "tracing 36 paths a pixel, 100 %"
    # The mean by hand, of the same seeds
    mean, total = 0.0, 0
    for seed, samples in ((1, 4), (2, 16), (3, 16)):
        params = reference.Params(width=SIZE[0], height=SIZE[1], samples=samples, seed=seed)
        mean = mean + samples * reference.render(scene, params=params).radiance.astype(float)
        total += samples
    expected = develop(mean / total, scene, 0.0)
    # A code, where a mean in another order is rounded the other way
    assert np.abs(pictures[-1].picture.astype(int) - expected).max() <= 1


def test_bloom_is_that_of_the_player(player, path):
    scene = shown(player, 0.0, path, path.parents[1])
    radiance = np.zeros((24, 40, 3))
    radiance[12, 20] = 50.0
    with_bloom = trace_truth._film(radiance, scene, 0.0)
    without = trace_truth._film(
        radiance, replace(scene, picture=replace(scene.picture, bloom=None)), 0.0
    )
    assert with_bloom[12, 24].max() > without[12, 24].max() + 5


def test_what_stands_is_placed_once_for_the_same_moment(player, path):
    scene = shown(player, 0.0, path, path.parents[1])
    trace_truth._stood.clear()
    said = []
    for each in (
        Request(scene, 0.0, SIZE),
        Request(scene, 0.0, (8, 8)),
        Request(scene, 0.25, SIZE),
    ):
        trace_truth._standing(each, said.append)
    assert [s for s in said if s] == ["placing what stands in the scene"] * 2


def test_a_first_picture_does_without_sets_of_many_sprites(player, path, monkeypatch):
    scene = shown(player, 0.0, path, path.parents[1])
    trace_truth._stood.clear()
    monkeypatch.setattr(trace_truth, "MOST", 4)
    request = Request(scene, 0.0, (32, 32))

    def notes():
        return [m.notes for m in told(request) if isinstance(m, Traced)]

    assert (trace_truth.FEWER,) not in notes()
    trace_truth._stood.clear()
    monkeypatch.setattr(trace_truth, "MANY", len(scene.billboards[0].instances()) - 1)
    first, *rest = notes()
    assert first[-1] == trace_truth.FEWER
    assert all(trace_truth.FEWER not in each for each in rest)
    # All stands now
    assert all(trace_truth.FEWER not in each for each in notes())


def test_a_tracing_beside_is_replaced_by_the_next_and_ends_on_errors(player, path, tmp_path):
    tracings = Truth(path, None, threads=1)

    def first(tracing, seconds=60.0):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if (found := tracing.poll()) is not None or tracing.busy is None:
                return found
            time.sleep(0.01)
        raise AssertionError("no picture in time")

    try:
        before = tracings(player, 0.0)
        picture = first(before)
        assert picture.picture.shape == (SIZE[1], SIZE[0], 3)
        after = tracings(player, 0.25)
        assert (before.busy, before.poll()) == (None, None)
        assert first(after) is not None
        after.close()
        assert after.busy is None
        # A source that is gone is one line
        gone = Path(str(player.scene.meshes[0].source))
        (path.parents[1] / gone).rename(tmp_path / "aside.glb")
        tracing = tracings(player, 0.5)
        assert (tracing.poll(), tracing.busy) == (None, None)
        assert "tent.glb" in str(tracing.error)
    finally:
        tracings.close()
