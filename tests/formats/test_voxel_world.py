"""The table of a world of cubes: names of what glows, frames of what moves, refusals."""

from typing import Any

import pytest

from formats import scene
from formats.errors import InputError
from formats.voxel_world import VoxelWorld, frame_of, last_frame


def world(**more: Any) -> VoxelWorld:
    raw = {
        "format": 1,
        "camera": {"position": [0, 1, 10], "target": [0, 1, 0]},
        "voxels": {"source": "a.vox", **more},
    }
    found = scene.from_dict(raw, where="a.toml", root=None).voxels
    assert found is not None
    return found


@pytest.mark.parametrize("key", ["1", "255", "042", "#00fFcc"])
def test_cells_glow_by_index_or_colour(key: str) -> None:
    assert world(emissive={key: [1, 2, 3]}).emissive == {key: (1.0, 2.0, 3.0)}


@pytest.mark.parametrize(
    "key",
    ["0", "256", "00256", "1.5", "-1", "#12345", "#12345g", "lamp", "\u0661", "1 "],
)
def test_other_names_are_refused_for_cells(key: str) -> None:
    with pytest.raises(InputError, match="from 1 to 255, or #rrggbb") as refused:
        world(emissive={key: [1, 1, 1]})
    assert refused.value.field == f"voxels.emissive.{key}"


@pytest.mark.parametrize("key", ["lamp", "Glas blau.001", "#lamp", "256", "\u706f", "x" * 64])
def test_the_materials_of_a_mesh_glow_by_name(key: str) -> None:
    assert world(source="a.glb", emissive={key: [1, 1, 1]}).emissive == {key: (1, 1, 1)}


@pytest.mark.parametrize("key", ["", "x" * 65, "a\nb", "\x1b[2J"])
def test_names_that_no_material_should_have_are_refused(key: str) -> None:
    with pytest.raises(InputError, match="1 to 64 letters on one line") as refused:
        world(source="a.glb", emissive={key: [1, 1, 1]})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("radiance", [[1, 2], 3.0, [1, 2, -1], [1, 2, float("nan")], "red"])
def test_radiances_are_three_numbers(radiance: Any) -> None:
    with pytest.raises(InputError, match=r"voxels\.emissive\.4"):
        world(emissive={"4": radiance})


@pytest.mark.parametrize(("names", "what"), [(("a", "a"), "another name"), (("world",), "whole")])
def test_parts_have_names_of_their_own(names: tuple[str, ...], what: str) -> None:
    bodies = [{"name": name, "source": "b.vox", "position": [0, 0, 0]} for name in names]
    with pytest.raises(InputError, match=what) as refused:
        world(bodies=bodies)
    assert refused.value.field == f"voxels.bodies[{len(names) - 1}].name"


@pytest.mark.parametrize("rate", [1.0, 24.0, 29.97, 1000.0])
@pytest.mark.parametrize("duration", [0.0, 0.3, 7.0, 86.4])
def test_every_frame_shows_itself(duration: float, rate: float) -> None:
    last = last_frame(duration, rate)
    assert last <= duration * rate + 1e-6 < last + 1
    for k in (0, 1, last // 3, last - 1, last):
        if 0 <= k <= last:
            assert frame_of(k / rate, duration, rate) == k / rate
            # The same in steps of a frame, whose sum rounds
            assert frame_of(sum([1 / rate] * min(k, 500)), duration, rate) == min(k, 500) / rate


def test_what_is_between_frames_shows_the_one_before() -> None:
    assert frame_of(0.2499, 1.0, 4.0) == 0.0
    assert frame_of(0.2501, 1.0, 4.0) == 0.25
    # An end between frames, and times outside
    assert [frame_of(t, 0.9, 4.0) for t in (0.9, 5.0, -3.0)] == [0.75, 0.75, 0.0]


def test_more_lamps_than_a_ray_should_look_at_are_refused() -> None:
    lamp = {"position": [0, 1, 0], "radiance": [1, 1, 1]}
    assert len(world(lamps=[lamp] * 16).lamps) == 16
    with pytest.raises(InputError, match="at most 16") as refused:
        world(lamps=[lamp] * 17)
    assert refused.value.field == "voxels.lamps"
