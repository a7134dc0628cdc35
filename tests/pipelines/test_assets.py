"""The committed assets are what their scripts write, and are fit to be baked."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bake import photographs
from formats import scene as scenes
from formats.files import glb, rgbe

ASSETS = Path(__file__).parents[2] / "assets"
MESHES = sorted(p.stem for p in (ASSETS / "meshes").glob("*.glb"))
LARGEST_FILE = 1_200_000
LARGEST_SUM = 9_500_000
# All of assets/: the meshes, .2 MB of them glowing mushrooms, .3 MB a bust on a plinth and .6 MB a
# cat and what hangs over a market; .9 MB of photographs under 48 lights (fewer pixels or lights
# would not show what a dome keeps); .3 MB of cubes; .6 MB of drawn cells; and text
LARGEST_ASSETS = 11_200_000
LARGEST_PHOTOGRAPHS = 900_000
PHOTOGRAPH_MEAN = 0.01  # measured: .0064


def script(monkeypatch: pytest.MonkeyPatch, folder: str, name: str) -> Any:
    """Import a script of assets/ as it runs: with its own folder first on the path."""
    monkeypatch.syspath_prepend(str(ASSETS / folder))
    for module in [m for m in sys.modules.values() if m is not None]:
        file = getattr(module, "__file__", None)
        if file and Path(file).parent == ASSETS / folder:
            monkeypatch.delitem(sys.modules, module.__name__)
    return importlib.import_module(name)


def test_every_mesh_has_its_maker(monkeypatch: pytest.MonkeyPatch) -> None:
    assert sorted(script(monkeypatch, "meshes", "make_meshes").MAKERS) == MESHES


@pytest.mark.parametrize("name", MESHES)
def test_mesh_is_written_again_byte_for_byte(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = script(monkeypatch, "meshes", "make_meshes").make(name, tmp_path)
    assert made.read_bytes() == (ASSETS / "meshes" / f"{name}.glb").read_bytes()


@pytest.mark.parametrize("name", MESHES)
def test_mesh_is_fit_to_be_baked(name: str) -> None:
    path = ASSETS / "meshes" / f"{name}.glb"
    assert path.stat().st_size < LARGEST_FILE
    for node in glb.read(path):
        for primitive in node.primitives:
            assert primitive.normals is not None
            assert primitive.colours is not None
            assert primitive.colours.dtype == np.uint8
            points, normals = primitive.positions.astype(np.float64), primitive.normals
            assert np.isfinite(points).all()
            # Components are rounded to 0.001: |n| is off by at most sqrt(3)/2 of that.
            assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 0.001
            assert points[:, 1].min() >= 0.0
            a, b, c = (points[primitive.indices[:, k]] for k in range(3))
            area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
            # Rounding to 0.1 mm may flatten a sliver, never a share that shows.
            assert (area > 0).mean() > 0.999
            # A baker takes the side from the winding: it must agree with the normals.
            winding = np.cross(b - a, c - a)
            agree = np.sum(winding * normals[primitive.indices].mean(axis=1), axis=1) > 0
            assert agree.mean() > 0.99


@pytest.mark.parametrize("name", ["bust", "plinth", "gallery_wall"])
def test_what_stands_in_the_museum_is_closed_and_turned_outwards(name: str) -> None:
    (part,) = primitives(ASSETS / "meshes" / f"{name}.glb")
    points, where = np.unique(part.positions, axis=0, return_inverse=True)
    faces = where.reshape(-1)[part.indices]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = dict(
        zip(*map(list, np.unique(edges @ [len(points), 1], return_counts=True)), strict=True)
    )
    assert set(count.values()) == {1}
    assert {b * len(points) + a for a, b in edges.tolist()} == set(count)
    a, b, c = (points[faces[:, k]].astype(np.float64) for k in range(3))
    assert np.sum(a * np.cross(b, c)) > 0


def test_bust_is_small_enough_for_light_a_vertex() -> None:
    path = ASSETS / "meshes" / "bust.glb"
    (part,) = primitives(path)
    assert 8_000 <= len(part.indices) <= 15_000
    assert path.stat().st_size < 300_000


def test_leaves_are_thin_and_bark_is_not() -> None:
    thin = {"leaf": True, "paper": True, "bark": False, "stone": False, "wood": False}
    thin |= dict.fromkeys(("cap", "gill", "stem", "wart", "light", "marble"), False)
    glow = [f"glow{part}" for part in ("", "_heart", "_near", "_far", "_edge", "_end")]
    thin |= dict.fromkeys((*glow, "hoop", "lacquer", "silk", "fur", "bud"), False)
    for name in MESHES:
        for node in glb.read(ASSETS / "meshes" / f"{name}.glb"):
            for primitive in node.primitives:
                assert primitive.material.double_sided == thin[primitive.material.name]


def test_meshes_stay_small_together() -> None:
    sizes = [(ASSETS / "meshes" / f"{name}.glb").stat().st_size for name in MESHES]
    assert len(sizes) >= 10
    assert sum(sizes) < LARGEST_SUM


def test_scenes_show_every_mesh_and_grove_bakes_no_texel_that_nobody_sees() -> None:
    grove = scenes.load(ASSETS / "scenes" / "grove.toml")
    camera = grove.camera
    eye, focal = camera.position.at(0.0), camera.focal_length_mm.at(0.0)
    pixels = 720 * focal / camera.sensor_height_mm  # of a metre at a metre, in 1280x720
    half_width = 640 / pixels
    largest: dict[str, float] = {}
    texels: dict[str, int] = {}
    for group in grove.billboards:
        box = np.ptp(np.concatenate([p.positions for p in primitives(group.source)]), axis=0)
        longer = group.height * max(box[0], box[1]) / box[1]
        placed = group.instances()
        depth = eye[2] - placed.positions[:, 2]
        # A crown may reach into the picture from a metre beside it
        aside = np.abs(placed.positions[:, 0] - eye[0]) - 1.0
        seen = (depth > 1.0) & (aside < half_width * depth)
        size = float((pixels * longer * placed.scale[seen] / depth[seen]).max())
        name = group.source.stem
        largest[name] = max(largest.get(name, 0.0), size)
        texels[name] = max(texels.get(name, 0), group.resolution)
    names = ("glowcaps", "bust", "lantern")
    others = [scenes.load(ASSETS / "scenes" / f"{name}.toml") for name in names]
    placed_whole = {mesh.source.stem for scene in others for mesh in scene.meshes}
    sprites = {group.source.stem for scene in others for group in scene.billboards}
    assert sorted({*largest, *placed_whole, *sprites}) == MESHES
    # A quarter more than the pixels of the nearest sprite is reserve enough for its filter
    assert {name: texels[name] for name in texels if texels[name] > 1.25 * largest[name]} == {}


def primitives(path: Path) -> list[glb.Primitive]:
    """List the primitives of all nodes of a mesh."""
    return [primitive for node in glb.read(path) for primitive in node.primitives]


def test_sky_is_written_again_byte_for_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sky = script(monkeypatch, "environments", "make_sky").soft_sky()
    rgbe.write(tmp_path / "sky.hdr", sky)
    committed = ASSETS / "environments" / "soft_sky.hdr"
    assert (tmp_path / "sky.hdr").read_bytes() == committed.read_bytes()
    assert sky.shape == (64, 128, 3)
    assert (sky > 0).all()
    # Neutral: the mean of the upper half is grey to 2 %, so that a scale alone gives the tint.
    above = sky[:32].mean(axis=(0, 1))
    assert np.abs(above / above.mean() - 1).max() < 0.02


def test_photographs_are_as_many_and_as_large_as_their_script_makes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    maker = script(monkeypatch, "photographs", "make_photographs")
    made = maker.make(tmp_path, size=16, samples=1, grid=161)
    committed = ASSETS / "photographs" / "ammonite"
    assert made.read_bytes() == (committed / "lights.lp").read_bytes()
    names = sorted(file.name for file in committed.iterdir())
    assert sorted(file.name for file in tmp_path.iterdir()) == names
    taken = photographs.load(committed / "lights.lp", space="stored")
    assert taken.pictures.shape == (48, maker.SIZE, maker.SIZE, 3)
    np.testing.assert_allclose(taken.directions, maker.lights(), atol=2e-6)
    small = photographs.load(made, space="stored")
    assert small.pictures.shape == (48, 16, 16, 3)
    # The same fossil: means of a photograph differ by one ray a pixel and by what JPEG rounds
    means = [p.pictures.mean(axis=(1, 2, 3)) for p in (taken, small)]
    assert np.abs(means[0] - means[1]).max() < PHOTOGRAPH_MEAN


def test_photographs_are_lit_well_and_small() -> None:
    folder = ASSETS / "photographs" / "ammonite"
    assert sum(file.stat().st_size for file in folder.iterdir()) < LARGEST_PHOTOGRAPHS
    taken = photographs.load(folder / "lights.lp", space="stored")
    # Highlights are points: under 1 % of a picture reaches the top code in any channel
    assert np.mean(taken.pictures.max(axis=-1) >= 254 / 255, axis=(1, 2)).max() < 0.01
    # The lowest lamp leaves half of the slab readable, the highest burns nothing out
    brightness = taken.pictures.mean(axis=(1, 2, 3))
    assert 0.15 < brightness.min() < 0.3 < brightness.max() < 0.6


def test_assets_stay_small_together() -> None:
    files = [f for f in ASSETS.rglob("*") if f.is_file() and "__pycache__" not in f.parts]
    assert sum(f.stat().st_size for f in files) < LARGEST_ASSETS


def test_cubes_are_written_again_byte_for_byte(tmp_path: Path) -> None:
    folder = ASSETS / "voxels"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(ASSETS.parent), str(folder)))}
    command = [sys.executable, str(folder / "make_voxels.py"), "--to", str(tmp_path)]
    subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
    made = sorted(path.name for path in tmp_path.iterdir())
    assert made == sorted(path.name for path in folder.glob("*.vox"))
    for name in made:
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()
