"""`bakelight lightmap`: baked folders, voxel files and meshes become light; faults are one line."""

import json
from pathlib import Path

import numpy as np
import pytest

from assets.voxels import vox_file
from formats.files import rgbe
from formats.lightmap import Lightmap
from formats.voxels import Voxels
from pipelines import cli, single
from tests.bake import cell_worlds

QUICK = ("--texels", "1", "--rays", "64")


single.add_to(cli.cli)


def bake(tmp_path: Path, *arguments: str) -> int:
    return cli.run(["lightmap", *arguments, *QUICK, "--build", str(tmp_path / "build")])


def folder_of(world: Voxels, folder: Path) -> Path:
    folder.mkdir()
    world.save(folder)
    return folder


def test_a_baked_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = folder_of(cell_worlds.of(cell_worlds.room(3), [0.5], [1.0]), tmp_path / "world")
    out = tmp_path / "light"
    assert bake(tmp_path, str(source), "-o", str(out)) == 0
    told = capsys.readouterr().out
    assert "relative error" in told
    found = Lightmap.load(out)
    walls = cell_worlds.inside(found.faces, 3)
    # A furnace of albedo a half: 2 pi, to a few percent by 64 rays
    assert abs(found.irradiance[walls].mean() / (2 * np.pi) - 1) < 0.05
    # What is there is not baked again
    assert bake(tmp_path, str(source), "-o", str(tmp_path / "again"), "--json") == 0
    assert json.loads(capsys.readouterr().out)["hit"] is True


def test_a_sky_and_a_voxel_file(tmp_path: Path) -> None:
    sky = tmp_path / "sky.hdr"
    rgbe.write(sky, np.ones((8, 16, 3), np.float32))
    source = tmp_path / "cube.vox"
    vox_file.write(source, [vox_file.Part(np.full((2, 2, 2), 5, np.uint8))], {5: "#808080"})
    out = tmp_path / "light"
    code = bake(tmp_path, str(source), "-o", str(out), "--environment", str(sky), "--sky", "2")
    assert code == 0
    found = Lightmap.load(out)
    # White all around a cube, twice: every face sees half of it
    lit = found.irradiance[found.faces.cell() >= 0]
    np.testing.assert_allclose(lit.mean(), 2 * np.pi, rtol=0.02)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("empty",), "not a baked world"),
        (("missing.vox",), "missing.vox"),
        (("world", "--grid", "8"), "--grid"),
        (("world", "--emissive", "1=2"), "--emissive"),
        (("world", "--bounces", "-7"), "bounces"),
        (("world", "--environment", "missing.hdr"), "missing.hdr"),
    ],
)
def test_faults_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], named: str
) -> None:
    (tmp_path / "empty").mkdir()
    folder_of(cell_worlds.of(cell_worlds.room(1), [0.5], [1.0]), tmp_path / "world")
    given = [
        str(tmp_path / a) if (tmp_path / a).exists() or a.startswith("missing") else a
        for a in arguments
    ]
    assert bake(tmp_path, *given, "-o", str(tmp_path / "out")) == 2
    said = capsys.readouterr().err.strip()
    assert named in said
    assert "\n" not in said
    assert " -- " in said
