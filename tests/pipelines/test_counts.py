"""What a scene does not call for is not imported, compiled, allocated or baked: counted."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from assets.voxels import vox_file
from formats.plan import FRAME

COUNT = """
import json, sys
from pathlib import Path
from pipelines.render_scene import render_scene
scene, out, build = map(Path, sys.argv[1:])
job = render_scene(scene, out, size="64x36", build_folder=build)
entries = (build / "store").iterdir()
baked = [path.name.split("-")[0] for path in entries if "-" in path.name]
print(json.dumps({
    "modules": sorted(name for name in sys.modules if name.split(".")[0] in ("runtime", "bake")),
    "hemispherical": sorted(name for name in sys.modules if "hemispherical" in name),
    "stages": sorted(baked), "profile": job.profile}))
"""
ALWAYS = {"sky", "billboard", "film"}


def counted(assets: Path, scene: str, build: Path, runs: int = 2) -> dict[str, Any]:
    """Bake and render a scene in a process of its own; then again, so that only playing counts."""
    path = assets / "scenes" / (scene if "." in scene else f"{scene}.toml")
    command = [sys.executable, "-c", COUNT, str(path), str(build / f"{path.stem}.png"), str(build)]
    for _ in range(runs):
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def passes(counts: dict[str, Any]) -> set[str]:
    prefix = "runtime.passes."
    return {m.removeprefix(prefix) for m in counts["modules"] if m.startswith(prefix)}


@pytest.fixture
def plain(assets: Path, tmp_path: Path) -> dict[str, Any]:
    return counted(assets, "plain", tmp_path / "plain")


@pytest.mark.gpu
@pytest.mark.parametrize(
    ("part", "effect", "programs", "stages"),
    [
        # A lens changes the program of the sprites; fog has one of its own besides
        ("lens", "depth_of_field", 0, []),
        ("fog", "fog", 1, []),
        ("environment", "environment", 0, ["bake.environment.resample"]),
        # Its own program and the one that averages samples
        ("surface", "surface", 2, ["bake.mesh.prepare"]),
    ],
)
def test_a_part_adds_exactly_its_own(
    assets: Path,
    tmp_path: Path,
    plain: dict[str, Any],
    part: str,
    effect: str,
    programs: int,
    stages: list[str],
) -> None:
    more = counted(assets, part, tmp_path / part)
    assert passes(plain) == ALWAYS
    assert passes(more) == ALWAYS | {effect}
    assert sorted(more["stages"]) == sorted(plain["stages"] + stages)
    assert more["profile"]["programs"] == plain["profile"]["programs"] + programs
    assert more["profile"]["textures"] == plain["profile"]["textures"]
    assert set(more["profile"]["passes"]) - set(plain["profile"]["passes"]) == {effect}


@pytest.mark.gpu
def test_playing_what_is_baked_imports_nothing_of_bake(plain: dict[str, Any]) -> None:
    assert not [name for name in plain["modules"] if name.startswith("bake")]
    # Nor what only a sprite under a dome needs
    assert "runtime.dome_series" not in plain["modules"]
    assert plain["hemispherical"] == []


@pytest.mark.gpu
def test_a_mesh_brings_its_own_modules_alone(
    assets: Path, tmp_path: Path, plain: dict[str, Any]
) -> None:
    more = counted(assets, "surface", tmp_path / "surface")
    added = set(more["modules"]) - set(plain["modules"])
    assert added == {"runtime.passes.surface", "runtime.surfaces", "runtime.light_uniforms"}
    profile = more["profile"]
    # Four samples of 8 bytes of colour and 4 of depth, 64 x 36 pixels
    assert profile["bytes"] - plain["profile"]["bytes"] == 4 * 12 * 64 * 36
    assert "resolve" in profile["milliseconds"]
    assert "resolve" not in plain["profile"]["milliseconds"]


BARE: dict[str, Any] = {
    "format": 1,
    "quality": "draft",
    "camera": {"position": [0, 1, 5], "target": [0, 0.5, 0]},
    "lights": [{"type": "sun", "to_light": [0.5, 0.6, 0.7], "irradiance": [3, 3, 3]}],
}
TENT = {"name": "tent", "source": "meshes/tent.glb", "height": 1.0, "resolution": 24, "samples": 4}
SPRITES = {"billboards": [{**TENT, "positions": [[0, 0, 0]]}]}
EMBERS = {
    "name": "embers",
    "emitter": {"rate": 9, "lifetime": [1, 2], "centre": [0, 0.5, 0]},
    "look": {"radius": 0.1},
}
LENS = {"camera": {**BARE["camera"], "lens": {"f_number": 0.8, "focus_distance": 2.0}}}
HOUSE = {"meshes": [{"name": "house", "source": "meshes/tent.glb"}]}
SKY = {"picture": {"sky": {"zenith": [0.1, 0.2, 0.5], "horizon": [0.6, 0.6, 0.6]}}}
LIGHTS = "runtime.light_uniforms"


@pytest.mark.gpu
@pytest.mark.parametrize(
    ("effect", "without", "added", "modules", "programs", "textures", "stages"),
    [
        # Both read or write the depth
        ("sky", {}, SKY, [], 1, 1, []),
        # What reaches the ground is a texture of its own
        ("ground", {}, {"ground": {}}, ["runtime.ground_shadows", LIGHTS], 1, 2, []),
        # The depth, the set's texture and the table of records
        (
            "billboard",
            {},
            SPRITES,
            ["runtime.sprite_shadows"],
            1,
            3,
            ["bake.billboard.trace", "bake.mips.pack"],
        ),
        # Discs bring the pass that draws sprites, but no texture beside its records
        (
            "particles",
            {},
            {"particles": [EMBERS]},
            ["runtime.passes.billboard", "runtime.particles"],
            1,
            2,
            [],
        ),
        # Meshes lit so are drawn by it, not by the surface pass; samples are averaged
        (
            "transfer",
            {},
            {"meshes": [{**HOUSE["meshes"][0], "lighting": "transfer"}]},
            ["runtime.surfaces", "runtime.incident", "runtime.light_harmonics"],
            2,
            1,
            ["bake.transfer.trace"],
        ),
        # A volume an end, and whose each pixel is, which the surfaces draw with a program more
        (
            "occlusion",
            {**HOUSE, "ground": {}},
            {"meshes": [{**HOUSE["meshes"][0], "shadow": {"grid": 8}}]},
            [
                *("runtime.casters", "runtime.incident"),
                *("runtime.light_harmonics", "runtime.shadow_light"),
            ],
            2,
            3,
            ["bake.compress.compress", "bake.occlusion.trace"],
        ),
        # Drawing fins and laying them over; a tent has straight edges and no fins, so no layer
        (
            "silhouette",
            HOUSE,
            {"meshes": [{**HOUSE["meshes"][0], "silhouette_width": 0.1}]},
            [],
            2,
            0,
            [],
        ),
        # Four layers, two of tiles, three sums, copies of colour and depth, the near layer's two
        ("defocus", {**LENS, **HOUSE, "force": {"defocus": False}}, {"force": {}}, [], 5, 14, []),
        # A copy of the picture
        ("radial_blur", SKY, {"picture": {**SKY["picture"], "radial_blur": {}}}, [], 1, 1, []),
        # Levels of 32 x 18 and 16 x 9
        ("bloom", SKY, {"picture": {**SKY["picture"], "bloom": {}}}, [], 2, 2, []),
    ],
)
def test_an_effect_adds_exactly_its_own_to_a_bare_scene(
    assets: Path,
    tmp_path: Path,
    effect: str,
    without: dict[str, Any],
    added: dict[str, Any],
    modules: list[str],
    programs: int,
    textures: int,
    stages: list[str],
) -> None:
    found = []
    for name, raw in (("less", {**BARE, **without}), ("more", {**BARE, **without, **added})):
        (assets / f"scenes/{name}.json").write_text(json.dumps(raw))
        found.append(counted(assets, f"{name}.json", tmp_path / name, runs=1))
    less, more = found
    new = {m for m in set(more["modules"]) - set(less["modules"]) if m.startswith("runtime")}
    own = {f"runtime.passes.{effect}", *modules}
    assert new == own
    assert passes(more) - passes(less) == {m.split(".")[-1] for m in own if ".passes." in m}
    assert sorted(more["stages"]) == sorted(less["stages"] + stages)
    assert more["profile"]["programs"] - less["profile"]["programs"] == programs
    assert more["profile"]["textures"] - less["profile"]["textures"] == textures
    assert effect in set(more["profile"]["passes"]) - set(less["profile"]["passes"])


@pytest.mark.gpu
def test_pictures_bring_no_light_and_one_program(assets: Path, tmp_path: Path) -> None:
    (assets / "pictures").mkdir()
    rgba = np.full((9, 7, 4), 255, np.uint8)
    sets = []
    for name in ("dot", "ring"):
        Image.fromarray(rgba).save(assets / f"pictures/{name}.png")
        where = {"source": f"pictures/{name}.png", "height": 0.5, "facing": "camera"}
        sets.append({"name": name, **where, "positions": [[0, 0, 0], [1, 0, 0]]})
    raw = {**BARE, "lights": [], "billboards": sets}
    (assets / "scenes/dots.json").write_text(json.dumps(raw))
    found = counted(assets, "dots.json", tmp_path / "dots")
    assert passes(found) == {"billboard", "film"}
    assert found["stages"] == ["bake.picture.prepare"] * 2
    profile = found["profile"]
    assert profile["programs"] == 2
    # Picture, colour, depth, one texture for both sets, their records
    assert profile["textures"] == 5
    assert profile["by_pass"]["billboard"]["draw_calls"] == 1
    assert not [m for m in found["modules"] if m in ("runtime.sprite_shadows", "bake")]


CUBES: dict[str, Any] = {
    "source": "voxels/step.vox",
    "texels": 1,
    "bounces": 0,
    "error": 0.2,
    "emissive": {"1": [1, 1, 1]},
}
GOES = {"times": [0, 1], "values": [[0, 1, 0], [0.5, 1, 0]]}
LAMPS = {"lamps": [{"position": GOES, "radiance": [3, 2, 1]}]}
BUST = {"meshes": [{**HOUSE["meshes"][0], "lighting": "transfer"}]}
GATHER = (
    *("gather", "gather_draws", "gather_error", "gather_schedule", "gather_targets"),
    "voxel_lamps",
    *("light_sights", "light_uniforms"),
)


@pytest.mark.gpu
@pytest.mark.parametrize(
    ("without", "voxels", "effects", "modules", "programs", "textures", "stages"),
    [
        # Depth, light, cells, their rows, and two palettes; nothing that follows rays
        (
            {},
            {},
            {"lightmap", "voxels"},
            {"runtime.surfaces"},
            2,
            6,
            ["bake.cubes.light", "bake.voxels.from_vox"],
        ),
        # Five programs of rays, one for lamps and one for samples; instead of baked light two
        # textures of places, two of pages, six of sums, two of what was shown, what is sent, light,
        # and lamps
        (
            {},
            LAMPS,
            {"gather", "voxels"},
            {"runtime.surfaces", *(f"runtime.{name}" for name in GATHER)},
            8,
            20,
            ["bake.cubes.light", "bake.voxels.from_vox"],
        ),
        # Rays, what they find, and two textures of pages, besides those of cubes
        (
            BUST,
            {},
            {"lightmap", "probe", "voxels"},
            {
                "runtime.gather_targets",
                "runtime.light_sights",
                "runtime.probe_glow",
                "runtime.voxel_lamps",
            },
            2,
            9,
            ["bake.cubes.light", "bake.voxels.from_vox"],
        ),
    ],
)
def test_cubes_add_exactly_what_lights_them(
    assets: Path,
    tmp_path: Path,
    without: dict[str, Any],
    voxels: dict[str, Any],
    effects: set[str],
    modules: set[str],
    programs: int,
    textures: int,
    stages: list[str],
) -> None:
    (assets / "voxels").mkdir()
    step = vox_file.Part(np.array([[[1, 1], [1, 1]], [[0, 0], [1, 1]]], np.uint8))
    vox_file.write(assets / "voxels/step.vox", [step], {1: "#808080"})
    found = []
    with_cubes = {"voxels": {**CUBES, **voxels}}
    for name, raw in (("less", {**BARE, **without}), ("more", {**BARE, **without, **with_cubes})):
        (assets / f"scenes/{name}.json").write_text(json.dumps(raw))
        found.append(counted(assets, f"{name}.json", tmp_path / name, runs=1))
    less, more = found
    new = {m for m in set(more["modules"]) - set(less["modules"]) if m.startswith("runtime")}
    own = {"runtime.cubes", "runtime.voxel_world", "runtime.voxel_blocks"}
    assert new == own | modules | {f"runtime.passes.{effect}" for effect in effects}
    assert passes(more) - passes(less) == effects
    assert sorted(more["stages"]) == sorted(less["stages"] + stages)
    assert more["profile"]["programs"] - less["profile"]["programs"] == programs
    assert more["profile"]["textures"] - less["profile"]["textures"] == textures
    assert set(more["profile"]["passes"]) - set(less["profile"]["passes"]) == effects


def test_every_effect_is_counted() -> None:
    here = {"environment", "surface", "ground", "sky", "occlusion", "fog", "defocus", "billboard"}
    here |= {"particles"}
    here |= {"silhouette", "radial_blur", "bloom", "voxels", "lightmap", "gather", "probe"}
    assert here | {"transfer"} | {"depth_of_field", "film"} == set(FRAME)
