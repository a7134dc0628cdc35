"""`bakelight voxels` as a user runs it."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from formats.voxels import Voxels
from pipelines import single
from pipelines.cli import cli, run
from tests.formats import vox_bytes as b

single.add_to(cli)


@pytest.fixture
def lamp(tmp_path: Path) -> Path:
    """A grey cell under one that glows."""
    path = tmp_path / "lamp.vox"
    cells = [(0, 0, 0, 1), (0, 0, 1, 2)]
    glow = b.material(2, _type="_emit", _emit="1", _flux="1")
    shades = b.colours((128, 128, 128), (255, 255, 255))
    path.write_bytes(b.whole(b.model((1, 1, 2), cells), shades, glow))
    return path


def arguments(source: Path, root: Path, *more: str) -> list[str]:
    return ["voxels", str(source), "-o", str(root / "out"), "--build", str(root / "b"), *more]


def test_bake_and_inspect(lamp: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(arguments(lamp, tmp_path)) == 0
    said = capfd.readouterr()
    assert said.out.splitlines()[:2] == [
        "voxels: 1 x 2 x 1 cells of 0.1 m, 2 solid in 2 colours",
        "light: 1 cells glow, up to 10 W/(m2 sr), in BC1; error RMS: BC1 0.00%, RGBA8 0.00%",
    ]
    assert "note: a colour is brighter than albedo 0.98" in said.err
    world = Voxels.load(tmp_path / "out")
    assert world.cells[:, :, 0].tolist() == [[1, 2]]
    assert run(["inspect", str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["kind"] == "voxels"
    assert told["layout"]["glowing_rows"] == {"2": [10.0, 10.0, 10.0]}
    assert "albedo" not in told["layout"]
    assert run(["inspect", str(tmp_path / "out/light.ktx2")]) == 0
    assert "format: BC1" in capfd.readouterr().out
    assert run(["inspect", str(lamp), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["size_z_up"] == [1, 1, 2]
    assert told["emissive"] == {"2": 10.0}


def test_marks_and_sizes(lamp: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    marks = ["--emissive", "1=9,4,1", "--emissive", "#ffffff=0.5", "--cell-size", "0.25"]
    assert run(arguments(lamp, tmp_path, *marks, "--json")) == 0
    assert json.loads(capfd.readouterr().out)["quality"]["glowing"] == 2
    world = Voxels.load(tmp_path / "out")
    assert world.emission[1:3].tolist() == [[9.0, 4.0, 1.0], [0.5, 0.5, 0.5]]
    assert world.cell_size == 0.25
    # The same again is not baked again
    assert run(arguments(lamp, tmp_path, *marks, "--json")) == 0
    assert json.loads(capfd.readouterr().out)["hit"] is True


@pytest.mark.parametrize(
    ("more", "named"),
    [
        (["--emissive", "3=1"], "no cell has it"),
        (["--emissive", "3"], "write a palette index"),
        (["--emissive", "=1"], "write a palette index"),
        (["--emissive", "1=1,2"], "write a palette index"),
        (["--emissive", "1=a"], "write a palette index"),
        (["--emissive", "1=-1"], "give one number or three"),
        (["--grid", "9"], "--cell-size for a voxel file"),
        (["--cell-size", "0"], "cell_size"),
    ],
)
def test_mistakes_are_one_line(
    more: list[str], named: str, lamp: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments(lamp, tmp_path, *more)) == 2
    message = capfd.readouterr().err.strip()
    assert named in message
    assert "\n" not in message
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["cut.vox", "cut.xraw", "no.vox", "a.txt"])
def test_files_that_cannot_be_used_are_one_line(
    name: str, lamp: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    if name != "no.vox":
        (tmp_path / name).write_bytes(lamp.read_bytes()[:99])
    assert run(arguments(tmp_path / name, tmp_path)) == 2
    message = capfd.readouterr().err.strip()
    assert name in message
    assert "\n" not in message


def test_a_mesh(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "tetra.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    assert run(arguments(path, tmp_path, "--grid", "8")) == 0
    assert capfd.readouterr().out.startswith("voxels: 8 x 8 x 8 cells of 0.125 m, ")
    filled = np.count_nonzero(Voxels.load(tmp_path / "out").solid)
    assert run(arguments(path, tmp_path, "--grid", "8", "--surface")) == 0
    assert np.count_nonzero(Voxels.load(tmp_path / "out").solid) < filled
    assert run(arguments(path, tmp_path, "--cell-size", "0.1")) == 2
    assert "--grid for a mesh" in capfd.readouterr().err


DATA = os.environ.get("BAKELIGHT_DATA")
REAL = sorted((Path(DATA) / "vox").rglob("*.vox")) if DATA else []


@pytest.mark.slow
@pytest.mark.skipif(not DATA, reason="BAKELIGHT_DATA names no folder of real .vox files")
def test_files_from_the_wild(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    refused = []
    for number, path in enumerate(REAL):
        root = tmp_path / str(number)
        root.mkdir()
        code = run(arguments(path, root))
        said = capfd.readouterr()
        if code:
            assert code == 2
            assert said.err.count("\n") == 1
            refused.append(path.name)
            continue
        world = Voxels.load(root / "out")
        assert np.count_nonzero(world.solid) == world.quality["solid"] > 0
    assert refused == ["not_a.vox"]
    assert len(REAL) > 30
