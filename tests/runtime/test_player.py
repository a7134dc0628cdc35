"""The player: what a plan leaves out costs nothing; same time, same bytes; typed refusals."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bake import voxel_faces
from formats import seal
from formats.errors import DamagedError, InputError
from formats.lightmap import Lightmap
from formats.mesh import Material
from formats.picture import Picture
from formats.transfer import Layout, Transfer
from formats.voxel_world import MODES
from formats.voxels import Voxels
from runtime.layers import Layers
from runtime.passes import fog
from runtime.player import Player
from runtime.screen import Screen
from runtime.shader import Programs, compose
from tests.runtime import domes, shadow_truth

pytestmark = pytest.mark.gpu
ROOT = Path(__file__).resolve().parents[2]
EVEN = np.ones((8, 16, 3), np.float32)
FULL = {
    "ground": {"albedo": [0.2, 0.2, 0.2]},
    "picture": {
        "sky": {"zenith": [0.1, 0.2, 0.4], "horizon": [0.9, 0.6, 0.4], "glow": [1, 1, 1]},
        "fog": {"extinction": 0.01, "radiance": [0.5, 0.5, 0.5]},
        "radial_blur": {"strength": 0.2},
        "bloom": {"strength": 0.2},
    },
}
LENS = {"f_number": 1.4, "focus_distance": 4.0}
MAP = {"type": "environment", "source": "environments/e.hdr"}


def full_scene(kit, **without):
    """Every effect at once, but for those named."""
    raw = kit.scene_dict(**{k: v for k, v in FULL.items() if k not in without})
    raw["camera"]["lens"] = LENS
    raw["lights"].append(MAP)
    return raw


# code run in a process of its own: modules of passes, counts, hash of the frame
PROBE = """
import hashlib, json, sys
from runtime.player import Player
with Player(sys.argv[1], size=(96, 54)) as player:
    picture = player.frame(0.5)
    profile = player.profile
    names = [m for m in sys.modules if m.startswith("runtime.passes.")]
    print(json.dumps({
        "modules": sorted(n.rpartition(".")[2] for n in names),
        "programs": profile["programs"],
        "textures": profile["textures"],
        "bytes": profile["bytes"],
        "passes": profile["passes"],
        "domes": sorted(m for m in sys.modules if "dome" in m or "hemispherical" in m),
        "hash": hashlib.sha256(picture.tobytes()).hexdigest(),
        "heavy": sorted(
            {m.partition(".")[0] for m in sys.modules}
            & {"scipy", "embreex", "trimesh", "sklearn", "skimage", "OpenEXR", "PIL", "bake"}
        ),
    }))
"""


def probe(folder):
    """Play a scene in a fresh process."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE, str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_scene_without_effects_imports_compiles_and_allocates_none_of_them(kit, write_scene):
    assets = {"ball": kit.sphere_asset(size=16)}
    bare = probe(write_scene(kit.scene_dict(), assets, name="bare"))
    full = probe(write_scene(full_scene(kit), assets, environment=EVEN, name="full"))
    assert bare["modules"] == bare["passes"] == ["billboard", "film"]
    assert sorted(full["passes"]) == full["modules"]
    added = {"environment", "ground", "sky", "fog", "depth_of_field", "radial_blur", "bloom"}
    assert set(full["modules"]) - set(bare["modules"]) == added
    # ground: plane, shadow, contact; sky; fog; blur; bloom: down and up. Lens and map compile into
    # programs that exist
    assert full["programs"] - bare["programs"] == 8
    # ground: its target of shadows; blur: a copy; bloom: three levels. Nothing else has its own
    assert full["textures"] - bare["textures"] == 5
    levels = 48 * 27 + 24 * 14 + 12 * 7
    assert full["bytes"] - bare["bytes"] == (2 * 96 * 54 + levels) * 8
    assert full["heavy"] == bare["heavy"] == []
    assert full["domes"] == bare["domes"] == []


def test_a_dome_adds_its_own_modules_and_one_program(kit, write_scene):
    raw = kit.scene_dict()
    ring = probe(write_scene(raw, {"ball": kit.sphere_asset(size=16)}, name="ring"))
    both = {"ball": kit.sphere_asset(size=16), "bowl": domes.matt_ball(size=16)}
    bowl = {"name": "bowl", "source": "meshes/b.glb", "height": 1.0, "positions": [[1, 0, 0]]}
    more = probe(write_scene({**raw, "billboards": [*raw["billboards"], bowl]}, both, name="more"))
    assert ring["domes"] == []
    maths = ["maths.hemispherical_harmonics", "maths.hemispherical_lights"]
    assert more["domes"] == ["formats.dome", *maths, "runtime.dome_series"]
    assert more["programs"] - ring["programs"] == 1
    # Its own planes
    assert more["textures"] - ring["textures"] == 1
    assert more["modules"] == ring["modules"]
    assert more["heavy"] == []


@pytest.mark.parametrize(
    ("effect", "programs", "textures"),
    [
        ("environment", 0, 0),
        ("fog", 1, 0),
        ("sky", 1, 0),
        ("depth_of_field", 0, 0),
        ("ground", 3, 1),
        ("radial_blur", 1, 1),
        # Levels of 16 x 9 and 8 x 5
        ("bloom", 2, 2),
    ],
)
def test_leaving_one_effect_out_saves_exactly_its_own(
    kit, write_scene, ctx, monkeypatch, effect, programs, textures
):
    assets, raw = {"ball": kit.sphere_asset(size=16)}, full_scene(kit)
    called = kit.called_for(raw)
    profiles = []
    for name, wanted in (("all", called), ("less", tuple(e for e in called if e != effect))):
        folder = write_scene(raw, assets, environment=EVEN, called=wanted, name=name)
        with Player(folder, size=(32, 18), context=ctx) as player:
            player.frame(0.0)
            profiles.append(player.profile)
    full, less = profiles
    assert effect not in less["passes"]
    assert effect not in less["milliseconds"]
    assert full["programs"] - less["programs"] == programs
    assert full["textures"] - less["textures"] == textures


def test_the_same_time_gives_the_same_bytes_in_every_process(kit, write_scene, ctx):
    assets = {"ball": kit.sphere_asset(size=32)}
    raw = full_scene(kit)
    raw["billboards"] = [
        {
            "name": "ball",
            "source": "meshes/b.glb",
            "height": 0.4,
            "scatter": {"count": 200, "seed": 3, "box": [[-3, 0, -6], [3, 0, 2]], "tint": 0.3},
        }
    ]
    folder = write_scene(raw, assets, environment=EVEN)
    with Player(folder, size=(96, 54), context=ctx) as player:
        player.frame(3.0)
        here = hashlib.sha256(player.frame(0.5).tobytes()).hexdigest()
    assert probe(folder)["hash"] == here == probe(folder)["hash"]


def test_frame_and_linear_have_their_shapes_and_row_0_on_top(kit, write_scene, ctx):
    raw = kit.scene_dict(billboards=None, ground={"albedo": [1, 1, 1]})
    with Player(write_scene(raw, {}), size=(20, 10), context=ctx) as player:
        linear, picture = player.linear(0.0), player.frame(0.0)
    assert (linear.shape, linear.dtype) == ((10, 20, 4), np.float32)
    assert (picture.shape, picture.dtype) == ((10, 20, 4), np.uint8)
    assert picture[-1, :, 0].min() > picture[0, :, 0].max()
    assert picture.flags.c_contiguous
    assert picture.flags.writeable


def test_closing_frees_every_texture(kit, write_scene, ctx):
    folder = write_scene(full_scene(kit), {"ball": kit.sphere_asset(size=16)}, environment=EVEN)
    player = Player(folder, size=(16, 9), context=ctx)
    player.frame(0.0)
    assert player.targets.texture_count > 3
    player.close()
    assert player.targets.texture_count == 0


def test_a_resized_player_draws_at_the_new_size(kit, write_scene, ctx):
    folder = write_scene(full_scene(kit), {"ball": kit.sphere_asset(size=16)}, environment=EVEN)
    with Player(folder, size=(16, 9), context=ctx) as player:
        player.frame(0.0)
        player.targets.resize((40, 30))
        resized = player.frame(0.0)
    with Player(folder, size=(40, 30), context=ctx) as player:
        np.testing.assert_array_equal(player.frame(0.0), resized)


def test_a_set_without_instances_is_no_trouble(kit, write_scene, ctx):
    raw = full_scene(kit)
    raw["billboards"][0]["positions"] = []
    folder = write_scene(raw, {"ball": kit.sphere_asset(size=16)}, environment=EVEN)
    with Player(folder, size=(16, 9), context=ctx) as player:
        assert player.frame(0.0)[..., :3].max() > 0


# refusals


def test_a_folder_that_is_no_scene_is_refused(tmp_path):
    with pytest.raises(InputError, match="bakelight bake"):
        Player(tmp_path)


@pytest.mark.parametrize("size", [(0, 10), (10, -1), (10, 10**6)])
def test_impossible_sizes_are_refused(kit, write_scene, size):
    with pytest.raises(InputError, match="size"):
        Player(write_scene(kit.scene_dict(billboards=None), {}), size=size)


@pytest.mark.parametrize(
    "name", ["manifest.json", "assets/ball/planes.ktx2", "assets/ball/report.json"]
)
def test_a_changed_byte_is_never_shown(kit, write_scene, ctx, name):
    folder = write_scene(kit.scene_dict(), {"ball": kit.sphere_asset(size=16)})
    data = bytearray((folder / name).read_bytes())
    data[len(data) // 2] ^= 1
    (folder / name).write_bytes(data)
    with pytest.raises(DamagedError, match=Path(name).name):
        Player(folder, size=(8, 8), context=ctx)


def test_an_asset_that_the_manifest_lacks_is_named(kit, write_scene, ctx):
    folder = write_scene(kit.scene_dict(), {})
    with pytest.raises(DamagedError, match="billboard/ball"):
        Player(folder, size=(8, 8), context=ctx)


def test_a_manifest_of_another_format_is_refused(kit, write_scene, ctx):
    folder = write_scene(kit.scene_dict(), {"ball": kit.sphere_asset(size=16)})
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(manifest | {"format": 99}))
    seal.seal(folder)
    with pytest.raises(DamagedError, match="bake the scene again"):
        Player(folder, size=(8, 8), context=ctx)


# shaders


def shader_files(kit, write_scene, ctx, monkeypatch):
    """(file, defines) of every shader that the fullest and the barest scenes compile."""
    used = set()
    real = Programs.get

    def get(self, vertex, fragment, defines=None, vertex_defines=None):
        first = defines if vertex_defines is None else vertex_defines
        used.add((vertex, tuple(sorted((first or {}).items()))))
        used.add((fragment, tuple(sorted((defines or {}).items()))))
        return real(self, vertex, fragment, defines, vertex_defines)

    monkeypatch.setattr(Programs, "get", get)
    scenes = {"full": full_scene(kit), "bare": kit.scene_dict()}
    scenes["full"]["lights"].append(
        {"type": "sphere", "position": [0, 1, 0], "radius": 0.1, "radiance": [1] * 3}
    )
    near = {"radiance": [1] * 3, "facing": [0, -1, 0], "position": [0, 2, 0]}
    scenes["full"]["lights"] += [
        {"type": "disc", "radius": 0.1, **near},
        {"type": "rectangle", "size": [1, 1], **near},
    ]
    scenes["full"]["picture"]["film"] = {"tonemap": "linear", "grain": 2.0}
    # A mesh with a texture and colours, and a pass that reads all about it
    scenes["full"]["meshes"] = [
        {"name": "wall", "source": "meshes/wall.glb", "shadow": {}},
        {"name": "bust", "source": "meshes/bust.glb", "lighting": "transfer"},
    ]
    painted = Material(texture=np.ones((2, 2, 3), np.float32), emissive=(1.0, 1.0, 1.0))
    wall = kit.quad(painted, uv=np.zeros((6, 2)), colours=np.ones((6, 3)))
    codes = np.full((6, 32), 128, np.uint8)
    layout = Layout(np.ones(32, np.float32), np.ones((32, 1, 1)), np.eye(2, 3), 8)
    bust = Transfer(wall, codes, layout)
    shadow = shadow_truth.ball_volume(shadow_truth.small_box(), grid=4)
    monkeypatch.setattr(fog.Pass, "reads", ("depth", "position", "normal", "id"))
    for terms, packing, unpack in (
        (5, "twelve", "chroma"),
        (9, "twelve", "talk"),
        (11, "full", "chroma"),
    ):
        asset = kit.sphere_asset(size=16, terms=terms, packing=packing, unpack=unpack)
        for name, raw in scenes.items():
            environment = EVEN if name == "full" else None
            assets = {"ball": asset, "wall": wall, "bust": bust, "shadow-wall": shadow}
            folder = write_scene(raw, assets, environment=environment, name=f"{name}{terms}")
            with Player(folder, size=(8, 8), context=ctx) as player:
                player.frame(0.0)
    # Cubes, one of which glows, a lamp and a part that moves, by every way to follow rays
    cells = np.uint16([[[1, 1], [2, 0]]])
    grey = np.float32([[0] * 3, [0.5] * 3, [0.5] * 3])
    world = Voxels(cells, grey, np.float32([[0] * 3, [0] * 3, [1] * 3]), 0.5)
    lamp = {"position": [0, 1, 0], "radiance": [1, 1, 1]}
    way = {"times": [0, 1], "values": [[0, 0.5, 0], [1, 0.5, 0]]}
    part = {"name": "part", "source": "b.vox", "position": way}
    table = {"source": "a.vox", "cell_size": 0.5, "error": 1.0, "lamps": [lamp], "bodies": [part]}
    # The grid has room for the lamp: three cells high
    faces = voxel_faces.layout(np.pad(cells, ((0, 0), (0, 1), (0, 0))), texels=1, cell_size=0.5)
    dark = np.zeros((*faces.size[::-1], 3), np.float32)
    for mode in MODES:
        raw = {**scenes["full"], "voxels": {**table, "mode": mode}}
        light = Lightmap(dark, dark, faces)
        given = {**assets, "world": world, "part": world, "light": light}
        folder = write_scene(raw, given, environment=EVEN, name=f"cubes-{mode}")
        with Player(folder, size=(8, 8), context=ctx) as player:
            player.frame(0.0)
    Player(
        write_scene(kit.scene_dict(), {"ball": domes.matt_ball(size=16)}, name="dome"),
        size=(8, 8),
        context=ctx,
    ).close()
    # A picture with soft edges, and discs
    level = np.ones((1, 4, 4, 4), np.float16)
    picture = Picture((level,), 0.25, (2.0, 4.0), 1.0, 0.0, 0.45)
    dot = {"name": "dot", "source": "a.png", "height": 1.0, "softness": 0.1}
    emitter = {"rate": 9, "lifetime": [1, 1], "centre": [0, 0, 0]}
    embers = {"name": "embers", "emitter": emitter, "look": {"radius": 0.1}}
    raw = {**scenes["full"], "billboards": [{**dot, "positions": [[0, 0, 0]]}]}
    raw = {**raw, "particles": [embers]}
    # Fins, and the coverage that a layer of a frame takes
    raw |= {"meshes": [{**scenes["full"]["meshes"][0], "silhouette_width": 0.1}]}
    raw |= {"force": {"silhouette": True}}
    folder = write_scene(raw, {**assets, "dot": picture}, environment=EVEN, name="pictures")
    with Player(folder, size=(8, 8), context=ctx) as player:
        Layers(player, ("coverage",)).take(0.0)
    # What the window adds: the picture on the screen, and its panel
    Screen(ctx).release()
    window = Programs(ctx)
    window.get(ROOT / "runtime" / "gui.vert", ROOT / "runtime" / "gui.frag")
    window.release()
    return used


def test_every_shader_compiles_for_es_too(kit, write_scene, ctx, monkeypatch):
    if "GL_ARB_ES3_compatibility" not in ctx.extensions:
        pytest.skip("this driver compiles no ES 3.00 shaders in a desktop context")
    used = shader_files(kit, write_scene, ctx, monkeypatch)
    folder = ROOT / "runtime"
    files = {p for p in folder.rglob("*") if p.suffix in (".vert", ".frag")}
    assert {path for path, _ in used} == files
    trivial = {
        ".vert": "#version 300 es\nvoid main() { gl_Position = vec4(0.0); }\n",
        ".frag": "#version 300 es\nout highp vec4 c;\nvoid main() { c = vec4(1.0); }\n",
    }
    for path, defines in used:
        stages = dict(trivial)
        stages[path.suffix] = compose(path, dict(defines), "es").text
        # Inputs that the other stage does not write are a link error in ES: only compiling is asked
        try:
            ctx.program(vertex_shader=stages[".vert"], fragment_shader=stages[".frag"]).release()
        except Exception as error:
            assert "Linker failed" in str(error), f"{path.name}: {error}"  # noqa: PT017
