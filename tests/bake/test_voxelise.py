"""Meshes as cells: volumes, colours and emission that are known, and time and memory."""

import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from bake import voxelise
from formats.errors import InputError
from formats.material import Material
from maths.colour import srgb_encode
from tests.bake.small_meshes import box, joined, mesh_of, plate, sphere, sphere_arrays

RED = Material("red", (0.8, 0.1, 0.1))
LAMP = Material("lamp", (0.2, 0.3, 0.4), emissive=(5.0, 4.0, 3.0))


def test_a_sphere_has_its_volume_and_its_shell() -> None:
    found = voxelise.voxelise(sphere(32, 64), grid=48, solid=True)
    assert found.cells.shape == (48, 48, 48)
    assert found.closed
    assert found.cell_size == pytest.approx(2 / 48, rel=1e-12)
    assert found.origin == pytest.approx((-1, -1, -1), abs=1e-12)
    # All cells that the ball touches: its volume and at most a layer of a cell's diagonal
    volume = np.count_nonzero(found.cells) * found.cell_size**3
    ball, layer = 4 / 3 * np.pi, 4 * np.pi * np.sqrt(3) * found.cell_size
    # 0.5 % : the polyhedron's volume falls short of the ball's by about (pi / 32)^2 / 2
    assert 0.995 * ball < volume < ball + layer
    shell = voxelise.voxelise(sphere(32, 64), grid=48, solid=False)
    assert 0 < np.count_nonzero(shell.cells) < 0.3 * np.count_nonzero(found.cells)
    np.testing.assert_array_equal(found.cells[shell.cells > 0], shell.cells[shell.cells > 0])
    assert not shell.cells[24, 24, 24]


def test_a_hole_costs_few_cells_and_is_told() -> None:
    vertices, faces = sphere_arrays(32, 64)
    whole = voxelise.voxelise(mesh_of(vertices, faces), grid=48, solid=True)
    # Cut a lid off the side, of 0.2 radii or five cells
    side = vertices[faces].mean(axis=1) @ [1.0, 0.0, 0.0] < 0.98
    holed = voxelise.voxelise(mesh_of(vertices, faces[side]), grid=48, solid=True)
    assert not holed.closed
    assert any("holes" in note for note in holed.notes)
    different = (whole.cells > 0) != (holed.cells > 0)
    # The lid itself: a disc of 0.2 radii, 72 cells, and its rim
    assert 0 < different.sum() < 150
    assert not different[:, :, :46].any()


def test_a_flat_plate_is_one_layer() -> None:
    found = voxelise.voxelise(plate(half=2.0), grid=8, solid=True)
    assert found.cells.shape == (1, 8, 8)
    assert (found.cells == 1).all()
    assert found.origin == pytest.approx((-2, -2, 0))


def test_each_cell_has_its_nearest_face() -> None:
    # Two plates a third of a cell apart, the red one nearer to the centres of the layer at z = 0
    low, high = plate(centre=(0, 0, 0.1), material=RED), plate(centre=(0, 0, 0.02), material=LAMP)
    ends = plate((1, 0, 0), centre=(0, 0, 1), half=1.0)
    found = voxelise.voxelise(joined(low, high, ends), grid=8, solid=False)
    assert found.cell_size == pytest.approx(0.25)
    layer = found.cells[0, :, [1, 2, 6]]
    assert len(np.unique(layer)) == 1
    np.testing.assert_allclose(found.albedo[layer[0, 0]], RED.base_color, rtol=1e-6)
    assert not found.emission[layer[0, 0]].any()


def test_what_is_inside_has_the_colour_and_emission_of_the_nearest_side() -> None:
    vertices, faces = sphere_arrays(24, 48)
    upper = vertices[faces].mean(axis=1)[:, 1] > 0
    mesh = replace(mesh_of(vertices, faces), material=upper.astype(np.int32), materials=(RED, LAMP))
    found = voxelise.voxelise(mesh, grid=30, solid=True)
    assert found.cells[15, 15, 15]
    glow = found.emission[found.cells].any(axis=-1)
    solid = found.cells > 0
    # But for a layer or two at the middle
    assert glow[:, 17:][solid[:, 17:]].all()
    assert not glow[:, :13].any()
    np.testing.assert_allclose(found.emission.max(axis=0), LAMP.emissive)
    assert not found.albedo[0].any()
    assert not found.emission[0].any()


def test_vertex_colours_are_those_at_the_centres() -> None:
    mesh = replace(plate(half=2.0), uv=None)
    across = (mesh.vertices[:, :1] + 2) / 4
    up = (mesh.vertices[:, 1:2] + 2) / 4
    colours = np.concatenate([across, up, 0 * up], axis=1).astype(np.float32)
    found = voxelise.voxelise(replace(mesh, colours=colours), grid=16, solid=False)
    albedo = found.albedo[found.cells][0]
    y, x = (np.indices((16, 16)) + 0.5) / 16
    # Rounding of float32
    np.testing.assert_allclose(albedo[..., 0], x, atol=1e-6)
    np.testing.assert_allclose(albedo[..., 1], y, atol=1e-6)


def test_textures_are_read_where_the_cell_is() -> None:
    picture = np.zeros((16, 16, 3), np.float32)
    picture[:8, :8], picture[:8, 8:], picture[8:, 8:] = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    mesh = plate(half=2.0, material=Material(base_color=(0.5, 1.0, 1.0), texture=picture))
    uv = ((mesh.vertices[:, :2] + 2) / 4).astype(np.float32)
    found = voxelise.voxelise(replace(mesh, uv=uv), grid=16, solid=False)
    albedo = found.albedo[found.cells][0]
    # Row 0 of the picture is on top, row 0 of the cells at the bottom; texel and cell agree
    expected = picture[::-1] * np.float32([0.5, 1, 1])
    np.testing.assert_allclose(albedo[1:-1, 1:-1], expected[1:-1, 1:-1], atol=1e-6)


def test_too_many_colours_are_rounded_to_what_the_palette_holds(rng: np.random.Generator) -> None:
    albedo = rng.random((200_000, 3)).astype(np.float32)
    emission = np.where(rng.random((200_000, 1)) < 0.5, np.float32(2.5), np.float32(0))
    emission = np.repeat(emission, 3, axis=1)
    rows, palette, glow, notes = voxelise._palettes(albedo, emission)
    assert len(palette) <= 65536
    assert rows.min() == 1
    assert any("5, 6 and 5" in note or "4, 5 and 4" in note for note in notes)
    np.testing.assert_array_equal(glow[rows], emission)
    # A row holds colours within one step of 5, 6 and 5 bits, or of 4, 5 and 4 where two emissions
    # double them; its mean is one of them
    step = 1 / (np.array([31, 63, 31]) if "5, 6" in notes[0] else np.array([15, 31, 15]))
    away = np.abs(srgb_encode(palette[rows]) - srgb_encode(albedo))
    assert (away <= step + 1e-6).all()
    exact = voxelise._palettes(albedo[:60_000], emission[:60_000])
    assert exact[3] == ()
    np.testing.assert_array_equal(exact[1][exact[0]], albedo[:60_000])


def slow_nearest(point: np.ndarray, corners: np.ndarray) -> float:
    """Least squared distance over a fine net of weights."""
    i, j = np.triu_indices(201)
    weights = np.stack([i, j - i, 200 - j], axis=1) / 200
    return float(((weights @ corners - point) ** 2).sum(axis=1).min())


def test_nearest_points_are_those_of_a_fine_net(rng: np.random.Generator) -> None:
    corners, points = rng.normal(size=(200, 3, 3)), rng.normal(size=(200, 3)) * 1.5
    weights, squared = voxelise.nearest(points, corners)
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
    at = np.einsum("ni,nij->nj", weights, corners)
    np.testing.assert_allclose(((at - points) ** 2).sum(axis=1), squared, atol=1e-12)
    net = np.array([slow_nearest(p, c) for p, c in zip(points, corners, strict=True)])
    assert (squared <= net + 1e-12).all()
    # A net of 1 / 200 is at most 1 / 200 of an edge off, and edges are shorter than 10
    assert (np.sqrt(net) - np.sqrt(squared) <= 10 / 200).all()


def test_position_and_scale_do_not_matter() -> None:
    mesh = sphere(12, 24)
    expected = voxelise.voxelise(mesh, grid=20, solid=True).cells
    # Powers of two keep the bits of the vertices
    for scale, offset in ((2.0**-40, 0.0), (2.0**40, 0.0), (1.0, 8.0)):
        moved = replace(mesh, vertices=mesh.vertices * scale + offset)
        found = voxelise.voxelise(moved, grid=20, solid=True)
        assert np.count_nonzero(found.cells != expected) <= (4 if offset else 0)
        assert found.cell_size == pytest.approx(scale / 10)


@pytest.mark.parametrize("grid", [0, -1, 513])
def test_grids_out_of_range_are_refused(grid: int) -> None:
    with pytest.raises(InputError, match="grid"):
        voxelise.voxelise(box(), grid=grid, solid=True)


def test_meshes_without_area_are_refused() -> None:
    for points in ([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[1, 1, 1]] * 3):
        with pytest.raises(InputError, match="area"):
            voxelise.voxelise(mesh_of(points, [[0, 1, 2]]), grid=8, solid=True)
    empty = replace(box(), faces=np.zeros((0, 3), np.int64))
    with pytest.raises(InputError, match="faces"):
        voxelise.voxelise(empty, grid=8, solid=True)


def test_one_cell_holds_it_all() -> None:
    found = voxelise.voxelise(box(), grid=1, solid=True)
    assert found.cells.tolist() == [[[1]]]


def test_a_world_of_256_cells_a_side_takes_seconds_and_little_memory() -> None:
    mesh, done = sphere(64, 128), []
    start = time.process_time()
    voxelise.voxelise(mesh, grid=256, solid=True, progress=done.append)
    # Measured: 2.3 s of one core
    assert time.process_time() - start < 5
    assert done == sorted(done)
    assert done[-1] == 1
    tracemalloc.start()
    try:
        voxelise.voxelise(mesh, grid=128, solid=True)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    # What grows with the box stays under 16 bytes a cell, so 256 cells a side are under 0.5 GiB
    assert peak < 16 * 128**3 + (200 << 20)
