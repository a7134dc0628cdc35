"""The surface pass against the traced reference without shadows: a whole scene, from its file."""

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
SIZE = 64, 36
FINE = 8  # pixels a side of a pixel, to find edges
SCENE = """
format = 1
[camera]
position = [0.4, 1.2, 4.2]
target = [0, 0.6, 0]
[[lights]]
type = "sun"
to_light = [0.6, 0.5, 0.6]
irradiance = [2.2, 2.0, 1.7]
angular_diameter = 12
[[lights]]
type = "sphere"
position = [-1.4, 1.2, 1.0]
radius = 0.3
radiance = [10, 4, 2]
[[lights]]
type = "disc"
position = [0.3, 1.9, 0.4]
facing = [0, -1, 0.4]
radius = 0.4
radiance = [2, 3, 1]
[[lights]]
type = "rectangle"
position = [1.8, 1.0, 0.2]
facing = [-1, -0.5, 0.2]
size = [0.8, 1.2]
radiance = [1.5, 3, 6]
[ground]
albedo = [0.2, 0.18, 0.15]
[[meshes]]
name = "ball"
source = "meshes/ball.glb"
position = [-0.5, 0.6, 0]
scale = 0.6
[[meshes]]
name = "wall"
source = "meshes/wall.glb"
position = [0.7, 0.4, -0.3]
rotation = [10, -25, 0]
"""


def ball(rows: int = 24) -> glb.Primitive:
    """A sphere of radius 1 with smooth normals, coloured by its own latitude."""
    theta = np.linspace(0.05, np.pi - 0.05, rows)
    phi = np.linspace(0, 2 * np.pi, 2 * rows)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    points = np.stack([np.sin(t) * np.sin(p), np.cos(t), np.sin(t) * np.cos(p)], axis=-1)
    at = np.arange(t.size).reshape(t.shape)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    tints = 0.3 + 0.5 * np.stack([np.sin(t) ** 2, np.cos(t) ** 2, np.ones_like(t) / 2], axis=-1)
    flat = points.reshape(-1, 3).astype(np.float32)
    tints = tints.reshape(-1, 3).astype(np.float32)
    return glb.Primitive(flat, faces, normals=flat, colours=tints)


def wall() -> glb.Primitive:
    """A thin square that faces +z and glows a little."""
    corners = np.float32([[-0.5, -0.4, 0], [0.5, -0.4, 0], [0.5, 0.4, 0], [-0.5, 0.4, 0]])
    paint = glb.Material("paint", (0.7, 0.3, 0.2, 1.0), emissive=(0.02, 0.05, 0.1))
    return glb.Primitive(corners, np.array([[0, 1, 2], [0, 2, 3]]), material=paint)


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    """A scene of two meshes on a ground under every kind of near light."""
    for name, part in (("ball", ball()), ("wall", wall())):
        path = tmp_path / "assets/meshes" / f"{name}.glb"
        path.parent.mkdir(parents=True, exist_ok=True)
        glb.write(path, [glb.Node(name, (part,))])
    path = tmp_path / "assets/scenes/still.toml"
    path.parent.mkdir()
    path.write_text(SCENE)
    return path


def codes(radiance: np.ndarray) -> np.ndarray:
    return 255 * np.asarray(colour.srgb_encode(np.clip(radiance, 0, 1)))


def test_every_pixel_away_from_edges_is_within_two_codes(scene_file: Path, tmp_path: Path) -> None:
    how = reference.Params(
        width=SIZE[0], height=SIZE[1], samples=64, bounces=0, shadows=False, lens=False
    )
    truth = reference.render(scenes.load(scene_file), params=how)
    baked = bake_scene(scene_file, build_folder=tmp_path / "build")
    with Player(baked.folder, size=SIZE) as player:
        found = player.linear(0.0)[..., :3]
    with Player(baked.folder, size=(FINE * SIZE[0], FINE * SIZE[1])) as player:
        fine = player.linear(0.0)[..., :3].reshape(SIZE[1], FINE, SIZE[0], FINE, 3)
    within = codes(fine.max(axis=(1, 3))) - codes(fine.min(axis=(1, 3)))
    flat = within.max(axis=-1) < 8
    assert flat.mean() > 0.6
    error = np.abs(codes(found) - codes(truth.radiance))
    # Four standard errors of the reference on top: 1 of 16,000 numbers by chance
    noise = codes(truth.radiance + 4 * truth.error) - codes(truth.radiance)
    assert (error - noise)[flat].max() < 2
    assert np.median(error[flat]) < 0.2
