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
        # Keys that never differ
        (sky(scale={"times": [0, 1], "values": [1, 1]}), False),
    ],
)
def test_light_of_cubes_is_gathered_only_where_something_changes(
    found: scene.Scene, moves: bool
) -> None:
    assert called(found) & LIGHTING == {"gather" if moves else "lightmap"}
    assert "voxels" in called(found)


@pytest.mark.parametrize(
    ("mesh", "taking"),
    [({}, False), ({"shadow": {}}, True), ({"lighting": "transfer"}, True)],
)
def test_light_on_meshes_is_called_for_where_one_takes_harmonics(mesh: Any, taking: bool) -> None:
    stands = {"meshes": [{"name": "rock", "source": "rock.glb", **mesh}]}
    assert ("probe" in called(made(**stands))) is taking
    assert "probe" not in called(made(**stands, voxels=None))
    # Nor for a mesh that is forced off
    force = {"surface": False, "transfer": False}
    off = {name: off for name, off in force.items() if name in called(made(**stands))}
    assert "probe" not in called(made(**stands, force=off))


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
