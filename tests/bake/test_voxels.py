"""Worlds of cubes from voxel files: axes, colours, what glows."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bake import voxels
from bake.voxels import MeshParams, Params
from formats.errors import InputError
from formats.files import vox, xraw
from formats.mesh import Material, Mesh
from formats.voxels import Voxels
from maths.colour import srgb_decode
from tests.bake import stage_battery
from tests.formats import vox_bytes as b

SHADES = ((255, 0, 51), (0, 255, 255), (128, 128, 128), (255, 255, 255))
CELLS = [(0, 0, 0, 1), (2, 0, 0, 2), (0, 1, 3, 3)]


def file(*parts: bytes) -> vox.VoxFile:
    model = b.model((3, 2, 4), CELLS)
    return vox.decode(b.whole(model, b.colours(*SHADES), *parts), "a.vox")


def bake(*parts: bytes, **knobs: object) -> Voxels:
    return voxels.from_vox(file(*parts), params=Params(**knobs))  # type: ignore[arg-type]


def rows_by_place(world: Voxels) -> dict[tuple[float, ...], int]:
    """Return row by the middle of the cell, metres."""
    found = {}
    for k, j, i in np.argwhere(world.cells).tolist():
        middle = np.array(world.origin) + world.cell_size * (np.array([i, j, k]) + 0.5)
        found[tuple(np.round(middle, 9).tolist())] = int(world.cells[k, j, i])
    return found


def test_axes_turn_z_up_to_y_up() -> None:
    """(x, y, z) there is (x, z, -y) here; the file's model stands around its pivot (1, 1, 2), on
    z = 0."""
    expected = {}
    for x, y, z, row in CELLS:
        p = np.array([x - 1, y - 1, z]) + 0.5
        expected[tuple((0.5 * np.array([p[0], p[2], -p[1]])).tolist())] = row
    world = bake(cell_size=0.5)
    assert rows_by_place(world) == expected
    assert world.size == (3, 4, 2)


def test_a_placed_model_stands_where_the_file_says() -> None:
    parts = [b.transform(0, 1, [b.table(_t="10 20 30")]), b.shape(1, 0)]
    plain, moved = bake(cell_size=2.0), bake(*parts, cell_size=2.0)
    # Without a graph the model's pivot is 2 cells above the ground
    shift = np.array(moved.origin) - np.array(plain.origin)
    assert shift.tolist() == [20.0, 2 * (30 - 2), -40.0]
    assert np.array_equal(moved.cells, plain.cells)


def test_rows_are_the_editor_s_indices_and_albedo_is_linear() -> None:
    world = bake()
    assert world.albedo.shape == (256, 3)
    expected = np.minimum(srgb_decode(np.array(SHADES) / 255), 0.98).astype(np.float32)
    assert np.array_equal(world.albedo[1:5], expected)
    assert not world.albedo[0].any()
    assert world.quality == {
        "solid": 3,
        "glowing": 0,
        "colours": 3,
        "notes": ["2 colours are brighter than albedo 0.98, the most that light can end in"],
    }


def test_emission_of_materials() -> None:
    """Linear colour times weight times 10^flux times the scale; unused colours send out nothing."""
    glow = b.material(3, _type="_emit", _emit="0.5", _flux="2")
    unused = b.material(4, _type="_emit")
    world = bake(glow, unused, emission_scale=3.0)
    expected = srgb_decode(np.array(SHADES[2]) / 255) * (0.5 * 10**2 * 3.0)
    # Float32 rounds by half of 2^-23
    assert world.emission[3] == pytest.approx(expected, rel=6e-8)
    assert np.count_nonzero(world.emission.any(axis=1)) == 1
    assert world.quality["glowing"] == 1


@pytest.mark.parametrize("key", ["3", "#808080", "#808080".upper()])
def test_what_is_marked_glows(key: str) -> None:
    world = bake(emissive=((key, (9.0, 4.0, 1.0)),))
    assert world.emission[3].tolist() == [9.0, 4.0, 1.0]
    assert world.quality["glowing"] == 1
    times = bake(emissive=((key, (2.0,)),))
    assert times.emission[3] == pytest.approx(2 * srgb_decode(np.array(SHADES[2]) / 255), rel=6e-8)


def test_what_is_marked_replaces_the_file_s_emission() -> None:
    glow = b.material(3, _type="_emit")
    assert not bake(glow, emissive=(("3", (0.0,)),)).emission.any()
    twice = (("#808080", (5.0,)), ("3", (1.0, 2.0, 3.0)))
    assert bake(glow, emissive=twice).emission[3].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("key", ["4", "0", "256", "-1", "1.0", "#80808", "#fffffe", "lamp", ""])
def test_marks_that_no_cell_has_are_refused(key: str) -> None:
    with pytest.raises(InputError, match="emissive") as caught:
        bake(emissive=((key, (1.0,)),))
    assert caught.value.remedy


def test_a_mark_of_an_unused_colour_names_the_colours_in_use() -> None:
    with pytest.raises(InputError, match=r"there are 1 \(#ff0033\), 2 \(#00ffff\), 3 \(#808080\)$"):
        bake(emissive=(("#ffffff", (1.0,)),))


@pytest.mark.parametrize(
    "knobs",
    [
        {"cell_size": 0.0},
        {"cell_size": float("nan")},
        {"cell_size": 1e7},
        {"emission_scale": -1.0},
        {"emission_scale": float("inf")},
        {"emissive": (("3", (1.0, 2.0)),)},
        {"emissive": (("3", (-1.0,)),)},
        {"emissive": (("3", (float("nan"),)),)},
        {"emissive": (("3", (1e7,)),)},
    ],
)
def test_knobs_out_of_range_are_refused(knobs: dict[str, object]) -> None:
    with pytest.raises(InputError):
        bake(**knobs)


def test_light_beyond_what_a_scene_may_hold_is_refused() -> None:
    glow = b.material(3, _type="_emit", _emit="1", _flux="8")
    with pytest.raises(InputError, match="emission_scale"):
        bake(glow)
    assert bake(glow, emission_scale=0.01).emission.max() > 1e5


def test_notes_tell_what_was_simplified() -> None:
    parts = [b.material(1, _type="_glass"), b.material(4, _type="_media")]
    hidden = [b.group(0, 1, 2), b.shape(1, 0), b.shape(2, 0, _hidden="1")]
    notes = bake(*parts, *hidden).quality["notes"]
    assert notes[:2] == [
        "1 of 2 placed models are hidden: left out",
        "materials _glass are taken as opaque",
    ]


def test_an_xraw_box_stands_on_the_ground() -> None:
    cells = np.zeros((3, 2, 4), np.uint8)
    cells[2, 0, 1], cells[0, 1, 3] = 1, 2
    palette = bytes(4) + b"\x80\x80\x80\xff" + b"\xff\x00\x00\xff"
    data = struct.pack("<4s4B4I", b"XRAW", 0, 4, 8, 8, 4, 2, 3, 3) + cells.tobytes() + palette
    found = xraw.decode(data, "a")
    world = voxels.from_xraw(found, params=Params(1.0, emissive=(("1", (7.0,)),)))
    assert rows_by_place(world) == {(-0.5, 2.5, 0.5): 1, (1.5, 0.5, -0.5): 2}
    assert world.emission[1] == pytest.approx(7 * srgb_decode(np.full(3, 128 / 255)), rel=6e-8)
    assert world.albedo[2].tolist() == [np.float32(0.98), 0, 0]
    empty = xraw.XrawFile(np.zeros((1, 1, 1), np.uint16), found.palette)
    with pytest.raises(InputError, match="has cells"):
        voxels.from_xraw(empty, params=Params())


def test_the_same_file_gives_the_same_bytes(tmp_path: Path) -> None:
    written = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        bake(b.material(3, _type="_emit")).save(tmp_path / name)
        written.append([p.read_bytes() for p in sorted((tmp_path / name).iterdir())])
    assert written[0] == written[1]


def box(*, gap: bool = False, **material: object) -> Mesh:
    """A box of 4 x 2 x 2 m from the origin, its top of a second material; gap : without a wall."""
    corners = np.array([[x, y, z] for x in (0, 4) for y in (0, 2) for z in (0, 2)], np.float64)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (0, 2, 6, 4), (1, 5, 7, 3), (2, 3, 7, 6)]
    if gap:
        quads = quads[1:]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    normals = np.zeros((len(faces), 3, 3), np.float32)
    normals[..., 1] = 1
    kind = np.zeros(len(faces), np.int32)
    kind[-2:] = 1
    looks = (
        Material("clay", base_color=(0.5, 0.25, 1.0)),
        Material("lamp", **({"base_color": (0.5, 0.5, 0.5)} | material)),  # type: ignore[arg-type]
    )
    return Mesh(corners, faces.astype(np.int64), normals, kind, looks, notes=("a note",))


def test_a_mesh_becomes_cells() -> None:
    world = voxels.from_mesh(box(emissive=(9.0, 4.0, 1.0)), params=MeshParams(8))
    assert world.size == (8, 4, 4)
    assert (world.cell_size, world.origin) == (0.5, (0.0, 0.0, 0.0))
    assert world.solid.all()
    # The top is 8 x 4 cells; at its rim a wall is as near as the top, and comes first
    top = world.cells[1:3, 3, 1:7]
    assert np.all(world.emission[top] == [9.0, 4.0, 1.0])
    assert np.all(world.emission[world.cells[:, 0]] == 0)
    assert np.all(world.albedo[world.cells[:, 0]] == np.float32([0.5, 0.25, 0.98]))
    quality = world.quality
    assert quality["closed"] is True
    assert quality["solid"] == 8 * 4 * 4
    assert quality["glowing"] == np.count_nonzero(world.glowing)
    assert quality["notes"][0] == "a note"
    assert "brighter than albedo" in quality["notes"][-1]


def test_the_inside_of_a_mesh_may_stay_empty() -> None:
    world = voxels.from_mesh(box(), params=MeshParams(8, solid=False))
    assert not world.solid[1:3, 1:3, 1:7].any()
    assert world.quality["solid"] == 8 * 4 * 4 - 6 * 2 * 2


def test_a_mesh_with_a_hole_is_told() -> None:
    world = voxels.from_mesh(box(gap=True), params=MeshParams(8))
    assert world.quality["closed"] is False
    assert any("holes" in note for note in world.quality["notes"])


def test_materials_are_marked_by_name() -> None:
    world = voxels.from_mesh(box(), params=MeshParams(8, emissive=(("lamp", (3.0, 2.0, 1.0)),)))
    assert np.unique(world.emission, axis=0).tolist() == [[0, 0, 0], [3, 2, 1]]
    world = voxels.from_mesh(box(), params=MeshParams(8, emissive=(("clay", (4.0,)),)))
    assert np.unique(world.emission, axis=0).tolist() == [[0, 0, 0], [2, 1, 4]]
    with pytest.raises(InputError, match="materials are clay, lamp"):
        voxels.from_mesh(box(), params=MeshParams(8, emissive=(("lmap", (4.0,)),)))


@pytest.mark.parametrize("knobs", [{"grid": 0}, {"grid": 513}, {"emissive": (("lamp", (-1.0,)),)}])
def test_knobs_of_meshes_out_of_range_are_refused(knobs: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        voxels.from_mesh(box(), params=MeshParams(**knobs))


@pytest.mark.parametrize("case", stage_battery.cases(box()), ids=str)
def test_battery(case: stage_battery.Case, tmp_path: Path) -> None:
    stage_battery.check(case, voxels.from_mesh, (box(),), MeshParams(6), tmp_path)
