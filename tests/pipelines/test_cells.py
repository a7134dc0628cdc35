"""The scene `cells`: pictures and a lens, less than six programs, and a loop without a seam."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats import effects, scene
from maths import particles
from pipelines.bake_scene import bake_scene

SCENE = Path(__file__).parents[2] / "assets/scenes/cells.toml"
PASSES = {"particles", "billboard", "depth_of_field", "bloom", "film"}
ROOM = 600_000  # bytes of all drawn pictures

PLAY = """
import json, sys
from runtime.player import Player
with Player(sys.argv[1], size=(64, 36)) as player:
    codes = [player.frame(t)[..., :3].tolist() for t in (0.0, 10.0)]
    print(json.dumps({"profile": player.profile, "modules": sorted(sys.modules), "codes": codes}))
"""


@pytest.fixture(scope="module")
def described() -> scene.Scene:
    return scene.load(SCENE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scene of tiny pictures and a still camera: proofs about each of its poses take long."""
    raw = tomllib.loads(SCENE.read_text(encoding="utf-8"))
    for sprites in raw["billboards"]:
        sprites["resolution"] = 8
    camera = raw["camera"]
    camera["position"] = camera["position"]["values"][0]
    camera["lens"]["focus_distance"] = camera["lens"]["focus_distance"]["values"][0]
    place = tmp_path_factory.mktemp("small")
    path = place / "cells.json"
    path.write_text(json.dumps(raw))
    return bake_scene(path, root=SCENE.parents[1], build_folder=place / "build").folder


def test_no_light_is_described(described: scene.Scene) -> None:
    assert described.lights == ()
    assert all(billboards.pictured for billboards in described.billboards)
    called = {each.name for each in effects.decide(described, {}, 540) if each.called}
    assert called == PASSES


def test_the_pictures_are_small() -> None:
    found = list((SCENE.parents[1] / "pictures").glob("*.png"))
    assert 6 <= len(found) <= 10
    assert sum(path.stat().st_size for path in found) < ROOM


def test_thousands_are_there(described: scene.Scene) -> None:
    placed = sum(len(each.instances()) for each in described.billboards)
    drifting = sum(
        len(
            particles.alive(
                e.emitter.seed, e.emitter.pace, e.emitter.lifetime, 3.0, e.emitter.cycle
            ).index
        )
        for e in described.particles
    )
    assert placed + drifting > 2000


def test_all_that_moves_comes_again_after_ten_seconds(described: scene.Scene) -> None:
    assert described.time.duration == 10.0
    camera = described.camera
    assert camera.lens is not None
    for keyed in (camera.position, camera.lens.focus_distance):
        assert keyed.loop
        np.testing.assert_array_equal(keyed.values[0], keyed.values[-1])
        assert (keyed.times[0], keyed.times[-1]) == (0.0, 10.0)
    assert all(each.emitter.period == 10.0 for each in described.particles)


@pytest.mark.gpu
def test_it_plays_in_few_programs_without_the_baker(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PLAY, str(folder)], capture_output=True, text=True, check=True
    )
    found: dict[str, Any] = json.loads(done.stdout)
    profile, modules = found["profile"], set(found["modules"])
    assert set(profile["passes"]) == PASSES
    assert profile["programs"] < 6
    # No word of light either, baked or not
    unwanted = ("bake", "embreex", "trimesh", "OpenEXR", "sklearn")
    assert not [name for name in modules if name.split(".")[0] in unwanted]
    lit = {"formats.billboard", "formats.dome", "runtime.dome_series", "runtime.sprite_shadows"}
    assert not modules & lit
    first, last = np.array(found["codes"], np.int64)
    # Grain and dither of another frame: 2 codes of deviation, at most 3.5 of them, and a half
    assert np.abs(first - last).max() <= 2 * (2 * 3.5 + 1)
    assert np.abs(first.mean(axis=(0, 1)) - last.mean(axis=(0, 1))).max() < 0.5
