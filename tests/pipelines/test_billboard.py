"""`bakelight billboard --dome`, as a user runs it; what goes with a ring only, and with a dome."""

import json
from pathlib import Path

import pytest

from formats.dome import Dome
from pipelines import single
from pipelines.cli import cli, run

single.add_to(cli)


def command(assets: Path, tmp_path: Path, *more: object) -> list[str]:
    small = ("--resolution", 12, "--samples", 4)
    whole = ("billboard", assets / "meshes/tent.glb", "-o", tmp_path / "out", *small, *more)
    return [str(part) for part in (*whole, "--build", tmp_path / "build")]


def test_a_mesh_under_a_dome(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    knobs = ("--dome", "--lights", 16, "--bands", 4, "--penalty", 0.1, "--channels", 8)
    assert run(command(assets, tmp_path, *knobs, "--max-lod", 1, "--views", 2)) == 0
    assert "16 lights left out in turn: this" in capfd.readouterr().out
    dome = Dome.load(tmp_path / "out")
    assert (dome.channels, dome.planes, dome.views, dome.coverage) == (7, 2, 2, True)
    assert dome.max_lod == 1
    assert run(["inspect", str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert (told["kind"], told["quality"]["bands"], told["quality"]["penalty"]) == ("dome", 4, 0.1)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        (("--dome", "--terms", 7), "--terms"),
        (("--dome", "--packing", "full"), "--packing"),
        (("--dome", "--lights-per-sample", 2), "--lights-per-sample"),
        (("--bands", 4), "--bands"),
        (("--channels", 16), "--channels"),
        (("--dome", "--channels", 1), "channels"),
    ],
)
def test_options_that_do_not_go_together(
    assets: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    options: tuple[object, ...],
    field: str,
) -> None:
    assert run(command(assets, tmp_path, *options)) == 2
    said = capfd.readouterr().err.strip()
    assert f": {field}: " in said
    assert said.count("\n") == 0
