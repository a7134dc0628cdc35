"""`bakelight occlusion` as a user runs it."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from bake import compress, occlusion, sources
from formats.errors import InputError
from formats.occlusion import Occlusion
from pipelines import single
from pipelines.cli import cli, run
from tests.bake import small_meshes

single.add_to(cli)


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    vertices, faces = small_meshes.sphere_arrays(8, 12)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path = tmp_path / "ball.obj"
    path.write_text("\n".join(lines))
    return path


def arguments(ball: Path, *more: str) -> list[str]:
    root = ball.parent
    sizes = ["--grid", "8", "--rays", "64"]
    return [
        "occlusion",
        str(ball),
        "-o",
        str(root / "out"),
        "--build",
        str(root / "b"),
        *sizes,
        *more,
    ]


def test_bake_and_inspect(ball: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(arguments(ball)) == 0
    text = capfd.readouterr().out
    assert text.startswith("occlusion: 8^3 voxels, l_max 4, 16 numbers of 8 bits, 8 KiB")
    assert "10 degrees" in text
    asset = Occlusion.load(ball.parent / "out")
    assert asset.volumes.shape == (4, 8, 8, 8, 4)
    assert np.all(np.isfinite(asset.decoded()))
    assert run(["inspect", str(ball.parent / "out")]) == 0
    assert "kind: occlusion" in capfd.readouterr().out


def test_other_components_trace_no_ray_again(ball: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(arguments(ball)) == 0
    before = sorted((ball.parent / "b/store").glob("*trace-*"))
    capfd.readouterr()
    assert run(arguments(ball, "--components", "8", "--depth", "16", "--json")) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["hit"] is False
    assert told["quality"]["bytes"] == 8**3 * 8 * 2
    assert len(before) == 1
    assert sorted((ball.parent / "b/store").glob("*trace-*")) == before


def test_bands(ball: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(arguments(ball, "--encoding", "bands", "--size", "64")) == 0
    text = capfd.readouterr().out
    assert "and" in text
    assert "l_max 4, 25 numbers of 8 bits" in text
    asset = Occlusion.load(ball.parent / "out")
    assert asset.coarse is not None
    assert 50 << 10 < asset.nbytes <= 64 << 10
    assert run(arguments(ball, "--encoding", "bands", "--size", "0")) == 2
    assert "size" in capfd.readouterr().err


def test_a_bad_knob_is_one_line(ball: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(arguments(ball, "--l-max", "12")) == 2
    message = capfd.readouterr().err.strip()
    assert "l_max" in message
    assert "\n" not in message


DATA = os.environ.get("BAKELIGHT_DATA")
MODELS = Path(DATA or ".") / "meshes" / "trimesh" / "models"
NASTY = sorted(p for p in MODELS.glob("*") if p.suffix.lower() in sources.SUFFIXES) if DATA else []


def outcome(path: Path) -> str:
    """Bake a mesh coarsely: "baked", or what it is refused with."""
    try:
        mesh = sources.load(path)
        master = occlusion.trace(mesh, params=occlusion.Params(grid=8, rays=64, proof=4))
        asset = compress.compress(master, params=compress.Params())
    except InputError as error:
        return str(error)
    assert np.isfinite(asset.decoded()).all(), path.name
    return "baked"


@pytest.mark.slow
@pytest.mark.skipif(not DATA, reason="BAKELIGHT_DATA names no folder of real meshes")
def test_nasty_meshes_bake_or_are_refused_in_one_line() -> None:
    found = {path.name: outcome(path) for path in NASTY}
    refused = {name: text for name, text in found.items() if text != "baked"}
    assert [name for name, text in refused.items() if "\n" in text or " -- " not in text] == []
    # Nine of 58 hold no triangles at all
    assert len(found) >= 50
    assert [name for name, text in refused.items() if "no triangles" not in text] == []
