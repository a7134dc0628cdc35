"""Sprites of a scene by every way: mesh or photographs, ring or dome; and what is baked again."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake.store import Store
from formats import report
from formats import scene as scenes
from formats.dome import Dome
from formats.files import image
from pipelines import bake_sprites
from pipelines.bake_scene import SceneBake, bake_scene, keys_in_use, known_seconds
from pipelines.current import is_current
from pipelines.render_scene import render_scene

DUNE = """
[[billboards]]
name = "dune"
source = "meshes/tent.glb"
height = 1.0
resolution = 12
samples = 4
dome = { lights = 16, channels = 8, bands = 4, penalty = 0.1 }
positions = [[1, 0, -1]]
"""
BOWL = """
[[billboards]]
name = "bowl"
source = "photographs/bowl/set.lp"
height = 0.12
dome = { bands = 4, penalty = 0.1 }
positions = [[-0.1, 0.8, 3.5]]
"""
RIM = """
[[billboards]]
name = "rim"
source = "photographs/bowl/set.lp"
height = 0.5
ring = { elevation = 45, tolerance = 30 }
positions = [[0, 0, 0]]
"""
Made = Callable[[Path, str], Path]


@pytest.fixture(scope="module")
def made(writing_assets: Callable[[Path], Path], bowl: Callable[[Path], Path]) -> Made:
    """Writes a scene with a lens and these sets, beside its sources, into a folder."""

    def written(folder: Path, sets: str) -> Path:
        root = writing_assets(folder / "assets")
        bowl(root / "photographs/bowl")
        text = (root / "scenes/lens.toml").read_text()
        start, stop = text.index("[[billboards]]"), text.index("[picture]")
        path = root / "scenes/domes.toml"
        path.write_text(text[:start] + sets + text[stop:])
        return path

    return written


def baked(scene: Path) -> SceneBake:
    return bake_scene(scene, build_folder=scene.parents[2] / "build")


@pytest.fixture(scope="module")
def scene(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A mesh and photographs under domes, and photographs under a ring; not to be changed."""
    return made(tmp_path_factory.mktemp("all"), DUNE + BOWL + RIM)


@pytest.fixture(scope="module")
def done(scene: Path) -> SceneBake:
    return baked(scene)


def test_every_way_is_baked_once(scene: Path, done: SceneBake) -> None:
    kinds = {name: report.read(entry.path)["kind"] for name, entry in done.entries.items()}
    assert kinds == {
        "billboard/dune": "dome",
        "billboard/bowl": "dome",
        "billboard/rim": "billboard",
    }
    assert done.baked == 3
    assert baked(scene).baked == 0


def test_a_dome_of_a_scene_has_coverage_and_the_levels_of_the_lens(
    scene: Path, done: SceneBake
) -> None:
    bowl = Dome.load(done.folder / "assets" / done.entries["billboard/bowl"].key[:32])
    assert bowl.coverage
    # Eight numbers in draft, one of them coverage
    assert (bowl.channels, bowl.planes, bowl.views) == (7, 2, 1)
    loaded = scenes.load(scene)
    group = next(g for g in loaded.billboards if g.name == "bowl")
    wanted = bake_sprites.of_scene(loaded, group).steps[-1].params.max_lod
    assert wanted > 0
    assert bowl.max_lod == min(wanted, len(bowl.levels) - 1)
    # Inside its border a photograph is opaque
    border = bowl.quality["border"]
    inside = bowl.alpha()[border : border + 12, border : border + 12]
    assert np.all(inside[1:-1, 1:-1] == 1)


def test_a_changed_photograph_makes_the_scene_stale(made: Made, tmp_path: Path) -> None:
    scene = made(tmp_path, RIM)
    folder = baked(scene).folder
    assert is_current(folder, scenes.load(scene), scene)
    photograph = scene.parents[1] / "photographs/bowl/p7.png"
    image.write(photograph, 0.5 * image.read(photograph))
    assert not is_current(folder, scenes.load(scene), scene)
    assert baked(scene).baked == 1
    assert is_current(folder, scenes.load(scene), scene)


def test_a_knob_of_the_fit_renders_no_mesh_again(scene: Path, done: SceneBake) -> None:
    loaded = scenes.load(scene)
    store = Store(scene.parents[2] / "build/store")
    dune = bake_sprites.of_scene(loaded, loaded.billboards[0])
    assert [entry.hit for entry in bake_sprites.located(store, dune)] == [True, True]
    render, fit = dune.steps
    other = replace(fit, params=replace(fit.params, channels=12))
    found = bake_sprites.located(store, replace(dune, steps=(render, other)))
    assert [entry.hit for entry in found] == [True, False]


def test_costs_and_keys_count_every_stage(scene: Path, done: SceneBake) -> None:
    build = scene.parents[2] / "build"
    loaded, store = scenes.load(scene), Store(build / "store")
    for group in loaded.billboards:
        entries = bake_sprites.located(store, bake_sprites.of_scene(loaded, group))
        assert len(entries) == (1 if group.name == "bowl" else 2)
        seconds = known_seconds(loaded, build)(f"billboard/{group.name}")
        assert seconds == sum(entry.seconds for entry in entries) > 0
        assert {entry.key for entry in entries} <= keys_in_use(build)


def test_what_was_never_baked_has_no_cost(made: Made, tmp_path: Path) -> None:
    loaded = scenes.load(made(tmp_path, BOWL))
    (tmp_path / "build/store").mkdir(parents=True)
    assert known_seconds(loaded, tmp_path / "build")("billboard/bowl") is None


def test_domes_are_drawn(scene: Path, done: SceneBake, tmp_path: Path) -> None:
    text, build = scene.read_text(), scene.parents[2] / "build"
    pictures = []
    for name, left_out in (("all", ""), ("one", BOWL), ("none", DUNE)):
        other = scene.with_name(f"{name}.toml")
        other.write_text(text.replace(left_out, "") if left_out else text)
        render_scene(other, tmp_path / f"{name}.png", size="96x54", build_folder=build)
        pictures.append(image.read(tmp_path / f"{name}.png"))
    whole, without_bowl, without_dune = pictures
    # Measured: .41 and .35 of linear light where they stand
    assert np.abs(whole - without_bowl).max() > 0.1
    assert np.abs(whole - without_dune).max() > 0.1
