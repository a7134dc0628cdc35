"""Reports of baked assets, as plans take them."""

import json
from pathlib import Path

import pytest

from formats import scene as scenes
from pipelines import bake_scene, reports
from pipelines.bake_scene import known_reports

FAINT = """[[lights]]
type = "sphere"
position = [0, 5, 900]
radius = 0.1
radiance = [1, 1, 1]
[[lights]]
type = "environment"
source = "environments/even.hdr"
scale = 1e-9
"""


def test_a_bake_measures_and_leaves_out_what_adds_nothing(assets: Path, tmp_path: Path) -> None:
    path = assets / "scenes/surface.toml"
    path.write_text(path.read_text().replace("[[meshes]]", FAINT + "[[meshes]]"))
    scene = scenes.load(path)
    assert known_reports(scene, tmp_path) == {}
    done = bake_scene.bake_scene(path, build_folder=tmp_path)
    known = known_reports(scene, tmp_path)
    assert set(known) == {"billboard/tent", "mesh/house", "environment/2"}
    # A tent as wide as high on 24 texels, and its border
    assert min(known["billboard/tent"]["size"]) > 24
    assert [light.kept for light in done.plan.lights] == [True, False, False]
    assert "environment" not in done.plan.called
    manifest = json.loads((done.folder / "manifest.json").read_text())
    assert set(manifest["assets"]) == {"billboard/tent", "mesh/house"}
    assert [light["kept"] for light in manifest["plan"]["lights"]] == [True, False, False]


def test_what_cannot_be_read_is_not_known(tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text("{")
    gone = tmp_path / "gone"
    assert reports.of_entries([("mesh/a", tmp_path), ("mesh/b", gone)]) == {}


@pytest.mark.gpu
def test_the_player_takes_the_lights_that_are_kept(assets: Path, tmp_path: Path) -> None:
    from runtime.player import Player

    path = assets / "scenes/environment.toml"
    text = path.read_text()
    path.write_text(text.replace('[[lights]]\ntype = "sun"', FAINT + '[[lights]]\ntype = "sun"'))
    folder = bake_scene.bake_scene(path, build_folder=tmp_path).folder
    with Player(folder, size=(16, 9)) as player:
        assert [light.type for light in player.scene.lights] == ["sun", "environment"]
        # Maps follow their light's new number
        assert list(player.folders("environment")) == ["1"]
        assert player.passes["environment"].ambient(player.lights).min() > 0.0
        player.frame(0.0)


@pytest.mark.gpu
def test_a_picture_of_more_lines_than_the_plan_gets_the_lens(assets: Path, tmp_path: Path) -> None:
    from runtime.player import Player

    path = assets / "scenes/plain.toml"
    lens = "target = [0, 0.5, 0]\nlens = { f_number = 64, focus_distance = 3.0 }"
    path.write_text(path.read_text().replace("target = [0, 0.5, 0]", lens))
    done = bake_scene.bake_scene(path, build_folder=tmp_path)
    effect = next(e for e in done.plan.effects if e.name == "depth_of_field")
    assert not effect.called
    assert effect.bound is not None
    enough = int(1080 * 0.5 / effect.bound) + 1
    assert enough > 1080
    for lines, called in ((enough - 1, False), (enough, True)):
        with Player(done.folder, size=(1, lines)) as player:
            assert ("depth_of_field" in player.called) is called


@pytest.mark.gpu
def test_one_who_looks_around_sees_what_the_scene_does_not(assets: Path, tmp_path: Path) -> None:
    from runtime.player import Player

    path = assets / "scenes/plain.toml"
    down = path.read_text().replace("target = [0, 0.5, 0]", "target = [0, 0, 4.9]")
    path.write_text(down.replace("[picture]", "[ground]\n[picture]"))
    folder = bake_scene.bake_scene(path, build_folder=tmp_path).folder
    for roaming in (False, True):
        with Player(folder, size=(8, 4), roaming=roaming) as player:
            assert ("sky" in player.called) is roaming
            player.frame(0.0)
