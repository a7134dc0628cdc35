"""Worlds of cubes from scene files by the command line: bake, plan, render, and bake again."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from assets.voxels import vox_file
from formats.files import image
from formats.lightmap import Lightmap
from formats.voxels import Voxels
from pipelines.cli import run

PALETTE = {1: "#c0c0c0", 2: "#4080c0", 3: "#ffcc00"}
WORLD: dict[str, Any] = {
    "source": "voxels/yard.vox",
    "cell_size": 0.5,
    "texels": 1,
    "bounces": 1,
    "error": 0.2,
    "passes": 8,
    "emissive": {"3": [6.0, 4.0, 1.0]},
}
GO = {"times": [0, 1], "values": [[-0.5, 1.5, 0.25], [0.75, 1.5, 0.25]]}
MOVING = {
    **WORLD,
    "lamps": [{"position": GO, "radiance": [9.0, 3.0, 1.0]}],
    "bodies": [{"name": "door", "source": "voxels/door.vox", "position": GO}],
}
SKY = {"type": "environment", "source": "environments/even.hdr", "scale": 0.5}
Scenes = Callable[..., Path]


@pytest.fixture
def scene(assets: Path) -> Scenes:
    """Return write(name, ...) -> a scene file beside worlds of a few cells."""
    folder = assets / "voxels"
    folder.mkdir()
    # Of the file: (z up, y away, x)
    yard = np.zeros((5, 5, 6), np.uint8)
    yard[0], yard[1:3, 4], yard[3, 2, 1] = 1, 2, 3
    vox_file.write(folder / "yard.vox", [vox_file.Part(yard)], PALETTE)
    vox_file.write(folder / "door.vox", [vox_file.Part(np.full((2, 1, 1), 2, np.uint8))], PALETTE)

    def write(name: str = "yard", voxels: dict[str, Any] = WORLD, **parts: Any) -> Path:
        raw = {
            "format": 1,
            "quality": "draft",
            "time": {"duration": 1.0, "frame_rate": 4},
            "camera": {"position": [1.5, 2.5, 4.5], "target": [0, 0.6, 0]},
            "voxels": voxels,
            "picture": {"film": {"tonemap": "linear"}},
            **parts,
        }
        path = assets / "scenes" / f"{name}.json"
        path.write_text(json.dumps(raw))
        return path

    return write


@pytest.fixture
def command(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """Return run(words) -> (exit code, standard output, standard error)."""

    def ran(*words: object) -> tuple[int, str, str]:
        code = run([*map(str, words), "--build", str(tmp_path / "build")])
        said = capfd.readouterr()
        return code, said.out, said.err

    return ran


Command = Callable[..., tuple[int, str, str]]


def baked(command: Command, path: Path, *more: str) -> dict[str, bool]:
    """Bake; asset -> whether it was there already."""
    code, said, complaint = command("bake", path, "--json", *more)
    assert code == 0, complaint
    return {name: asset["hit"] for name, asset in json.loads(said)["assets"].items()}


def planned(command: Command, path: Path) -> tuple[set[str], list[str]]:
    code, said, _ = command("plan", path, "--json")
    assert code == 0
    plan = json.loads(said)
    assets = [asset["name"] for asset in plan["assets"]]
    return {effect["name"] for effect in plan["effects"] if effect["called"]}, assets


def test_a_still_world_is_baked_once(scene: Scenes, command: Command, tmp_path: Path) -> None:
    path = scene(lights=[SKY])
    called, assets = planned(command, path)
    assert called == {"environment", "lightmap", "voxels", "film"}
    # What light is made from comes first
    assert assets == ["environment/0", "voxels/world", "lightmap/world"]
    assert baked(command, path) == dict.fromkeys(assets, False)
    code, said, _ = command("bake", path)
    assert code == 0
    assert said.splitlines()[:3] == [f"{name}: up to date" for name in assets]
    # The plan knows then what each took, and says the same
    assert planned(command, path) == (called, assets)
    folder = tmp_path / "build/scenes/yard"
    manifest = json.loads((folder / "manifest.json").read_text())
    light = Lightmap.load(folder / manifest["assets"]["lightmap/world"])
    # Middle of the underside over the origin, y up: 6 x 4 x 5 cells of .5 m, and no air on top
    assert light.faces.origin == (-1.5, 0.0, -1.25)
    assert light.faces.grid == (6, 4, 5)
    assert light.irradiance.max() > np.pi * 0.5
    assert {"voxels/yard.vox", "environments/even.hdr"} <= {
        "/".join(Path(source).parts[-2:]) for source in manifest["sources"]
    }


def test_what_changes_is_baked_again_and_nothing_else(scene: Scenes, command: Command) -> None:
    lights = [SKY]
    baked(command, scene(lights=lights))
    glow = {**WORLD, "emissive": {"#FFCC00": [1.0, 1.0, 1.0]}}
    hits = baked(command, scene(voxels=glow, lights=lights))
    assert hits == {"environment/0": True, "voxels/world": False, "lightmap/world": False}
    # How it is lit or where it stands is no matter of its cells
    for change in ({"bounces": 0}, {"position": [1, 0, 0]}, {"error": 0.3}):
        hits = baked(command, scene(voxels={**glow, **change}, lights=lights))
        assert hits == {"environment/0": True, "voxels/world": True, "lightmap/world": False}
    assert all(baked(command, scene(voxels=glow, lights=lights)).values())
    # What only playing uses changes no light; nor does a scene's camera
    still = scene(voxels={**glow, "passes": 5, "mode": "sphere"}, lights=lights)
    assert all(baked(command, still).values())


def test_environments_that_add_nothing_are_neither_baked_nor_seen(
    scene: Scenes, command: Command
) -> None:
    dark = {**SKY, "scale": 0.0}
    both = scene(lights=[dark, SKY])
    assert baked(command, both) == dict.fromkeys(
        ("environment/1", "voxels/world", "lightmap/world"), False
    )
    # The light is that of the other alone
    assert baked(command, scene(lights=[SKY]))["lightmap/world"]
    assert not baked(command, scene())["lightmap/world"]
    off = scene(lights=[SKY], force={"environment": False})
    assert baked(command, off)["lightmap/world"]


def test_a_still_lamp_lights_what_is_baked(scene: Scenes, command: Command, tmp_path: Path) -> None:
    """Above all cells: the world grows to hold it."""
    dark = {**WORLD, "emissive": {}, "bounces": 0}
    lamp = {"position": [-0.25, 2.75, 0.0], "radiance": [9.0, 3.0, 1.0]}
    found = []
    for lamps in ([], [lamp]):
        path = scene(voxels={**dark, "lamps": lamps})
        assert baked(command, path)["lightmap/world"] is False
        folder = tmp_path / "build/scenes/yard"
        where = json.loads((folder / "manifest.json").read_text())["assets"]["lightmap/world"]
        found.append(Lightmap.load(folder / where).irradiance)
    assert not found[0].any()
    # Without bounces it has the lamp's colour, to rounding of half floats
    np.testing.assert_allclose(3 * found[1][..., 1], found[1][..., 0], rtol=2**-10, atol=1e-6)
    assert found[1].max() > 0.5


def test_lights_of_the_scene_light_what_is_baked(
    scene: Scenes, command: Command, tmp_path: Path
) -> None:
    """Each kind by itself, as it is at first; those left out do not."""
    dark = {**WORLD, "emissive": {}, "bounces": 0}
    place = {"position": [0.0, 4.0, 0.0], "radiance": [9.0, 3.0, 1.0]}
    flat = {**place, "facing": [0, -1, 0]}
    corners = [[-1, 4, 1], [-1, 4, -1], [1, 4, -1], [1, 4, 1]]
    lights: list[dict[str, Any]] = [
        {"type": "sun", "to_light": [1, 2, 0.5], "irradiance": [9.0, 3.0, 1.0]},
        {"type": "sphere", "radius": 0.5, **place},
        {"type": "disc", "radius": 0.5, **flat},
        {"type": "rectangle", "size": [1, 0.5], **flat},
        {"type": "polygon", "outline": corners[::-1], "radiance": [9.0, 3.0, 1.0]},
        {"type": "polygon", "outline": corners, "radiance": [9.0, 3.0, 1.0]},
        {"type": "sphere", "radius": 0.5, **place, "radiance": [0.0, 0.0, 0.0]},
    ]
    mean = []
    for light in lights:
        path = scene(voxels=dark, lights=[light])
        baked(command, path)
        folder = tmp_path / "build/scenes/yard"
        where = json.loads((folder / "manifest.json").read_text())["assets"]["lightmap/world"]
        found = Lightmap.load(folder / where).irradiance
        np.testing.assert_allclose(3 * found[..., 1], found[..., 0], rtol=2**-10, atol=1e-6)
        mean.append(float(found[..., 0].mean()))
    # One of both windings faces down
    assert sorted(m > 0.01 for m in mean[4:6]) == [False, True]
    assert min(mean[:4]) > 0.01
    assert mean[6] == 0
    # At first, where a light moves and the gather is forced off
    moving = {**lights[1], "radiance": {"times": [0, 1], "values": [[9, 3, 1], [0, 0, 0]]}}
    called, _ = planned(command, scene(voxels=dark, lights=[moving]))
    assert "gather" in called
    path = scene(voxels=dark, lights=[moving], force={"gather": False})
    baked(command, path)
    where = json.loads((folder / "manifest.json").read_text())["assets"]["lightmap/world"]
    assert Lightmap.load(folder / where).irradiance[..., 0].mean() == pytest.approx(mean[1])


def test_one_kind_is_baked_with_what_it_is_made_from(scene: Scenes, command: Command) -> None:
    hits = baked(command, scene(lights=[SKY]), "--only", "lightmap")
    assert hits == dict.fromkeys(("environment/0", "voxels/world", "lightmap/world"), False)
    hits = baked(command, scene(voxels=MOVING), "--only", "faces")
    assert hits == {"voxels/world": True, "voxels/door": False, "faces/world": False}
    assert baked(command, scene(), "--only", "voxels") == {"voxels/world": True}
    code, _, said = command("bake", scene(), "--only", "lamps")
    assert code == 2
    assert "lightmap" in said


def test_a_mesh_becomes_cubes_whose_materials_glow(
    scene: Scenes, command: Command, tmp_path: Path
) -> None:
    world = {**WORLD, "source": "meshes/tent.glb", "grid": 8, "emissive": {"cloth": [5, 2, 1]}}
    path = scene(voxels=world)
    assert not any(baked(command, path).values())
    folder = tmp_path / "build/scenes/yard"
    manifest = json.loads((folder / "manifest.json").read_text())
    cells = Voxels.load(folder / manifest["assets"]["voxels/world"])
    assert max(cells.size) == 8
    assert cells.emission.max(axis=0).tolist() == [5, 2, 1]


@pytest.mark.gpu
def test_stills_and_frames(scene: Scenes, command: Command, tmp_path: Path) -> None:
    path, moving = scene(lights=[SKY]), scene("moving", MOVING)
    called, assets = planned(command, moving)
    assert called == {"gather", "voxels", "film"}
    assert assets == ["voxels/world", "voxels/door", "faces/world"]
    for name, source, words in (
        ("still.png", path, []),
        ("later.png", moving, ["--time", "1"]),
        ("frames/", moving, ["--frames", "0:5"]),
        ("again/", moving, ["--frames", "0:5"]),
    ):
        code, _, said = command("render", source, "-o", tmp_path / name, "--size", "48x32", *words)
        assert code == 0, said
    still, later = (image.read(tmp_path / name) for name in ("still.png", "later.png"))
    # Floor, wall and lamp against nothing around them
    for picture in (still, later):
        assert picture[..., :3].max() > 0.1
        assert picture[0, 0, :3].max() < 0.01 < picture[..., :3].std()
    frames = sorted((tmp_path / "frames").iterdir())
    assert len(frames) == 5
    for frame in frames:
        assert frame.read_bytes() == (tmp_path / "again" / frame.name).read_bytes()
    pictures = [image.read(frame)[..., :3] for frame in frames]
    # The lamp and the door go from left to right
    weights = np.arange(48) * np.ones((32, 1))
    change = np.abs(pictures[-1] - pictures[0]).sum(axis=-1)
    assert change.max() > 0.1
    gone = np.maximum(pictures[0] - pictures[-1], 0).sum(axis=-1)
    came = np.maximum(pictures[-1] - pictures[0], 0).sum(axis=-1)
    assert (came * weights).sum() / came.sum() > (gone * weights).sum() / gone.sum()


LONG = {"times": [0, 1], "values": [[-0.5, 0, 0], [0.5, 0, 0]]}


@pytest.mark.parametrize(
    ("voxels", "named"),
    [
        ({"source": "voxels/gone.vox"}, ("voxels.source", "no such file")),
        ({"source": "../yard.vox"}, ("voxels.source", "without ..")),
        ({"source": "voxels/yard.txt"}, ("voxels.source", ".vox, .xraw")),
        ({"emissive": {"lamp": [1, 1, 1]}}, ("voxels.emissive.lamp", "#rrggbb")),
        ({"emissive": {"7": [1, 1, 1]}}, ("emissive", "no cell has it; there are 1 (#c0c0c0)")),
        ({"emissive": {"3": [1, 1]}}, ("voxels.emissive.3", "3 numbers")),
        (
            {"source": "meshes/tent.glb", "emissive": {"glass": [1, 1, 1]}},
            ("emissive", "the mesh's materials are cloth"),
        ),
        (
            {"bodies": [{"name": "a", "source": "voxels/door.vox", "position": [9, 0, 0]}]},
            ("bodies[0].position", "x -1.5 to 1.5"),
        ),
        (
            {"bodies": [{"name": "a", "source": "meshes/tent.glb", "position": [0, 0, 0]}]},
            ("voxels.bodies[0].source", ".vox, .xraw"),
        ),
    ],
)
def test_faults_are_one_line(
    scene: Scenes, command: Command, voxels: dict[str, Any], named: tuple[str, ...]
) -> None:
    code, said, complaint = command("bake", scene(voxels={**WORLD, **voxels}))
    assert (code, said) == (2, "")
    assert complaint.count("\n") == 1
    assert "Traceback" not in complaint
    for part in (*named, " -- "):
        assert part in complaint


def test_too_many_states_and_frames_are_one_line(
    scene: Scenes, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bake import cubes

    far = {"times": [0, 1], "values": [[-1.5, 0, 0], [1.5, 0, 0]]}
    voxels = {**MOVING, "bodies": [{**MOVING["bodies"][0], "position": far}]}
    endless = scene(voxels=voxels, time={"duration": 86400.0, "frame_rate": 1000})
    code, _, said = command("bake", endless)
    assert (code, said.count("\n")) == (2, 1)
    assert "time.duration" in said
    monkeypatch.setattr(cubes, "MAX_STATES", 3)
    code, _, said = command("bake", scene(voxels=voxels))
    assert (code, said.count("\n")) == (2, 1)
    assert "5 states" in said
