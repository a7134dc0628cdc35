"""Which points lie inside: closed, open, torn, inverted and overlapping surfaces."""

import numpy as np
import pytest

from bake import occlusion_inside
from bake.rays import RayScene
from tests.bake import small_meshes

VERTICES, FACES = small_meshes.sphere_arrays(24, 48)
# Chords of 24 rings lie within cos(pi / 24) = .9914 of the sphere
INNER, OUTER = 0.99, 1.001


def points_in_cube(count: int = 1500, half: float = 1.3) -> np.ndarray:
    return np.random.default_rng(8).uniform(-half, half, (count, 3))


def found_in(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    scene = RayScene(vertices, faces)
    oriented = occlusion_inside.is_oriented(np.asarray(vertices, np.float64), np.asarray(faces))
    return occlusion_inside.inside(scene, scene.to_unit(points), oriented=oriented)


def require_ball(found: np.ndarray, points: np.ndarray) -> None:
    distance = np.linalg.norm(points, axis=1)
    assert np.all(found[distance < INNER])
    assert not np.any(found[distance > OUTER])


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_sphere_is_found_exactly_whatever_its_scale(scale: float) -> None:
    points = points_in_cube()
    require_ball(found_in(VERTICES * scale, FACES, points * scale), points)


def test_inverted_sphere_has_the_same_inside() -> None:
    points = points_in_cube()
    require_ball(found_in(VERTICES, FACES[:, ::-1], points), points)


def test_faces_that_disagree_are_counted_by_parity() -> None:
    points, faces = points_in_cube(), FACES.copy()
    flip = np.random.default_rng(9).random(len(faces)) < 0.5
    faces[flip] = faces[flip][:, ::-1]
    assert occlusion_inside.is_oriented(VERTICES, FACES)
    assert not occlusion_inside.is_oriented(VERTICES, faces)
    require_ball(found_in(VERTICES, faces, points), points)


def test_one_face_in_twenty_missing_changes_nothing() -> None:
    points = points_in_cube()
    kept = FACES[np.random.default_rng(10).random(len(FACES)) > 0.05]
    found = found_in(VERTICES, kept, points)
    distance = np.linalg.norm(points, axis=1)
    # Right behind a hole, of a width of .13, a third of the directions leave through it
    assert np.all(found[distance < 0.85])
    assert not np.any(found[distance > OUTER])


def test_overlapping_parts_are_one_solid() -> None:
    two = np.concatenate([VERTICES + np.array([x, 0, 0]) for x in (-0.5, 0.5)])
    points = points_in_cube(half=1.6)
    found = found_in(two, np.concatenate([FACES, FACES + len(VERTICES)]), points)
    nearest = np.minimum(*(np.linalg.norm(points - [x, 0, 0], axis=1) for x in (-0.5, 0.5)))
    assert np.all(found[nearest < INNER])
    assert not np.any(found[nearest > OUTER])


def test_a_cavity_is_outside() -> None:
    shell = np.concatenate([VERTICES, 0.6 * VERTICES])
    faces = np.concatenate([FACES, FACES[:, ::-1] + len(VERTICES)])
    points = points_in_cube()
    found, distance = found_in(shell, faces, points), np.linalg.norm(points, axis=1)
    assert not found[distance < 0.6 * INNER].any()
    assert np.all(found[(distance > 0.601) & (distance < INNER)])


def test_parts_of_vertices_that_are_not_shared_are_oriented_all_the_same() -> None:
    soup = VERTICES[FACES].reshape(-1, 3)
    assert occlusion_inside.is_oriented(soup, np.arange(len(soup)).reshape(-1, 3))


def test_sheets_and_open_shells_have_no_inside() -> None:
    points = points_in_cube()
    plate = small_meshes.plate()
    assert not found_in(plate.vertices, plate.faces, points).any()
    # A hemisphere: from h below its rim 1 - cos(atan(1 / h)) of the pairs have a ray that leaves,
    # a third of them at .89
    cup = FACES[VERTICES[FACES].mean(axis=1)[:, 1] < 0]
    found = found_in(VERTICES, cup, points)
    assert not found[(np.linalg.norm(points, axis=1) < 0.85) | (points[:, 1] > 0)].any()


def share_of(vertices: np.ndarray, faces: np.ndarray, pitch: float) -> float:
    scene = RayScene(vertices, faces)
    oriented = occlusion_inside.is_oriented(vertices, faces)
    pitches = np.full(3, pitch) * scene.scale
    return occlusion_inside.thin_share(scene, pitches, oriented=oriented)


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_walls_thinner_than_a_voxel_are_found(scale: float, inverted: bool) -> None:
    box = small_meshes.box((1.0, 1.0, 0.05), (3.0, 0.0, 0.0))
    vertices, faces = box.vertices * scale, box.faces[:, ::-1] if inverted else box.faces
    # .1 thick: two sides of 4, four of .2 that are 2 deep
    assert share_of(vertices, faces, 0.09 * scale) == 0
    assert share_of(vertices, faces, 0.11 * scale) == pytest.approx(8 / 8.8, abs=1.1 / 256)
    assert share_of(vertices, faces, 2.1 * scale) == 1


def test_solids_have_no_thin_walls_and_sheets_are_nothing_else() -> None:
    assert share_of(VERTICES, FACES, 0.1) == 0
    plate = small_meshes.plate()
    assert share_of(plate.vertices, plate.faces, 0.01) == 1
    # A shell of .1, and a second solid right behind a wall
    shell = np.concatenate([VERTICES, 0.9 * VERTICES])
    faces = np.concatenate([FACES, FACES[:, ::-1] + len(VERTICES)])
    assert share_of(shell, faces, 0.05) == 0
    assert share_of(shell, faces, 0.12) == 1
    # Faces that disagree about the outside
    flip = np.random.default_rng(9).random(len(FACES)) < 0.5
    torn = np.where(flip[:, None], FACES[:, ::-1], FACES)
    assert share_of(VERTICES, torn, 0.1) == 0


def test_thin_walls_depend_on_the_voxels_of_their_own_axis() -> None:
    box = small_meshes.box((1.0, 1.0, 0.05))
    scene = RayScene(box.vertices, box.faces)
    flat, tall = np.array([0.3, 0.3, 0.09]), np.array([0.09, 0.09, 0.3])
    assert occlusion_inside.thin_share(scene, flat, oriented=True) == 0
    assert occlusion_inside.thin_share(scene, tall, oriented=True) > 0.9


@pytest.mark.parametrize(("scale", "offset"), [(1e-6, 0.0), (1.0, 1e6), (1e6, 0.0)])
def test_inverted_surfaces_are_told_apart(scale: float, offset: float) -> None:
    vertices = VERTICES * scale + offset
    assert not occlusion_inside.is_inverted(vertices, FACES)
    assert occlusion_inside.is_inverted(vertices, FACES[:, ::-1])
    # Vertices that are not shared, and a part within that makes a cavity
    soup = vertices[FACES[:, ::-1]].reshape(-1, 3)
    assert occlusion_inside.is_inverted(soup, np.arange(len(soup)).reshape(-1, 3))
    shell = np.concatenate([vertices, 0.5 * VERTICES * scale + offset])
    faces = np.concatenate([FACES, FACES[:, ::-1] + len(VERTICES)])
    assert not occlusion_inside.is_inverted(shell, faces)
    # What is open has no volume to speak of
    assert not occlusion_inside.is_inverted(vertices, FACES[1:, ::-1])
    assert not occlusion_inside.is_inverted(small_meshes.plate().vertices, np.array([[0, 2, 1]]))


def test_holes_take_the_mean_of_what_lies_around() -> None:
    volume = np.arange(5.0)[None, None, :, None] * np.ones((5, 5, 5, 2), np.float32)
    hole = np.zeros((5, 5, 5), bool)
    hole[1:4, 1:4, 1:4] = True
    spoilt = np.where(hole[..., None], np.float32(np.nan), volume).astype(np.float32)
    found = occlusion_inside.filled(spoilt, hole)
    assert found.dtype == np.float32
    assert np.array_equal(found[~hole], volume[~hole])
    assert np.array_equal(occlusion_inside.filled(np.ones_like(spoilt), hole), np.ones_like(spoilt))
    # Means stay within what they are of, and the ramp's middle by symmetry
    assert found.min() >= 0
    assert found.max() <= 4
    np.testing.assert_allclose(found[2, 2, 2], 2, atol=1e-6)
    np.testing.assert_allclose(found[2, 2, 1], found[2, 2, 1, 0])
    assert not occlusion_inside.filled(volume.astype(np.float32), np.ones_like(hole)).any()
