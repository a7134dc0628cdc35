"""The command line as a user meets it: one line and an exit code for every mistake."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bake.store import Store
from pipelines import single
from pipelines.cli import cli, run

single.add_to(cli)


def error_of(capfd: pytest.CaptureFixture[str], arguments: list[object], code: int) -> str:
    """Run a command that must fail with `code`; return the one line that it says."""
    assert run([str(a) for a in arguments]) == code
    said = capfd.readouterr().err.strip()
    assert "Traceback" not in said
    assert said.count("\n") == 0
    return said


def out_of(capfd: pytest.CaptureFixture[str], arguments: list[object]) -> str:
    """Run a command that must succeed; return what it prints."""
    assert run([str(a) for a in arguments]) == 0
    return capfd.readouterr().out


@pytest.fixture
def sprite(assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Path:
    """Bake the tent as one asset."""
    folder = tmp_path / "out" / "tent"
    knobs = ["--resolution", 24, "--samples", 4, "--build", tmp_path / "build"]
    out_of(capfd, ["billboard", assets / "meshes/tent.glb", "-o", folder, *knobs])
    return folder


def test_a_sprite_is_delivered_and_told_about(
    sprite: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    told = json.loads(out_of(capfd, ["inspect", sprite, "--json"]))
    assert told["kind"] == "billboard"
    assert told["seal"] == "intact"
    assert told["quality"]["held_out_psnr"] > 20
    texture = json.loads(out_of(capfd, ["inspect", sprite / "planes.ktx2", "--json"]))
    assert texture["layers"] == 3


def test_relight_adds_light(
    sprite: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pictures = []
    for lights in (["1,0,1"], ["-1,0,1"], ["1,0,1", "-1,0,1"]):
        out = tmp_path / f"{len(pictures)}.exr"
        flags = [flag for light in lights for flag in ("--light", light)]
        out_of(capfd, ["relight", sprite, *flags, "-o", out])
        from formats.files import exr

        pictures.append(exr.read(out)["beauty"][..., :3].astype(np.float64))
    # Where no sum is clamped at zero, light adds up to float32 rounding
    lit = np.minimum(pictures[0], pictures[1]) > 0
    assert np.allclose((pictures[0] + pictures[1])[lit], pictures[2][lit], rtol=1e-5, atol=1e-7)
    assert np.count_nonzero(lit) > 10


def test_relight_writes_a_picture_with_alpha(
    sprite: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out_of(capfd, ["relight", sprite, "--light=0,1,1", "-o", tmp_path / "new" / "lit.png"])
    with Image.open(tmp_path / "new" / "lit.png") as opened:
        picture = np.asarray(opened)
    assert picture.shape[2] == 4
    assert picture[..., 3].max() == 255


@pytest.mark.parametrize(
    ("light", "says"), [("0,0,0", "0,0,0"), ("a", "X,Y,Z"), ("1,2", "X,Y,Z"), ("nan,0,1", "nan")]
)
def test_a_light_that_is_none(
    sprite: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], light: str, says: str
) -> None:
    line = error_of(capfd, ["relight", sprite, f"--light={light}", "-o", tmp_path / "x.png"], 2)
    assert "--light" in line
    assert says in line
    assert not (tmp_path / "x.png").exists()


def test_a_damaged_asset_is_not_shown(
    sprite: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    planes = sprite / "planes.ktx2"
    planes.chmod(0o644)
    data = bytearray(planes.read_bytes())
    data[len(data) // 2] ^= 1
    planes.write_bytes(data)
    assert "planes.ktx2" in error_of(capfd, ["inspect", sprite], 4)
    error_of(capfd, ["relight", sprite, "--light=0,0,1", "-o", tmp_path / "x.png"], 4)


BAD_MESHES = {
    "empty.obj": "",
    "points.obj": "v 0 0 0\nv 1 0 0\n",
    "nan.obj": "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "far.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999\n",
    "thin.obj": "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "junk.glb": "glTF no",
    "words.ply": "ply\nnonsense\n",
    "what.fbx": "Kaydara",
}


@pytest.mark.parametrize("name", BAD_MESHES)
def test_a_bad_mesh_leaves_nothing(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    mesh, out, build = tmp_path / name, tmp_path / "out", tmp_path / "build"
    mesh.write_text(BAD_MESHES[name])
    assert name in error_of(capfd, ["billboard", mesh, "-o", out, "--build", build], 2)
    assert not out.exists()
    assert not list((build / "store").glob("*bake*"))


def test_paths_that_are_not_there(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for command in (["bake"], ["plan"], ["inspect"]):
        assert "none.toml" in error_of(capfd, [*command, tmp_path / "none.toml"], 2)
    assert "none.obj" in error_of(
        capfd, ["billboard", tmp_path / "none.obj", "-o", tmp_path / "o"], 2
    )


def test_output_that_holds_something_else_is_kept(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine"
    out.mkdir()
    (out / "letter.txt").write_text("dear")
    knobs = ["--resolution", 8, "--samples", 1, "--build", tmp_path / "b"]
    error_of(capfd, ["billboard", assets / "meshes/tent.glb", "-o", out, *knobs], 2)
    assert (out / "letter.txt").read_text() == "dear"


def test_a_typo_names_its_line_and_remedy(assets: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = assets / "scenes/plain.toml"
    scene.write_text(scene.read_text().replace("to_light", "tolight"))
    line = error_of(capfd, ["bake", scene, "--build", assets.parent / "build"], 2)
    assert "lights[0]" in line
    assert "to_light" in line
    assert not (assets.parent / "build" / "scenes").exists()


def test_a_source_cannot_leave_the_root(assets: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = assets / "scenes/plain.toml"
    scene.write_text(scene.read_text().replace("meshes/tent.glb", "../../etc/tent.glb"))
    assert "billboards[0].source" in error_of(
        capfd, ["bake", scene, "--build", assets.parent / "b"], 2
    )


@pytest.mark.gpu
def test_render_bakes_first_and_only_when_something_changed(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene, build, out = assets / "scenes/all.toml", tmp_path / "build", tmp_path / "a.png"
    flags = ["--size", "64x36", "--build", build]
    out_of(capfd, ["render", scene, "-o", out, *flags])
    first = out.read_bytes()
    baked = {p.name for p in (build / "store").iterdir()}
    out_of(capfd, ["render", scene, "-o", out, *flags])
    assert out.read_bytes() == first
    scene.write_text(scene.read_text().replace("irradiance = [3, 3, 3]", "irradiance = [1, 1, 1]"))
    out_of(capfd, ["render", scene, "-o", out, *flags])
    assert out.read_bytes() != first
    # Brighter light bakes nothing anew
    assert {p.name for p in (build / "store").iterdir()} == baked


@pytest.mark.gpu
def test_a_damaged_scene_is_baked_again(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene, build, out = assets / "scenes/plain.toml", tmp_path / "build", tmp_path / "a.png"
    flags = ["-o", out, "--size", "32x18", "--build", build]
    out_of(capfd, ["render", scene, *flags])
    before = out.read_bytes()
    planes = next((build / "scenes/plain/assets").glob("*/planes.ktx2"))
    planes.chmod(0o644)
    planes.write_bytes(planes.read_bytes()[:-1] + b"?")
    assert run([str(a) for a in ["render", scene, *flags]]) == 0
    assert "planes.ktx2" in capfd.readouterr().err
    assert out.read_bytes() == before


@pytest.mark.gpu
def test_render_writes_sequences_and_movies(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene = assets / "scenes/plain.toml"
    flags = ["--size", "32x18", "--build", tmp_path / "build"]
    stills = out_of(
        capfd, ["render", scene, "-o", tmp_path / "s", "--time", 0, "--time", 0.5, *flags]
    )
    assert len(stills.split()) == 2
    for name in ("m.gif", "m.webp"):
        out_of(capfd, ["render", scene, "-o", tmp_path / name, "--frames", "0:3", *flags])
        with Image.open(tmp_path / name) as movie:
            assert movie.format == name[2:].upper()
    linear = out_of(capfd, ["render", scene, "-o", tmp_path / "l.exr", *flags]).strip()
    assert Path(linear).stat().st_size > 0


@pytest.mark.parametrize(
    "flags",
    [
        ["--size", "big"],
        ["--size", "0x9"],
        ["--frames", "3:1"],
        ["--time", "nan"],
        ["--time", "1", "--frames", "0:2"],
    ],
)
def test_a_render_that_makes_no_sense(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], flags: list[str]
) -> None:
    arguments = ["render", assets / "scenes/plain.toml", "-o", tmp_path / "x.png", *flags]
    assert flags[-2] in error_of(capfd, arguments, 2)


def test_json_is_json_and_nothing_else(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene, build = assets / "scenes/plain.toml", ["--build", tmp_path / "build"]
    for command in (["bake", scene], ["plan", scene], ["store", "verify"], ["store", "gc"]):
        json.loads(out_of(capfd, [*command, "--json", *build]))


@pytest.mark.parametrize("command", ["verify", "gc"])
def test_a_store_that_is_not_there_is_not_made(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], command: str
) -> None:
    assert "typo" in error_of(capfd, ["store", command, "--build", tmp_path / "typo"], 2)
    assert not (tmp_path / "typo").exists()


def test_a_closed_pipe_is_no_mistake(assets: Path) -> None:
    command = [sys.executable, "-m", "pipelines.cli", "inspect", str(assets / "meshes/tent.glb")]
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_output_that_has_no_room_is_one_line(assets: Path) -> None:
    command = [sys.executable, "-m", "pipelines.cli", "plan", str(assets / "scenes/plain.toml")]
    for unbuffered in ("", "1"):
        changed = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
        with open("/dev/full", "w") as full:
            done = subprocess.run(
                command, stdout=full, stderr=subprocess.PIPE, text=True, env=changed
            )
        assert done.returncode == 3
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("text", ["[1]", '"x"', "{}"])
def test_any_json_can_be_looked_into(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str
) -> None:
    (tmp_path / "a.json").write_text(text)
    assert out_of(capfd, ["inspect", tmp_path / "a.json"])
    (tmp_path / "a.json").write_text("NaN")
    error_of(capfd, ["inspect", tmp_path / "a.json"], 2)


@pytest.mark.parametrize(
    "flags", [["--exposure=1e6"], ["--exposure=nan"], ["--light=0,0,1,1e9,0,0"]]
)
def test_light_beyond_all_measure(
    sprite: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], flags: list[str]
) -> None:
    arguments = ["relight", sprite, "--light=0,0,1", *flags, "-o", tmp_path / "x.png"]
    assert flags[0].split("=")[0] in error_of(capfd, arguments, 2)


def test_gc_keeps_what_scenes_use(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    build = ["--build", tmp_path / "build"]
    out_of(capfd, ["bake", assets / "scenes/plain.toml", *build])
    assert json.loads(out_of(capfd, ["store", "gc", "--json", *build]))["removed"] == []
    done = json.loads(out_of(capfd, ["bake", assets / "scenes/plain.toml", "--json", *build]))
    assert all(asset["hit"] for asset in done["assets"].values())


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_a_stopped_bake_leaves_a_store_that_verifies(
    assets: Path, tmp_path: Path, sent: signal.Signals
) -> None:
    build = tmp_path / "build"
    command = [sys.executable, "-m", "pipelines.cli", "billboard", str(assets / "meshes/tent.glb")]
    command += ["-o", str(tmp_path / "out"), "--build", str(build), "--resolution", "2048"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ) as process:
        try:
            while not (build / "store" / ".locks").exists() and process.poll() is None:
                time.sleep(0.01)
            time.sleep(0.7)
            process.send_signal(sent)
            said = process.communicate(timeout=60)[1]
        finally:
            process.kill()
    assert process.returncode == (130 if sent is signal.SIGINT else -signal.SIGKILL), said
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()
    assert Store(build / "store").verify() == []
