"""The lens on opaque things against the traced reference: a whole scene, from its file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bake import reference
from formats import scene as scenes
from formats.files import glb
from maths import colour
from pipelines.bake_scene import bake_scene
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = 160, 90
SAMPLES = 64
SCENE = """
format = 1
[camera]
position = [0, 0.8, 0]
target = [0, 0.55, -2]
focal_length_mm = 50
lens = { f_number = 0.7, focus_distance = 3 }
[[lights]]
type = "sun"
to_light = [0.3, 0.6, 0.7]
irradiance = [3, 3, 3]
[ground]
albedo = [0.35, 0.3, 0.2]
accent = [0.1, 0.2, 0.05]
scale = 0.5
[picture]
sky = { zenith = [0.2, 0.4, 0.9], horizon = [0.8, 0.8, 0.9] }
film = { tonemap = "linear" }
[[meshes]]
name = "near"
source = "meshes/red.glb"
position = [-0.15, 0.5, -1]
rotation = [0, 0, 20]
scale = 0.35
[[meshes]]
name = "sharp"
source = "meshes/blue.glb"
position = [0.5, 0.4, -3]
rotation = [0, 30, 0]
[[meshes]]
name = "far"
source = "meshes/red.glb"
position = [-1.5, 0.6, -7]
scale = 2
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    """Squares before, in and behind the plane of focus, on a ground under a sky."""
    corners = np.float32([[-0.3, -0.3, 0], [0.3, -0.3, 0], [0.3, 0.3, 0], [-0.3, 0.3, 0]])
    for name, paint in (("red", (0.8, 0.05, 0.05, 1.0)), ("blue", (0.05, 0.1, 0.8, 1.0))):
        material = glb.Material(name, paint)
        part = glb.Primitive(corners, np.array([[0, 1, 2], [0, 2, 3]]), material=material)
        path = tmp_path / "assets/meshes" / f"{name}.glb"
        path.parent.mkdir(parents=True, exist_ok=True)
        glb.write(path, [glb.Node(name, (part,))])
    path = tmp_path / "assets/scenes/lens.toml"
    path.parent.mkdir()
    path.write_text(SCENE)
    return path


def codes(radiance: np.ndarray) -> np.ndarray:
    return 255 * np.asarray(colour.srgb_encode(np.clip(radiance, 0, 1)))


def psnr(picture: np.ndarray, truth: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.mean((codes(picture) - codes(truth)) ** 2)))


def test_a_scene_through_the_lens_is_as_it_is_traced(scene_file: Path, tmp_path: Path) -> None:
    how = reference.Params(width=SIZE[0], height=SIZE[1], samples=SAMPLES, bounces=0, shadows=False)
    truth = reference.render(scenes.load(scene_file), params=how).radiance.astype(np.float64)
    baked = bake_scene(scene_file, build_folder=tmp_path / "build")
    with Player(baked.folder, size=SIZE) as player:
        assert "defocus" in player.called
        found = player.linear(0.0)[..., :3].astype(np.float64)
    # Measured 36.2, less half a decibel
    assert psnr(found, truth) > 35.7
