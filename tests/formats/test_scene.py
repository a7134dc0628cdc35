"""Scenes: whole files, refusals, scattering, and the reference page."""

import copy
import json
import runpy
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats import scene
from formats.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
SCENE = """
format = 1
time = { duration = 12.0, frame_rate = 24 }
quality = "draft"
[camera]
position = [0.5, 1.5, 7.5]
target = [-0.6, 1.9, 0.0]
lens = { f_number = 1.8, focus_distance = { times = [0, 5], values = [1.3, 7.2] } }
[[lights]]
type = "environment"
source = "environments/dusk.exr"
scale = [0.1, 0.2, 0.3]
[[lights]]
type = "sphere"
position = { times = [0, 6, 12], values = [[-3, 2, 1], [2, 2, 1], [-3, 2, 1]], loop = true }
radius = 0.18
radiance = [34.0, 15.0, 4.5]
[[lights]]
type = "sun"
to_light = { times = [0, 12], values = [[1, 0, 0], [0, 2, 0]] }
irradiance = [3, 2, 1]
[ground]
albedo = [0.1, 0.2, 0.1]
[[billboards]]
name = "oak"
source = "meshes/oak.glb"
height = 6.0
ring = { axis = "up", elevation = 20, lights = 32 }
positions = [[-2, 0, -1], [2, 0, -2]]
yaw = [0, 90]
[[billboards]]
name = "fern"
source = "meshes/fern.obj"
height = 0.5
scatter = { count = 50, seed = 3, box = [[-4, 0, -4], [4, 0, 4]], height = [0.8, 1.2] }
[picture]
sky = { zenith = [0.01, 0.014, 0.04], horizon = [0.09, 0.04, 0.055] }
fog = { extinction = 0.035, radiance = [0.05, 0.03, 0.045] }
film = { exposure = 1.0, tonemap = "linear" }
[force]
fog = false
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    for name in ("scenes/grove.toml", "meshes/oak.glb", "meshes/fern.obj", "environments/dusk.exr"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.touch()
    (tmp_path / "scenes" / "grove.toml").write_text(SCENE)
    return tmp_path / "scenes" / "grove.toml"


@pytest.fixture
def raw(file: Path) -> dict[str, Any]:
    return scene.load(file).raw


def refusal(raw: dict[str, Any]) -> InputError:
    with pytest.raises(InputError) as caught:
        scene.from_dict(raw, where="grove.toml", root=None)
    assert caught.value.file == "grove.toml"
    return caught.value


def test_a_whole_scene_loads(file: Path) -> None:
    found = scene.load(file)
    assert found.name == "grove"
    assert found.root == file.parents[1]
    assert found.time == scene.Time(duration=12.0, frame_rate=24.0)
    assert found.camera.focal_length_mm.at(0.0) == 50.0
    assert found.camera.lens is not None
    assert found.camera.lens.focus_distance.at(5.0) == 7.2
    environment, sphere, sun = found.lights
    assert isinstance(environment, scene.EnvironmentLight)
    assert environment.factor(0.0).tolist() == [0.1, 0.2, 0.3]
    assert isinstance(sphere, scene.Sphere)
    assert sphere.position.at(18.0).tolist() == [2.0, 2.0, 1.0]
    assert isinstance(sun, scene.Sun)
    # Half way between (1, 0, 0) and (0, 2, 0): (1, 2, 0) / sqrt(5), three roundings
    assert sun.direction(6.0) == pytest.approx([5**-0.5, 2 * 5**-0.5, 0.0], abs=1e-15)
    assert found.ground is not None
    assert found.ground.accent == found.ground.albedo == (0.1, 0.2, 0.1)
    assert found.picture.film.tonemap == "linear"
    assert found.force == {"fog": False}
    assert set(found.sources) == {"environments/dusk.exr", "meshes/oak.glb", "meshes/fern.obj"}
    assert all(path.is_absolute() for path in found.sources.values())


def test_quality_fills_what_is_left_open(file: Path, raw: dict[str, Any]) -> None:
    oak, fern = scene.load(file).billboards
    assert (oak.ring.lights, fern.ring.lights) == (32, 24)
    assert (oak.resolution, oak.samples) == (128, 4)
    raw["quality"] = "fine"
    raw["billboards"][0]["resolution"] = 100
    raw["billboards"][1]["ring"] = {"terms": 31}
    oak, fern = scene.from_dict(raw, where="a.toml", root=None).billboards
    assert (oak.resolution, oak.samples, fern.resolution) == (100, 8, 512)
    # Three lights a term are more than the quality's 48
    assert fern.ring.lights == 93
    # The quality's 9 terms; of 32 lights 10 have room
    assert (oak.ring.terms, oak.ring.lights) == (9, 32)


def test_the_raw_scene_survives_json_and_is_a_copy(file: Path, raw: dict[str, Any]) -> None:
    again = json.loads(json.dumps(raw))
    assert again == raw
    found = scene.from_dict(again, where="manifest.json", root=None, name="grove")
    assert found.name == "grove"
    again["quality"] = "fine"
    assert found.raw["quality"] == "draft"


def test_a_json_scene_is_the_same_scene(file: Path, raw: dict[str, Any]) -> None:
    other = file.with_name("copy.json")
    other.write_text(json.dumps(raw))
    assert scene.load(other).raw == raw


def test_the_least_scene_is_a_still_without_effects() -> None:
    raw = {"format": 1, "camera": {"position": [0, 1, 5], "target": [0, 1, 0]}}
    found = scene.from_dict(raw, where="a.toml", root=None)
    assert found.time.duration == 0.0
    assert (found.lights, found.billboards, found.ground) == ((), (), None)
    assert found.picture.sky is None
    assert found.picture.film.tonemap == "filmic"


def test_a_missing_file_and_other_endings_are_refused(tmp_path: Path) -> None:
    for name in ("none.toml", "none.yaml", "scenes"):
        with pytest.raises(InputError) as caught:
            scene.load(tmp_path / name, root=tmp_path)
        assert caught.value.file.endswith(name)


def test_a_scene_stands_in_a_folder_named_scenes_or_names_a_root(file: Path) -> None:
    other = file.parents[1] / "grove.toml"
    other.write_text(SCENE)
    with pytest.raises(InputError, match="--root"):
        scene.load(other)
    assert scene.load(other, root=file.parents[1]).root == file.parents[1]
    with pytest.raises(InputError, match="name a folder"):
        scene.load(other, root=file.parents[1] / "none")


def test_a_missing_source_is_named(file: Path) -> None:
    (file.parents[1] / "meshes" / "fern.obj").unlink()
    with pytest.raises(InputError) as caught:
        scene.load(file)
    assert caught.value.field == "billboards[1].source"
    assert "fern.obj" in caught.value.remedy


def test_a_name_that_no_folder_can_have_is_refused(file: Path) -> None:
    with pytest.raises(InputError, match="rename"):
        scene.load(file.rename(file.with_name("my grove.toml")))


FAULTS: list[tuple[tuple[Any, ...], Any, str, str]] = [
    (("format",), 2, "format", "from 1 to 1"),
    (("time", "frame_rate"), 0, "time.frame_rate", "from 0.1 to 1000"),
    (("camera", "target"), [0.5, 1.5, 7.5], "camera.target", "another point"),
    (("camera", "lens", "focus_distance"), 0.05, "camera.lens.focus_distance", "beyond"),
    (("camera", "len"), 1, "camera.len", "did you mean 'lens'?"),
    (("lights", 0, "type"), "cone", "lights[0].type", "use one of sun, sphere, disc, rectangle, p"),
    (("lights", 0, "source"), "environments/dusk.png", "lights[0].source", ".exr, .hdr"),
    (("lights", 1, "radiance"), [1, 1, -1], "lights[1].radiance[2]", "from 0 to"),
    (("lights", 2, "to_light"), [0, 0, 0], "lights[2].to_light", "away from 0"),
    (
        ("lights", 2, "to_light"),
        {"times": [0, 1], "values": [[1, 0, 0], [-1, 0, 0]]},
        "lights[2].to_light",
        "away from 0",
    ),
    (("billboards", 0, "name"), "fern", "billboards[1].name", "another name"),
    (("billboards", 0, "ring", "elevation"), 90, "billboards[0].ring.elevation", "from -85 to 85"),
    (("billboards", 0, "ring", "terms"), 4, "billboards[0].ring.terms", "odd number"),
    (("billboards", 0, "ring", "lights"), 14, "billboards[0].ring.lights", "at least 15"),
    (("billboards", 0, "ring", "terms"), 3, "billboards[0].packing", '"full"'),
    (("billboards", 0, "ring", "terms"), 33, "billboards[0].ring.terms", "from 1 to 31"),
    (("billboards", 0, "yaw"), [1], "billboards[0].yaw", "one a position, 2"),
    (("billboards", 0, "scatter"), {"count": 1, "box": [[0, 0, 0], [1, 1, 1]]},
     "billboards[0].positions", "either"),
    (("billboards", 1, "scatter", "box"), [[0, 0, 0], [-1, 0, 0]],
     "billboards[1].scatter.box", "the lower first"),
    (("billboards", 1, "scatter", "box"), [[0, 0, 0]], "billboards[1].scatter.box", "two corners"),
    (("billboards", 1, "scatter", "height"), [2, 1], "billboards[1].scatter.height", "lesser"),
    (("billboards", 1, "scatter", "count"), 100_001, "billboards[1].scatter.count", "100000"),
    (("billboards", 1, "scatter", "clearing"), {"centre": [0, 0], "radius": 9},
     "billboards[1].scatter.clearing", "smaller"),
    (("billboards", 1, "scatter", "tint"), float("nan"), "billboards[1].scatter.tint", "finite"),
    (("force", "flares"), True, "force.flares", "use one of"),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "value", "field", "remedy"), FAULTS, ids=lambda v: str(v)[:40])
def test_a_fault_is_named(
    raw: dict[str, Any], keys: tuple[Any, ...], value: Any, field: str, remedy: str
) -> None:
    table: Any = raw
    for key in keys[:-1]:
        table = table[key]
    table[keys[-1]] = value
    error = refusal(raw)
    assert error.field == field
    assert remedy in error.remedy


def test_talk_packing_has_five_terms(raw: dict[str, Any]) -> None:
    oak = raw["billboards"][0]
    oak["packing"] = "talk"
    assert scene.from_dict(raw, where="a.toml", root=None).billboards[0].packing == "talk"
    oak["ring"]["terms"] = 7
    assert refusal(raw).field == "billboards[0].packing"


def test_neither_positions_nor_scatter_is_refused(raw: dict[str, Any]) -> None:
    oak = copy.deepcopy(raw["billboards"][0])
    del oak["positions"], oak["yaw"]
    raw["billboards"] = [oak]
    assert refusal(raw).value == "neither"


def test_the_sun_may_swing_past_zero_but_not_through_it(raw: dict[str, Any]) -> None:
    keys = {"times": [0, 1], "values": [[1, 0, 0], [-1, 1e-3, 0]], "interpolation": "smooth"}
    raw["lights"][2]["to_light"] = keys
    sun = scene.from_dict(raw, where="a.toml", root=None).lights[2]
    assert isinstance(sun, scene.Sun)
    lengths = [np.linalg.norm(sun.direction(t)) for t in np.linspace(0, 1, 101)]
    # A quotient by a rounded square root of a rounded sum is within a few ulp of length 1
    assert np.allclose(lengths, 1.0, rtol=0, atol=4 * np.finfo(float).eps)


@pytest.mark.parametrize(
    ("interpolation", "refused"), [("linear", True), ("smooth", True), ("step", False)]
)
def test_the_camera_may_not_fly_through_its_target(
    raw: dict[str, Any], interpolation: str, refused: bool
) -> None:
    # It meets the target at a third of the way: between any two moments that a grid would look at
    values = [[0, 1, 2], [0, 1, -4]]
    position = {"times": [0, 7], "values": values, "interpolation": interpolation}
    raw["camera"] |= {"position": position, "target": [0, 1, 0]}
    if refused:
        with pytest.raises(InputError, match=r"camera\.target.*own position near"):
            scene.from_dict(raw, where="a.toml", root=None)
    else:
        scene.from_dict(raw, where="a.toml", root=None)
    raw["camera"]["target"] = [0, 1.01, 0]
    scene.from_dict(raw, where="a.toml", root=None)


def test_written_places_are_kept(file: Path) -> None:
    oak = scene.load(file).billboards[0].instances()
    assert oak.positions.tolist() == [[-2, 0, -1], [2, 0, -2]]
    assert oak.scale.tolist() == [1, 1]
    assert oak.yaw.tolist() == [0.0, np.pi / 2]
    assert oak.flip.tolist() == [False, False]
    assert oak.tint.tolist() == [[1, 1, 1], [1, 1, 1]]


def test_a_large_scene_loads_in_a_moment(file: Path, raw: dict[str, Any]) -> None:
    raw["billboards"][0]["positions"] = [[0.5, 0, 1]] * 100_000
    del raw["billboards"][0]["yaw"]
    started = time.perf_counter()
    scene.from_dict(raw, where="a.toml", root=None)
    # 0.1 s measured for 100,000 positions checked one by one; the rest is room for a busy machine
    assert time.perf_counter() - started < 2.0


def test_reading_a_scene_imports_nothing_slow() -> None:
    code = "import sys, formats.scene, formats.effects; print('\\n'.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "formats.scene" in loaded
    assert loaded & {"scipy", "rich", "trimesh", "embreex", "PIL", "moderngl", "OpenEXR"} == set()


def test_the_reference_page_is_that_of_the_schema(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    page = runpy.run_path(str(ROOT / "docs" / "scene_reference.py"))["page"]()
    remedy = "run .venv/bin/python docs/scene_reference.py"
    assert (ROOT / "docs" / "scene.md").read_text(encoding="utf-8") == page, remedy
    for field in ("`focus_distance`", "`irradiance`", "`clearing`", "`vignette`"):
        assert field in page
