"""When a world of cubes calls for baked light, gathered light, and light on meshes."""

from typing import Any

import pytest

from formats import effects, scene
from formats.errors import InputError

MOVES = {"times": [0, 1], "values": [[0, 1, 0], [1, 1, 0]]}
STILL = {"position": [0, 1, 0], "radiance": [1, 1, 1]}
LIGHTING = {"lightmap", "gather", "probe"}


def made(**parts: Any) -> scene.Scene:
    raw = {
        "format": 1,
        "camera": {"position": [0, 1, 10], "target": [0, 1, 0]},
        "voxels": {"source": "a.vox"},
        **parts,
    }
    raw = {name: part for name, part in raw.items() if part is not None}
    return scene.from_dict(raw, where="a.toml", root=None)


def cubes(**more: Any) -> scene.Scene:
    return made(voxels={"source": "a.vox", **more})


def called(found: scene.Scene) -> set[str]:
    return {effect.name for effect in effects.decide(found) if effect.called}


def lamp(**more: Any) -> scene.Scene:
    light = {"type": "sphere", "position": [0, 1, 0], "radius": 0.1, "radiance": [1, 1, 1]}
    return made(lights=[{**light, **more}])


def sky(**more: Any) -> scene.Scene:
    return made(lights=[{"type": "environment", "source": "a.exr", **more}])


@pytest.mark.parametrize(
    ("found", "moves"),
    [
        (cubes(), False),
        (cubes(lamps=[STILL]), False),
        (cubes(bodies=[{"name": "a", "source": "b.vox", "position": [0, 0, 0]}]), False),
        (sky(scale=2.0), False),
        (cubes(lamps=[STILL, {**STILL, "position": MOVES}]), True),
        (cubes(lamps=[{**STILL, "radiance": MOVES}]), True),
        (cubes(bodies=[{"name": "a", "source": "b.vox", "position": MOVES}]), True),
        (sky(scale={"times": [0, 1], "values": [1, 2]}), True),
        (lamp(), False),
        (lamp(position=MOVES), True),
        (lamp(radiance=MOVES), True),
        # Keys that never differ
        (sky(scale={"times": [0, 1], "values": [1, 1]}), False),
    ],
)
def test_light_of_cubes_is_gathered_only_where_something_changes(
    found: scene.Scene, moves: bool
) -> None:
    assert called(found) & LIGHTING == {"gather" if moves else "lightmap"}
    assert "voxels" in called(found)


@pytest.mark.parametrize("mesh", [{}, {"shadow": {}}, {"lighting": "transfer"}])
def test_light_of_cubes_is_called_for_where_a_mesh_stands(mesh: Any) -> None:
    stands = {"meshes": [{"name": "rock", "source": "rock.glb", **mesh}]}
    assert "probe" in called(made(**stands))
    assert "probe" not in called(made(**stands, voxels=None))
    # Nor for a mesh that is forced off
    force = {"surface": False, "transfer": False}
    off = {name: off for name, off in force.items() if name in called(made(**stands))}
    assert "probe" not in called(made(**stands, force=off))


def test_light_of_cubes_is_called_for_where_a_sprite_stands() -> None:
    def stands(**more: Any) -> dict[str, Any]:
        return {"billboards": [{"name": "a", "source": "a.glb", "height": 1.0, **more}]}

    here = stands(positions=[[0, 0, 0]])
    assert "probe" in called(made(**here))
    assert "probe" not in called(made())
    assert "probe" not in called(made(**here, voxels=None))
    assert "probe" not in called(made(**here, force={"billboard": False}))
    # Nor for a picture, which takes no light
    picture = {"billboards": [{**here["billboards"][0], "source": "a.png"}]}
    assert "probe" not in called(made(**picture))
    reason = next(e.reason for e in effects.decide(made(**here)) if e.name == "probe")
    assert reason == "1 sprite takes light of the cubes"


def test_cubes_forced_off_need_no_light() -> None:
    stands = {"meshes": [{"name": "rock", "source": "rock.glb", "shadow": {}}]}
    found = called(made(**stands, force={"voxels": False}))
    assert not found & {"voxels", *LIGHTING}


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize(("off", "other"), [("lightmap", "gather"), ("gather", "lightmap")])
def test_light_forced_off_comes_the_other_way(off: str, other: str, moves: bool) -> None:
    lamp = {**STILL, "position": MOVES if moves else [0, 1, 0]}
    voxels = {"source": "a.vox", "lamps": [lamp]}
    assert called(made(voxels=voxels, force={off: False})) & LIGHTING == {other}


def test_cubes_cannot_be_without_any_light() -> None:
    with pytest.raises(InputError, match=r"force\.lightmap.*either"):
        called(made(force={"lightmap": False, "gather": False}))


def test_a_light_that_cubes_may_hand_on_is_kept() -> None:
    faint = {"type": "sun", "to_light": [0, 1, 0], "irradiance": [1e-9, 1e-9, 1e-9]}
    alone = {"lights": [faint], "ground": {}}
    assert not effects.lights(made(**alone, voxels=None))[0].kept
    assert effects.lights(made(**alone))[0].kept


def test_cubes_take_so_many_lights() -> None:
    sun = {"type": "sun", "to_light": [0, 1, 0], "irradiance": [1, 1, 1]}
    assert "voxels" in called(made(lights=[sun] * 16))
    with pytest.raises(InputError, match="at most 16"):
        called(made(lights=[sun] * 17))


def test_the_talks_way_of_gathering_says_what_it_leaves_out() -> None:
    sun = {"type": "sun", "to_light": [0, 1, 0], "irradiance": [1, 1, 1]}
    for mode, says in (("exact", False), ("talk", True)):
        voxels = {"source": "a.vox", "mode": mode}
        plan = effects.decide(made(lights=[sun], voxels=voxels))
        assert "takes nothing" not in next(e.reason for e in plan if e.name == "voxels")
        moving = {**sun, "irradiance": {"times": [0, 1], "values": [[1, 1, 1], [2, 2, 2]]}}
        plan = effects.decide(made(lights=[moving], voxels=voxels))
        found = next(e.reason for e in plan if e.name == "voxels")
        assert ("takes nothing of 1 of [[lights]]" in found) is says
