"""`render --reference`: what it writes, what it says, and that its picture is the player's."""

import json
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from assets.voxels import vox_file
from bake import reference, reference_cubes, tiles
from bake.reference_film import develop
from formats import scene as scenes
from formats.files import exr, image
from pipelines import bake_cubes, output
from pipelines.cli import run
from pipelines.render_scene import trace_scene
from tests.bake import reference_scenes, small_meshes

BARE = """
format = 1
time = { duration = 1.0, frame_rate = 4 }
[camera]
position = [0, 1.5, 5]
target = [0.3, 1.2, 0]
focal_length_mm = 30
[[lights]]
type = "sun"
to_light = [0.3, 0.5, -0.8]
irradiance = [3, 2, 1]
angular_diameter = 0
[ground]
albedo = [0.3, 0.4, 0.2]
accent = [0.1, 0.1, 0.3]
scale = 30.0
[picture]
sky = { zenith = [0.1, 0.2, 0.5], horizon = [0.6, 0.6, 0.6], glow = [0.4, 0.2, 0.1] }
fog = { extinction = 0.02, radiance = [0.5, 0.4, 0.5], falloff = 0.3 }
film = { exposure = 0.5, vignette = 0.7, grain = 4.0 }
"""


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    (tmp_path / "scenes").mkdir()
    path = tmp_path / "scenes" / "bare.toml"
    path.write_text(BARE)
    return path


def test_a_picture_and_a_table_of_time(
    bare: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "x.png"
    flags = ["-o", out, "--size", "8x4", "--reference", "--samples", "4", "--jobs", "1"]
    assert run([str(a) for a in ["render", bare, *flags]]) == 0
    assert image.read(out).shape == (4, 8, 3)
    said = capfd.readouterr()
    assert said.out.splitlines() == [str(out)]
    assert "Mray/s" in said.err
    assert "bare-000.00" in said.err


def test_frames_become_files_with_their_errors(bare: Path, tmp_path: Path) -> None:
    job = trace_scene(bare, tmp_path / "x.exr", size="4x4", frames="0:2", samples=4)
    assert [f.name for f in job.files] == ["bare-00000.exr", "bare-00001.exr"]
    parts = exr.read(job.files[0])
    assert list(parts) == ["beauty", "error"]
    assert json.dumps(job.profile)


def test_movies_are_refused_in_one_line(
    bare: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    flags = ["-o", str(tmp_path / "x.gif"), "--reference", "--frames", "0:2"]
    assert run(["render", str(bare), *flags]) == 2
    assert "the reference writes .png, .exr or a folder" in capfd.readouterr().err


def test_it_never_imports_opengl(bare: Path, tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from pipelines.render_scene import trace_scene; "
        "trace_scene(Path(sys.argv[1]), Path(sys.argv[2]), size='4x4', samples=2); "
        "print(sorted(m for m in sys.modules if m.split('.')[0] in ('moderngl', 'runtime')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(bare), str(tmp_path / "x.png")],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).resolve().parents[2],
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.gpu
def test_ground_sky_fog_and_film_are_those_of_the_player(bare: Path, tmp_path: Path) -> None:
    from pipelines.bake_scene import bake_scene
    from runtime.player import Player

    folder = bake_scene(bare, root=None, build_folder=tmp_path / "build").folder
    player = Player(folder, size=(48, 32))
    try:
        linear, picture = player.linear(0.25)[..., :3], player.frame(0.25)[..., :3]
    finally:
        player.close()
    scene = scenes.load(bare)
    # The film of one is the film of the other; float32 may round a value to the next code
    codes = np.abs(develop(linear, scene, 0.25).astype(int) - picture)
    assert codes.max() <= 1
    assert np.mean(codes > 0) < 1e-3
    params = reference.Params(width=48, height=32, time=0.25, samples=256, bounces=0)
    traced = reference.render(scene, params=params)
    shown = np.abs(develop(traced.radiance, scene, 0.25).astype(int) - picture)
    # A pixel is one point to the player and an area here: that shows at the horizon and in the glow
    assert np.quantile(shown, 0.95) <= 2
    assert shown.mean() < 1


CUBES = """
format = 1
[camera]
position = [0.3, 1.5, 1.8]
target = [0.1, 0.2, 0.0]
focal_length_mm = 40
[voxels]
source = "world.vox"
cell_size = 0.25
texels = 2
bounces = 5
error = 0.02
emissive = { "#000000" = [4.0, 3.0, 2.0] }
[picture.film]
"""


@pytest.fixture
def cubes(tmp_path: Path) -> Path:
    """A grey floor with a wall and a post that glows."""
    cells = np.zeros((3, 8, 8), np.uint8)
    cells[0] = cells[:, -1] = 1
    cells[1:3, 3, 5] = 2
    vox_file.write(tmp_path / "world.vox", [vox_file.Part(cells)], {1: "#c0c0c0", 2: "#000000"})
    path = tmp_path / "cubes.toml"
    path.write_text(CUBES)
    return path


@pytest.mark.parametrize("source", ["world.vox", "ball.glb"])
def test_cubes_are_those_of_the_bake(cubes: Path, tmp_path: Path, source: str) -> None:
    reference_scenes.write_mesh(tmp_path, "ball", small_meshes.sphere(8, 16))
    text = CUBES.replace("world.vox", source)
    if source == "ball.glb":
        text = text.replace("emissive = {", "grid = 9 #")
    cubes.write_text(text)
    world = scenes.load(cubes, tmp_path).voxels
    assert world is not None
    sprite = bake_cubes.cells(world, "world")
    (step,) = sprite.steps
    baked = step.stage(sprite.source.load(), params=step.params)
    traced = reference_cubes.at(world, 0.0)
    for name in ("cells", "albedo", "emission", "cell_size"):
        assert np.array_equal(getattr(traced, name), getattr(baked, name)), name


def test_light_goes_on_as_often_as_cubes_ask(
    cubes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, render = [], reference.render
    monkeypatch.setattr(
        reference, "render", lambda *a, **k: asked.append(k["params"]) or render(*a, **k)
    )
    trace_scene(cubes, tmp_path / "x.exr", size="4x4", samples=2, root=tmp_path)
    cubes.write_text(CUBES.replace("bounces = 5", "bounces = 0"))
    trace_scene(cubes, tmp_path / "x.exr", size="4x4", samples=2, root=tmp_path)
    assert [params.bounces for params in asked] == [5, 2]


@pytest.mark.parametrize("edited", [False, True])
def test_an_interrupted_picture_goes_on(
    bare: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, edited: bool,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """With what was traced of the same scene; the bytes are those of one that was not."""
    monkeypatch.setattr(tiles, "EVERY", 0.0)
    monkeypatch.setattr(tiles, "PRICE", 0)
    monkeypatch.setattr(reference, "PIXELS", 8)
    out, build = tmp_path / "x.exr", tmp_path / "build"

    def traced(stop: bool = False) -> bytes:
        def bar(name: str, fraction: float) -> None:
            if stop and fraction > 0.5:
                raise KeyboardInterrupt

        monkeypatch.setattr(output, "bars", lambda: nullcontext(bar))
        trace_scene(bare, out, size="8x6", samples=4, build_folder=build)
        return out.read_bytes()

    with pytest.raises(KeyboardInterrupt):
        traced(stop=True)
    assert not out.exists()
    if edited:
        bare.write_text(BARE.replace("exposure = 0.5", "exposure = 0.6"))
    again = traced()
    assert ("going on with the reference of bare: " in capfd.readouterr().err) is not edited
    assert len(list((build / "store").glob(".tiles-*"))) == edited
    assert traced() == again


@pytest.mark.gpu
def test_cubes_are_as_bright_as_in_the_player(cubes: Path, tmp_path: Path) -> None:
    from pipelines.bake_scene import bake_scene
    from runtime.player import Player

    folder = bake_scene(cubes, root=tmp_path, build_folder=tmp_path / "build").folder
    player = Player(folder, size=(32, 20))
    try:
        played = player.linear(0.0)[..., :3]
    finally:
        player.close()
    job = trace_scene(cubes, tmp_path / "x.exr", size="32x20", samples=64, root=tmp_path)
    parts = exr.read(job.files[0])
    traced, error = parts["beauty"], parts["error"]
    # The post is as bright in both, but its edges are smooth in one: keep a pixel away from it
    post = np.pad(np.maximum(played, traced).max(axis=-1) > 1.5, 1)
    near = [np.roll(post, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    lit = ~np.any(near, axis=0)[1:-1, 1:-1]
    assert 0.8 < lit.mean() < 0.95
    mean = traced[lit].mean(axis=0)
    share = played[lit].mean(axis=0) / mean
    bar = np.sqrt((error[lit] ** 2).mean(axis=0) / lit.sum()) / mean
    # Baked light is within 2 % RMS of each texel, and a dozen or more are averaged
    assert np.abs(share - 1).max() < 0.006 + 4 * bar.max()
    assert bar.max() < 0.01
