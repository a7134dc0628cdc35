"""Cubes in the reference: against closed forms, against the same cubes as meshes, and where they
stand."""

import numpy as np
import pytest

from assets.voxels import vox_file
from bake import reference_cubes, reference_scene, workers
from bake.reference import Params, render
from formats.errors import InputError
from formats.files import exr, glb
from maths.area_lights import polygon_irradiance
from maths.colour import srgb_decode
from tests.bake import cell_worlds, reference_scenes, small_meshes
from tests.bake.reference_scenes import check_z, ground_points, scene_of

CODE = 0xC0
ALBEDO = float(srgb_decode(CODE / 255))
PALETTE = {1: "#c0c0c0", 2: "#000000", 3: "#ff0000"}
GLOW = 4.0
CELL = 0.25
MIDDLE, SIDE = np.array([1.4, 0.3, 0.1]), 0.5
FRONTS = {
    "east": ([1, 0, 0], [0, 1, 0], [0, 0, 1]),
    "up": ([0, 1, 0], [0, 0, 1], [1, 0, 0]),
    "south": ([0, 0, 1], [1, 0, 0], [0, 1, 0]),
}
"""Normal and two sides, right-handed."""


def write(folder, name, cells):
    """Write cells (nz, ny, nx) as a file; returns its name as a source."""
    # Rows of a file go from near to far
    file = np.ascontiguousarray(cells.transpose(1, 0, 2)[:, ::-1], np.uint8)
    vox_file.write(folder / f"{name}.vox", [vox_file.Part(file)], PALETTE)
    return f"{name}.vox"


def world(folder, cells, **more):
    source = write(folder, "world", cells)
    return {"source": source, "cell_size": CELL, "emissive": {"2": [GLOW] * 3}} | more


def floor(column=None):
    """A grey floor of 16 x 16 cells; column : cells of row 2 that stand on it."""
    cells = np.zeros((16, 5, 16), np.uint16)
    cells[:, 0] = 1
    if column is not None:
        cells[column] = 2
    return cells


ON_TOP = [0.0, -CELL, 0.0]
"""Places a world so that its lowest layer ends at height 0."""


def of_box(points, low, high):
    """Irradiance upwards from a box that glows on all sides and hides nothing but itself."""
    middle, half = (low + high) / 2, (high - low) / 2
    total = np.zeros(points.shape[:-1])
    for axes in FRONTS.values():
        for sign in (1, -1):
            normal, u, v = np.array(axes, float)
            corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)][::sign]
            face = [middle + half * (sign * normal + a * u + b * v) for a, b in corners]
            total += polygon_irradiance(points, [0.0, 1.0, 0.0], np.array(face), GLOW)
    return total


@pytest.mark.parametrize("bounces", [0, 2])
def test_a_closed_furnace_is_a_geometric_series(tmp_path, bounces):
    voxels = world(tmp_path, cell_worlds.room(4), emissive={"1": [0.5] * 3})
    camera = {"position": [0.3, 0.7, 0.1], "target": [-1.0, 0.8, 0.2], "focal_length_mm": 12.0}
    scene = scene_of(tmp_path, camera, voxels=voxels)
    found = render(scene, params=Params(width=16, height=16, samples=64, bounces=bounces))
    assert np.all(found.coverage == 1)
    truth = 0.5 * (1 - ALBEDO ** (bounces + 2)) / (1 - ALBEDO)
    mean = found.radiance[..., 0].mean(dtype=np.float64)
    error = np.sqrt(np.mean(found.error[..., 0].astype(np.float64) ** 2) / 256)
    assert abs(mean - truth) < 4 * error
    # The test can tell one bounce more from this: it is many errors away
    assert 0.5 * ALBEDO ** (bounces + 2) > 20 * error


def test_a_floor_beside_glowing_cells_is_its_closed_form(tmp_path):
    cells = floor(np.s_[6:10, 1:4, 13:15])
    scene = scene_of(tmp_path, voxels=world(tmp_path, cells, position=ON_TOP))
    found = render(scene, params=Params(width=16, height=16, bounces=0))
    low, high = np.array([1.25, 0.0, -0.5]), np.array([1.75, 0.75, 0.5])
    light = of_box(ground_points((16, 16)), low, high)
    check_z(found, ALBEDO / np.pi * light.mean(axis=-1))


def test_a_lamp_lights_from_its_exact_place(tmp_path):
    path = {"times": [0, 2], "values": [[9, 0.3, 0.1], (2 * MIDDLE - [9, 0.3, 0.1]).tolist()]}
    lamp = {"position": path, "radiance": [GLOW] * 3, "side": 2}
    voxels = world(tmp_path, floor(), position=ON_TOP, emissive={}, lamps=[lamp])
    scene = scene_of(tmp_path, voxels=voxels)
    found = render(scene, params=Params(width=16, height=16, bounces=0, time=1.0))
    light = of_box(ground_points((16, 16)), MIDDLE - SIDE / 2, MIDDLE + SIDE / 2)
    check_z(found, ALBEDO / np.pi * light.mean(axis=-1))


def test_an_open_floor_takes_all_of_an_even_environment_and_a_sun_as_a_mesh_does(tmp_path):
    exr.write(tmp_path / "even.exr", {"beauty": np.full((2, 4, 3), 0.7, np.float32)})
    sun = {"type": "sun", "to_light": [0.6, 0.8, 0], "irradiance": [2, 2, 2]}
    lights = [{"type": "environment", "source": "even.exr"}, sun]
    voxels = world(tmp_path, floor(), position=ON_TOP, emissive={})
    scene = scene_of(tmp_path, voxels=voxels, lights=lights)
    found = render(scene, params=Params(width=16, height=16, bounces=0))
    check_z(found, ALBEDO * (0.7 + 2 * 0.8 / np.pi))


def test_cubes_and_the_same_cubes_as_meshes_make_one_picture(tmp_path):
    grey = glb.Material(base_color=(ALBEDO,) * 3 + (1.0,))
    black = glb.Material(base_color=(0.0, 0.0, 0.0, 1.0), emissive=(GLOW,) * 3)
    boxes = {
        "ground": ((2.0, 0.125, 2.0), (0.0, -0.125, 0.0), grey),
        "lamp": ((0.25, 0.375, 0.5), (1.5, 0.375, 0.0), black),
    }
    ball = small_meshes.sphere(8, 16)
    source = reference_scenes.write_mesh(tmp_path, "ball", ball, grey)
    beside = [{"name": "ball", "source": source, "position": [0.6, 0.5, 0.2], "scale": 0.4}]
    meshes = [
        {"name": n, "source": reference_scenes.write_mesh(tmp_path, n, small_meshes.box(h, c), m)}
        for n, (h, c, m) in boxes.items()
    ]
    cells = floor(np.s_[6:10, 1:4, 13:15])
    camera = {"position": [1.0, 2.5, 4.0], "target": [0.6, 0.2, 0.0], "focal_length_mm": 40.0}
    one = scene_of(tmp_path, camera, meshes=beside, voxels=world(tmp_path, cells, position=ON_TOP))
    other = scene_of(tmp_path, camera, meshes=[*beside, *meshes])
    a, b = (
        render(scene, params=Params(width=24, height=24, samples=64, bounces=2, seed=seed))
        for seed, scene in enumerate((one, other))
    )
    # What is seen, but for samples at edges, then the light on it
    assert np.abs(a.coverage - b.coverage).max() < 0.2
    assert np.abs(a.coverage - b.coverage).mean() < 0.01
    bars = np.hypot(*(f.error[..., 0].astype(np.float64) for f in (a, b)))
    # Nothing varies on the lamp, nor beside the floor
    noisy = bars > 0
    assert noisy.mean() > 0.6
    assert np.array_equal(a.radiance[~noisy], b.radiance[~noisy])
    z = (a.radiance[..., 0] - b.radiance[..., 0])[noisy] / bars[noisy]
    # As between two seeds of one scene: 30 / 28 and 2.56 are Student's of 30 degrees. At edges of
    # the lamp the bars are not normal: a few pixels of one lit path in 64
    assert abs(z.mean()) < 4 * np.sqrt(30 / 28 / z.size)
    assert abs((z * z).mean() - 30 / 28) < 4 * np.sqrt(2.56 / z.size)


def test_parts_snap_to_cells_and_join_the_world(tmp_path):
    # The post in the corner makes room above the floor
    cells = floor(np.s_[:1, 1:4, :1])
    source = write(tmp_path, "door", np.full((1, 2, 1), 3, np.uint16))
    path = {"times": [0, 1], "values": [[0.125, 0.25, 0.125], [1.125, 0.25, 0.125]]}
    voxels = world(tmp_path, cells, bodies=[{"name": "door", "source": source, "position": path}])
    scene = scene_of(tmp_path, voxels=voxels)
    for time, column in ((0.0, 8), (0.3, 9), (0.4, 10), (1.0, 12)):
        found = reference_cubes.at(scene.voxels, time)
        assert np.allclose(found.origin, [-2.0, 0.0, -2.0])
        solid = np.argwhere(found.cells == found.cells.max())
        assert solid.tolist() == [[8, 1, column], [8, 2, column]]
        assert found.albedo[found.cells.max()].tolist() == [np.float32(0.98), 0, 0]


def test_squares_cover_the_world_once_and_look_outward(rng):
    cells = (rng.random((3, 4, 5)) < 0.5).astype(np.uint16) * rng.integers(1, 4, (3, 4, 5))
    voxels = cell_worlds.of(cells.astype(np.uint16), [0.1, 0.2, 0.3], [0.0, 1.0, 2.0])
    mesh = reference_cubes.mesh_of(voxels).checked()
    corners = mesh.vertices[mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.array_equal(cross, mesh.normals[:, 0])
    assert np.array_equal(mesh.normals[:, 0], mesh.normals[:, 2])
    expected = set()
    padded = np.pad(cells, 1)
    for z, y, x in np.argwhere(cells):
        for axis in range(3):
            for sign in (-1, 1):
                step = sign * np.eye(3, dtype=int)[axis]
                if padded[tuple(np.array([z, y, x]) + 1 + step[::-1])] == 0:
                    middle = np.array([x, y, z]) + 0.5 + 0.5 * step
                    expected.add((*middle, *step, int(cells[z, y, x])))
    found = []
    for square in range(0, len(corners), 2):
        # The first and third corner of both are the ends of the diagonal
        middle = (corners[square, 0] + corners[square, 2]) / 2
        kind = mesh.materials[mesh.material[square]]
        assert mesh.material[square] == mesh.material[square + 1]
        row = round(kind.base_color[0] / 0.1)
        assert kind.emissive[0] == row - 1
        found.append((*middle, *mesh.normals[square, 0], row))
    assert len(found) == len(expected)
    assert set(found) == expected
    # Corners are shared: two squares that meet have the very same numbers there
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)


def test_cubes_forced_off_are_not_traced(tmp_path):
    voxels = world(tmp_path, floor(np.s_[6:10, 1:4, 13:15]))
    scene = scene_of(tmp_path, voxels=voxels, force={"voxels": False})
    found = render(scene, params=Params(width=8, height=8, samples=2))
    assert not found.coverage.any()
    assert not found.radiance.any()


def test_too_many_faces_are_refused_before_they_are_made(tmp_path, monkeypatch):
    monkeypatch.setattr(reference_scene, "MAX_TRIANGLES", 100)
    scene = scene_of(tmp_path, voxels=world(tmp_path, floor(), emissive={}))
    # 2 (16 * 16 + 2 * 16) squares
    with pytest.raises(InputError, match="triangles: 1,152 -- the reference traces at most 100"):
        render(scene, params=Params(width=4, height=4, samples=2))


def test_parts_of_another_cell_size_are_refused(tmp_path):
    reference_scenes.write_mesh(tmp_path, "ball", small_meshes.sphere(8, 16))
    body = {"name": "door", "source": write(tmp_path, "door", np.ones((1, 1, 1))),
            "position": [0.0, 0.0, 0.0]}  # fmt: skip
    voxels = {"source": "ball.glb", "grid": 7, "cell_size": CELL, "bodies": [body]}
    with pytest.raises(InputError, match="bake it with cells of"):
        render(scene_of(tmp_path, voxels=voxels), params=Params(width=4, height=4, samples=2))


def test_threads_do_not_change_a_byte(tmp_path):
    cells = floor(np.s_[6:10, 1:4, 13:15])
    lamp = {"position": [-0.5, 0.6, 0.3], "radiance": [GLOW] * 3}
    scene = scene_of(tmp_path, voxels=world(tmp_path, cells, position=ON_TOP, lamps=[lamp]))
    found = []
    try:
        for count in (1, 2):
            workers.use(count)
            # Two tiles
            found.append(render(scene, params=Params(width=64, height=64, samples=4)))
    finally:
        workers.use(0)
    assert found[0].radiance.tobytes() == found[1].radiance.tobytes()
