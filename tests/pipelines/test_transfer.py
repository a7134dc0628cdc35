"""`bakelight transfer` as a user runs it, and a scene with such a mesh from its file."""

import json
from pathlib import Path

import numpy as np
import pytest

from bake import reference
from formats import scene as scenes
from formats import transfer
from formats.files import glb
from maths import colour
from pipelines import single
from pipelines.bake_scene import bake_scene, known_reports
from pipelines.cli import cli, run
from runtime.player import Player
from tests.bake import small_meshes

single.add_to(cli)


@pytest.fixture
def niche(tmp_path: Path) -> Path:
    """A floor and a wall with a ball before it."""
    ball = small_meshes.sphere_arrays(12, 16)
    parts = [
        (small_meshes.plate((0, 1, 0), (0, -1, 0), 2), (0.7, 0.7, 0.7)),
        (small_meshes.plate((0, 0, 1), (0, 1, -2), 2), (0.7, 0.2, 0.1)),
        (small_meshes.mesh_of(0.8 * ball[0] + [0, -0.2, 0], ball[1]), (0.6, 0.6, 0.6)),
    ]
    primitives = []
    for number, (mesh, paint) in enumerate(parts):
        corners = mesh.vertices[mesh.faces].reshape(-1, 3).astype(np.float32)
        faces, normals = np.arange(len(corners)).reshape(-1, 3), mesh.normals.reshape(-1, 3)
        material = glb.Material(f"m{number}", (*paint, 1.0))
        primitives.append(glb.Primitive(corners, faces, normals, material=material))
    path = tmp_path / "assets/meshes/niche.glb"
    path.parent.mkdir(parents=True)
    glb.write(path, [glb.Node("niche", tuple(primitives))])
    return path


def arguments(path: Path, *more: str) -> list[str]:
    root = path.parent
    places = ["-o", str(root / "out"), "--build", str(root / "b")]
    return ["transfer", str(path), *places, "--rays", "32", "--edge", "0.2", *more]


def test_bake_and_inspect(niche: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(arguments(niche)) == 0
    text = capfd.readouterr().out
    assert text.startswith("transfer: interreflected, ")
    assert "24 numbers of 8 bits, colours" in text
    parts = transfer.primitives(niche.parent / "out")
    assert len(parts) == 3
    assert run(["inspect", str(niche.parent / "out")]) == 0
    assert "kind: transfer" in capfd.readouterr().out
    assert run(arguments(niche, "--mode", "shadowed", "--depth", "16", "--json")) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["quality"]["mode"] == "shadowed"


def test_a_bad_knob_is_one_line(niche: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(arguments(niche, "--l-max", "12")) == 2
    message = capfd.readouterr().err.strip()
    assert "l_max" in message
    assert "\n" not in message


SCENE = """
format = 1
[camera]
position = [1.5, 1.5, 5.5]
target = [0, 0, -0.5]
[[lights]]
type = "sphere"
position = [20, 24, 20]
radius = 10
radiance = [10, 10, 9]
[[meshes]]
name = "niche"
source = "meshes/niche.glb"
lighting = "transfer"
transfer = { rays = 128, edge = 0.06, l_max = 5, components = 32 }
[picture.film]
tonemap = "linear"
"""


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    codes = (colour.srgb_encode(np.clip(x, 0, 1)) for x in (a, b))
    return float(-10 * np.log10(np.mean(np.square(next(codes) - next(codes)))))


@pytest.mark.gpu
def test_a_scene_is_near_its_traced_truth(niche: Path, tmp_path: Path) -> None:
    path = tmp_path / "assets/scenes/niche.toml"
    path.parent.mkdir()
    path.write_text(SCENE)
    size = (64, 48)
    truth = reference.render(
        scenes.load(path),
        params=reference.Params(width=size[0], height=size[1], samples=64, bounces=2),
    ).radiance
    found = {}
    for lighting in ("transfer", "direct"):
        path.write_text(SCENE.replace('"transfer"', f'"{lighting}"'))
        baked = bake_scene(path, build_folder=tmp_path / "build")
        assert list(baked.entries) == [f"{'mesh' if lighting == 'direct' else lighting}/niche"]
        known = known_reports(scenes.load(path), tmp_path / "build")
        assert set(known) == set(baked.entries)
        with Player(baked.folder, size=size) as player:
            found[lighting] = player.linear(0.0)[..., :3]
    # Measured: 33.7 dB, and 22.4 of direct light alone; bands up to 5 blur the shadow of the ball
    assert psnr(found["transfer"], truth) > 31
    assert psnr(found["transfer"], truth) > psnr(found["direct"], truth) + 8
