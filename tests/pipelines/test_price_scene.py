"""A scene by price: knobs for each asset, one error for all, and what a plan tells before."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from formats import scene as scenes
from pipelines import cli, price_kept, price_plan
from pipelines import plan as plans
from pipelines.price import Ask

TEXT = """
format = 1
quality = "draft"

[camera]
position = [0.0, 1.0, 5.0]
target = [0.0, 0.5, 0.0]

[[lights]]
type = "sphere"
position = [2.0, 3.0, 2.0]
radius = 0.4
radiance = [9.0, 9.0, 9.0]

[ground]
albedo = [0.4, 0.4, 0.4]

[[billboards]]
name = "steps"
source = "steps.obj"
height = 1.0
resolution = 24
ring = { lights = 16 }
positions = [[-1.0, 0.0, 0.0]]

[[meshes]]
name = "steps"
source = "steps.obj"
position = [0.7, 0.0, 0.0]
shadow = { grid = 8 }
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A scene of one sprite and one mesh with a shadow, both of three steps."""
    lines, faces = [], []
    for n in range(3):
        low, high = np.array([-0.5, 0, -0.5 + n / 3]), np.array([0.5, (n + 1) / 3, 0.5])
        corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
        for c in corners:
            x, y, z = np.where(c, high, low)
            lines.append(f"v {x:.4f} {y:.4f} {z:.4f}")
        quads = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
        faces += ["f " + " ".join(str(8 * n + i) for i in quad) for quad in quads]
    (tmp_path / "steps.obj").write_text("\n".join(lines + faces) + "\n")
    found = tmp_path / "scenes" / "steps.toml"
    found.parent.mkdir()
    found.write_text(TEXT)
    return found


def test_chosen_knobs_are_the_scene_s(path: Path) -> None:
    scene = scenes.load(path)
    knobs = {
        "billboard/steps": {"samples": 7, "terms": 9, "lights": 32},
        "occlusion/steps": {"rays": 99, "l_max": 3, "components": 12},
    }
    changed = price_kept.applied(scene, knobs)
    group, mesh = changed.billboards[0], changed.meshes[0]
    assert group.ring is not None
    assert mesh.shadow is not None
    assert (group.samples, group.ring.terms, group.ring.lights) == (7, 9, 32)
    assert (mesh.shadow.rays, mesh.shadow.l_max, mesh.shadow.components) == (99, 3, 12)


def test_photographs_under_a_dome_have_a_price() -> None:
    group = {"name": "shell", "source": "shell.lp", "height": 1, "positions": [[0, 0, 0]]}
    camera = {"position": [0, 1, 5], "target": [0, 1, 0]}
    raw = {"format": 1, "camera": camera, "billboards": [group]}
    scene = scenes.from_dict(raw, where="a.toml", root=None)
    assert price_plan.has_price(scene, "billboard/shell")
    dome = price_kept.applied(scene, {"billboard/shell": {"channels": 9}}).billboards[0].dome
    assert dome is not None
    assert dome.channels == 9
    raw["billboards"] = [{**group, "ring": {"elevation": 45}}]
    assert not price_plan.has_price(scenes.from_dict(raw, where="a.toml", root=None),
                                    "billboard/shell")  # fmt: skip


def test_knobs_that_no_longer_fit_are_left(path: Path) -> None:
    scene = scenes.load(path)
    gone = {
        "billboard/steps": {"samples": 3, "lights": 40, "channels": 8},  # was a dome
        "transfer/other": {"rays": 8},
        "lightmap/world": {"error": 0.1},
    }
    changed = price_kept.applied(scene, gone)
    assert changed.billboards[0].samples == 3
    assert changed.meshes == scene.meshes


def test_plan_says_whether_a_probe_or_a_prior_speaks(path: Path, tmp_path: Path) -> None:
    scene = scenes.load(path)
    found = price_plan.offers(scene, plans.build(scene), tmp_path / "b", Ask(0.3))
    assert {offer.asset for offer in found} == {"billboard/steps", "occlusion/steps"}
    assert {offer.origin for offer in found} == {"prior"}
    assert not (tmp_path / "b").exists()


def test_scene_by_error(path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [str(path), "--build", str(tmp_path / "b"), "--json"]
    assert cli.run(["bake", *words, "--target-error", "0.35"]) == 0
    told = json.loads(capsys.readouterr().out)
    assets = told["price"]["assets"]
    assert set(assets) == {"billboard/steps", "occlusion/steps"}
    # Never above twice the target
    assert all(asset["reached_error"] <= 0.7 for asset in assets.values())
    manifest = json.loads((Path(told["folder"]) / "manifest.json").read_text())
    assert manifest["price"] == assets
    # What was probed is told by the plan, from then on
    assert cli.run(["plan", *words, "--target-error", "0.35"]) == 0
    offers = json.loads(capsys.readouterr().out)["prices"]
    assert {offer["from"] for offer in offers} == {"probe"}
    points = {offer["asset"]: offer["point"]["knobs"] for offer in offers}
    assert points == {name: asset["knobs"] for name, asset in assets.items()}
    # Baked again, as a window does, it keeps these knobs, and tells nothing as measured
    again = price_kept.bake_again(path, root=None, build_folder=tmp_path / "b")
    assert again.baked == 0
    kept = price_kept.of_folder(again.folder)
    assert {name: deal["knobs"] for name, deal in kept.items()} == points
    manifest = json.loads((again.folder / "manifest.json").read_text())
    assert "reached_error" not in manifest["price"]["billboard/steps"]


def test_scene_out_of_reach(path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["bake", str(path), "--build", str(tmp_path / "b")]
    assert cli.run([*words, "--budget", "1e-3"]) == 2
    assert "the least is" in capsys.readouterr().err
    assert cli.run([*words, "--budget", "9", "--only", "billboard"]) == 2
    assert "--only" in capsys.readouterr().err
