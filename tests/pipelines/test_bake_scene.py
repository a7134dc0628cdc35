"""Baking a scene: what it may replace, and what it must not trust."""

import shutil
from pathlib import Path

import pytest

from formats import scene as scenes
from formats.errors import InputError
from pipelines.bake_scene import bake_scene, known_seconds
from pipelines.current import is_current


@pytest.mark.parametrize("content", ["file", "folder"])
def test_what_is_no_baked_scene_is_kept(assets: Path, tmp_path: Path, content: str) -> None:
    place = tmp_path / "build" / "scenes" / "plain"
    place.parent.mkdir(parents=True)
    if content == "folder":
        place.mkdir()
        (place / "letter.txt").write_text("dear")
    else:
        place.write_text("dear")
    with pytest.raises(InputError, match="not a baked scene"):
        bake_scene(assets / "scenes/plain.toml", build_folder=tmp_path / "build")
    assert (place / "letter.txt" if content == "folder" else place).read_text() == "dear"


def test_remains_of_a_baked_scene_are_replaced(assets: Path, tmp_path: Path) -> None:
    scene, build = assets / "scenes/plain.toml", tmp_path / "build"
    folder = bake_scene(scene, build_folder=build).folder
    for name in ("seal.json", "manifest.json"):
        (folder / name).unlink()
        bake_scene(scene, build_folder=build)
        assert (folder / name).is_file()


@pytest.mark.parametrize("text", ["", "{", "[1]", '{"seconds": "long"}', '{"seconds": -1}'])
def test_timings_are_not_sealed_and_not_trusted(assets: Path, tmp_path: Path, text: str) -> None:
    scene, build = assets / "scenes/plain.toml", tmp_path / "build"
    bake_scene(scene, build_folder=build)
    for timings in (build / "store").glob("*/timings.json"):
        timings.chmod(0o644)
        timings.write_text(text)
    assert bake_scene(scene, build_folder=build).baked == 0
    assert known_seconds(scenes.load(scene), build)("billboard/tent") == 0.0


def test_a_look_at_costs_makes_no_folder(assets: Path, tmp_path: Path) -> None:
    scene = scenes.load(assets / "scenes/plain.toml")
    assert known_seconds(scene, tmp_path / "build")("billboard/tent") is None
    assert not (tmp_path / "build").exists()


def test_another_root_is_another_scene(assets: Path, tmp_path: Path) -> None:
    path, build = assets / "scenes/plain.toml", tmp_path / "build"
    folder = bake_scene(path, build_folder=build).folder
    assert is_current(folder, scenes.load(path), path)
    other = tmp_path / "other"
    shutil.copytree(assets, other)
    assert not is_current(folder, scenes.load(path, other), path)


@pytest.mark.parametrize("what", ["scene", "source"])
def test_what_changes_during_a_bake_is_baked_again(assets: Path, tmp_path: Path, what: str) -> None:
    """The manifest holds the digests of before: those of after would call the old bake current."""
    path, build = assets / "scenes/plain.toml", tmp_path / "build"

    def edit(scene: scenes.Scene) -> scenes.Scene:
        file = path if what == "scene" else next(iter(scene.sources.values()))
        file.write_bytes(file.read_bytes() + (b"\n# more\n" if what == "scene" else b"\0\0\0\0"))
        return scene

    done = bake_scene(path, build_folder=build, adjust=edit)
    assert not is_current(done.folder, scenes.load(path), path)
    again = bake_scene(path, build_folder=build)
    assert is_current(again.folder, scenes.load(path), path)
