"""Edges that turn, the round outlines that stand for them, and fins between the two."""

from __future__ import annotations

from time import process_time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from maths import silhouette, silhouette_edges, transforms
from maths.silhouette_edges import of_triangles

Array = NDArray[np.float64]
SIZE = (480, 270)
FOCAL, SENSOR, NEAR = 0.05, 0.024, 0.1


def ball(around: int, down: int) -> tuple[Array, Array, Any]:
    """A unit ball of 2 around * down triangles, those at the poles without area."""
    turn, fall = np.arange(around) * 2 * np.pi / around, np.linspace(0, np.pi, down + 1)
    y, r = np.cos(fall)[:, None], np.sin(fall)[:, None]
    r[[0, -1]] = 0.0
    points = np.stack([r * np.cos(turn), y + 0 * turn, r * np.sin(turn)], axis=-1).reshape(-1, 3)
    return points, points, grid(around, down + 1, False)


def rod(around: int, half: float = 1.0) -> tuple[Array, Array, Any]:
    """A cylinder about +y of radius 1 with flat caps."""
    turn = np.arange(around) * 2 * np.pi / around
    ring = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=-1)
    up = np.array([0.0, half, 0.0])
    points = np.concatenate([ring - up, ring + up, ring - up, ring + up, [-up, up]])
    normals = np.concatenate([ring, ring, 0 * ring - up, 0 * ring + up, [-up, up]]) / np.array(
        [1.0, half, 1.0]
    )
    i, n = np.arange(around), around
    j = (i + 1) % n
    sides = [[i, n + i, n + j], [i, n + j, j]]
    caps = [[2 * n + i, 2 * n + j, 0 * i + 4 * n], [3 * n + j, 3 * n + i, 0 * i + 4 * n + 1]]
    return points, normals, np.concatenate([np.stack(f, axis=-1) for f in (*sides, *caps)])


def box() -> tuple[Array, Array, Any]:
    """A cube from -1 to 1 whose sides share no vertex."""
    corners, normals = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side = np.zeros((4, 3))
            side[:, axis] = sign
            side[:, (axis + 1) % 3] = np.array([-1, 1, 1, -1]) * sign
            side[:, (axis + 2) % 3] = [-1, -1, 1, 1]
            corners.append(side)
            normals.append(np.tile(sign * np.eye(3)[axis], (4, 1)))
    quads = 4 * np.arange(6)[:, None]
    faces = np.concatenate([quads + np.array([0, 1, 2]), quads + np.array([0, 2, 3])])
    return np.concatenate(corners), np.concatenate(normals), faces


def grid(across: int, along: int, closed: bool) -> Any:
    i, j = np.meshgrid(np.arange(along - (not closed)), np.arange(across), indexing="ij")
    a, b = i * across + j, i * across + (j + 1) % across
    d, c = (i + 1) % along * across + j, (i + 1) % along * across + (j + 1) % across
    return np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ([a, b, c], [a, c, d])])


def seen(eye: Any, aim: Any = (0.0, 0.0, 0.0), size: tuple[int, int] = SIZE) -> Array:
    """Matrix (4, 4) of a camera of the frame's default lens."""
    view = transforms.look_at(np.asarray(eye, float), np.asarray(aim, float))
    return np.asarray(transforms.perspective(FOCAL, SENSOR, size[0] / size[1], NEAR, np.inf) @ view)


def fins_of(mesh: Any, eye: Any, width: float = 0.2, **more: Any) -> Any:
    edges = mesh if isinstance(mesh, silhouette_edges.Edges) else of_triangles(*mesh)
    return silhouette.fins(edges, seen(eye), eye, SIZE, width=width, near=NEAR, **more)


def eyes(rng: np.random.Generator, count: int, distance: float) -> Array:
    ways = rng.normal(size=(count, 3))
    return np.asarray(distance * ways / np.linalg.norm(ways, axis=1, keepdims=True))


def test_each_edge_is_found_once_and_the_hollow_and_manifold_ones_apart() -> None:
    points, normals, faces = ball(12, 6)
    edges = of_triangles(points, normals, faces)
    # A closed surface without its empty triangles: Euler, e = 3/2 of its faces
    assert len(edges.points) == 12 * 5 + 2
    assert len(edges.ends) == 3 * (12 * 10) // 2
    assert len({tuple(sorted(row)) for row in edges.ends.tolist()}) == len(edges.ends)
    assert (edges.faces[:, 1] >= 0).all()
    # Looked at from within every edge is hollow, but for the diagonals of the quads
    assert len(of_triangles(points, -normals, faces).ends) == 12 * 4
    # Whichever way the triangles wind, they look where the normals do
    again = of_triangles(points, normals, faces[:, ::-1])
    np.testing.assert_array_equal(np.sort(again.ends, axis=0), np.sort(edges.ends, axis=0))
    np.testing.assert_allclose(again.planes, edges.planes, atol=1e-12)


def test_turning_edges_are_those_between_a_front_and_a_back(rng: np.random.Generator) -> None:
    points, normals, faces = box()
    edges = of_triangles(points, normals, faces)
    assert len(edges.ends) == 12 + 6
    for eye in eyes(rng, 20, 6.0):
        found = {
            frozenset(map(tuple, edges.points[edges.ends[e]].tolist())) for e in edges.turning(eye)
        }
        wanted = set()
        for axis in range(3):
            for s in (-1.0, 1.0):
                for t in (-1.0, 1.0):
                    # The two sides of the edge along an axis face the eye where it lies beyond them
                    beyond = [s * eye[(axis + 1) % 3] > 1, t * eye[(axis + 2) % 3] > 1]
                    if beyond[0] != beyond[1]:
                        ends = np.zeros((2, 3))
                        ends[:, axis], ends[:, (axis + 1) % 3] = [-1, 1], s
                        ends[:, (axis + 2) % 3] = t
                        wanted.add(frozenset(map(tuple, ends.tolist())))
        assert found == wanted


def test_boundaries_always_count_and_edges_of_three_faces_never() -> None:
    corners = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0.2], [0, 0, 1]], float)
    normals = np.tile([0.0, 0.0, 1.0], (5, 1))
    fan = of_triangles(corners, normals, [[0, 2, 1], [0, 1, 3], [0, 1, 4]])
    assert len(fan.ends) == 6
    upright = np.ptp(fan.points[fan.ends], axis=1)
    assert not (upright == [0.0, 1.0, 0.0]).all(axis=1).any()
    leaf = of_triangles(corners[:3], normals[:3], [[0, 2, 1], [0, 1, 2]])
    # A second face on the same points is the other side of the first
    assert len(leaf.ends) == 3
    assert len(leaf.turning([0.3, 0.2, 5.0])) == len(leaf.turning([0.3, 0.2, -5.0])) == 3


def test_a_boundary_stays_straight_though_its_surface_bends() -> None:
    points, normals, faces = rod(12)
    # The sides alone, looked at from a little above
    edges = of_triangles(points, normals, faces[:24])
    found = fins_of(edges, np.array([0.5, 1.0, 6.0]), softness=0.1)
    level = np.abs(found.vertices[:, 0, 0, 11]) > 0.9
    assert level.sum() > 12
    np.testing.assert_allclose(found.heights[level], 0.0, atol=1e-9)
    assert found.heights[~level].max() > 0.5


def test_nothing_and_flat_triangles_have_no_edges() -> None:
    none = of_triangles(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), int))
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], float)
    up = np.tile([0.0, 1.0, 0.0], (3, 1))
    flat = of_triangles(line, up, [[0, 1, 2], [0, 0, 1]])
    for edges in (none, flat):
        assert len(edges.ends) == 0
        assert fins_of(edges, np.array([0.0, 1.0, 6.0])).vertices.shape[0] == 0


@pytest.mark.parametrize("around", [12, 24])
def test_bends_are_those_of_balls_and_rods(around: int) -> None:
    edges = of_triangles(
        *(2.0 * part if i == 0 else part for i, part in enumerate(ball(around, around // 2)))
    )
    # Exact but for the weight that makes every system solvable, 1e-6 of its trace
    np.testing.assert_allclose(edges.bends[:, [0, 2]], 0.5, rtol=1e-4)
    np.testing.assert_allclose(edges.bends[:, 1], 0.0, atol=1e-4)
    points, normals, faces = rod(around)
    edges = of_triangles(points, normals, faces[: 2 * around])
    u, v = silhouette_edges.tangents(edges.normals)
    turn, up = np.cross(edges.normals, [0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0])
    for direction, bend, error in ((turn, 1.0, 0.01), (up, 0.0, 0.01)):
        x, y = np.sum(u * direction, axis=1), np.sum(v * direction, axis=1)
        found = edges.bends @ np.array([1.0, 0.0, 0.0]) * x * x
        found += 2.0 * edges.bends[:, 1] * x * y + edges.bends[:, 2] * y * y
        # A diagonal leaves its tangent plane by half an angle: of second order, 0.002 for 12
        np.testing.assert_allclose(found[np.abs(edges.normals[:, 1]) < 0.5], bend, atol=error)


@pytest.mark.parametrize(("around", "most"), [(12, 0.16), (16, 0.07), (24, 0.03)])
def test_the_outline_of_a_ball_is_a_circle(
    around: int, most: float, rng: np.random.Generator
) -> None:
    edges, misses, before = of_triangles(*ball(around, around // 2)), [], []
    # A ball seen from the distance d: a cone of sine 1 / d
    radius = FOCAL / SENSOR * SIZE[1] / np.sqrt(24.0)
    for eye in eyes(rng, 20, 5.0):
        found = fins_of(edges, eye)
        outline = found.vertices[:, :, 1, :2] - 0.5 * np.array(SIZE)
        misses.append((np.linalg.norm(outline, axis=-1) - radius).ravel())
        ends = found.vertices[:, 0, 0, 8:10] - 0.5 * np.array(SIZE)
        before.append(np.linalg.norm(ends, axis=-1) - radius)
    # Measured 0.12, 0.05, 0.014 pixels of 115: it falls with the fourth power of the angle
    assert np.sqrt(np.mean(np.concatenate(misses) ** 2)) < most
    # Even the corners alone miss by more
    assert np.sqrt(np.mean(np.concatenate(before) ** 2)) > 4 * most


def test_sides_of_a_rod_are_where_its_tangent_planes_are(rng: np.random.Generator) -> None:
    edges = of_triangles(*rod(16))
    for eye in eyes(rng, 20, 6.0):
        eye[1] *= 0.3
        found, matrix = fins_of(edges, eye), seen(eye)
        # A plane through the eye touches it at an angle of acos(1 / d) off the eye's
        off = np.arccos(1.0 / np.hypot(eye[0], eye[2])) * np.array([-1.0, 1.0])
        turn = np.arctan2(eye[2], eye[0]) + off
        for x, z in zip(np.cos(turn), np.sin(turn), strict=True):
            clip = np.array([[x, -1, z, 1], [x, 1, z, 1]]) @ matrix.T
            low, high = (0.5 * clip[:, :2] / clip[:, 3:] + 0.5) * SIZE
            along = (high - low) / np.linalg.norm(high - low)
            away = found.vertices[:, :, 1, :2] - low
            miss = away @ np.array([-along[1], along[0]])
            upright = np.abs(found.vertices[:, 0, 0, 10:12] @ along) < 0.02
            side = upright & (np.abs(miss).max(axis=1) < 20.0)
            assert side.sum() == 1
            # Measured 0.17 at most, of 60 pixels to the axis
            assert np.abs(miss[side]).max() < 0.25


def test_boxes_and_flat_shaded_balls_keep_their_edges(rng: np.random.Generator) -> None:
    points, _, faces = ball(12, 6)
    corners = points[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1)
    corners, across = corners[length > 1e-9], (across / np.maximum(length, 1e-9)[:, None])
    across = across[length > 1e-9]
    across *= np.sign(np.sum(across * corners.mean(axis=1), axis=1))[:, None]
    flat = corners.reshape(-1, 3), np.repeat(across, 3, axis=0), np.arange(3 * len(corners))
    for mesh in (box(), (*flat[:2], flat[2].reshape(-1, 3))):
        edges = of_triangles(*mesh)
        for eye in eyes(rng, 10, 6.0):
            assert len(edges.turning(eye)) >= 4
            assert len(fins_of(edges, eye).vertices) == 0


def test_fins_stand_outwards_and_no_wider_than_they_may(rng: np.random.Generator) -> None:
    edges = of_triangles(*ball(12, 6))
    for eye in eyes(rng, 10, 5.0):
        pixels = FOCAL / SENSOR * SIZE[1] / 4.0
        found = fins_of(edges, eye, 0.02, softness=1.0)
        assert found.heights.min() >= 0.0
        assert 0.0 < found.heights.max() <= 0.02 * pixels
        middle = 0.5 * np.array(SIZE)
        from_middle = found.vertices[:, 0, 0, 8:10] - middle
        assert (np.sum(from_middle * found.vertices[:, 0, 0, 10:12], axis=1) > 0).all()
        rows = np.linalg.norm(found.vertices[..., :2] - middle, axis=-1)
        assert (np.diff(rows, axis=-1) > 0).all()
        fade = found.vertices[..., 0, 3]
        assert 0.5 * 0.02 * pixels < fade.max() <= 0.02 * pixels


def test_under_half_a_pixel_there_are_none_and_they_grow_from_there() -> None:
    edges, eye = of_triangles(*ball(12, 6)), np.array([1.0, 2.0, 5.0])
    # The nearest that the ball comes is 4.4 away: 1 pixel there is 0.0079
    metre = FOCAL / SENSOR * SIZE[1] / 4.4
    assert len(fins_of(edges, eye, 0.49 / metre).vertices) == 0
    heights = [fins_of(edges, eye, w / metre).heights for w in (0.6, 0.62, 1.0, 1.02)]
    most = [h.max(initial=0.0) for h in heights]
    # No jump: a width of 0.02 pixels more lets them stand out by at most 0.02 (2 w / 0.5 - 1)
    assert 0.0 <= most[1] - most[0] < 0.04
    assert 0.0 < most[3] - most[2] < 0.08


def test_a_ball_that_turns_a_little_changes_its_outline_a_little() -> None:
    edges, radii = of_triangles(*ball(16, 8)), []
    angles = np.linspace(-np.pi, np.pi, 361)
    for turn in np.radians(np.arange(0.0, 30.0, 0.25)):
        eye = 5.0 * np.array([np.sin(turn), 0.3, np.cos(turn)])
        found = fins_of(edges, eye)
        outline = (found.vertices[:, :, 1, :2] - 0.5 * np.array(SIZE)).reshape(-1, 2)
        around = np.arctan2(outline[:, 1], outline[:, 0])
        order = np.argsort(around)
        radii.append(
            np.interp(angles, around[order], np.hypot(*outline.T)[order], period=2 * np.pi)
        )
    # Measured 0.24 from view to view although edges come and go; corners move by up to 4.4
    assert np.abs(np.diff(radii, axis=0)).max() < 0.4


def test_the_eye_within_and_points_behind_it_are_no_accident(rng: np.random.Generator) -> None:
    for mesh in (ball(12, 6), rod(12), box()):
        edges = of_triangles(*mesh)
        for eye in rng.uniform(-1.2, 1.2, (40, 3)):
            matrix = seen(eye, eye + rng.normal(size=3))
            found = silhouette.fins(edges, matrix, eye, SIZE, width=0.2, softness=0.5, near=NEAR)
            assert np.isfinite(found.vertices).all()


def test_triangles_join_the_rows_of_each_strip() -> None:
    found = fins_of(ball(12, 6), np.array([1.0, 2.0, 5.0]))
    count, columns = found.heights.shape
    assert found.triangles.shape == (4 * count * (columns - 1), 3)
    assert np.unique(found.triangles).tolist() == list(range(3 * count * columns))
    place = found.vertices.reshape(-1, 13)[:, :2]
    a, b, c = np.moveaxis(place[found.triangles], 1, 0)
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    rows = found.vertices[..., :2]
    d, e = rows[:, :-1, 2] - rows[:, 1:, 0], rows[:, 1:, 2] - rows[:, :-1, 0]
    # Each cell is a quadrilateral of half the cross product of its diagonals, bent in the middle
    whole = 0.5 * np.abs(d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0])
    assert area.sum() == pytest.approx(whole.sum(), rel=0.05)


def test_alpha_adds_what_the_polygon_lacks() -> None:
    half = 0.5
    # Far within, past the tip, and where outline and polygon are one there is nothing to add
    assert silhouette.fin_alpha(-9.0, -10.0, 0.0, half, 1.0) == 0.0
    assert silhouette.fin_alpha(5.0, 0.6, 0.0, half, 1.0) == 0.0
    inside = np.linspace(-0.49, 0.5, 21)
    np.testing.assert_allclose(silhouette.fin_alpha(inside, inside, 0.0, half, 1.0), 0.0, atol=1e-9)
    # What is covered and what is added make what the outline covers
    covered = np.clip(0.5 - inside, 0.0, 1.0)
    alpha = silhouette.fin_alpha(inside, inside - 0.3, 0.0, half, 1.0)
    total = covered + alpha * (1.0 - covered)
    wanted = np.clip(0.5 - (inside - 0.3), 0.0, 1.0)
    np.testing.assert_allclose(total[covered < 1], wanted[covered < 1], atol=1e-6)
    # Crossing a fin that fades it falls from 1 to 0
    past = np.linspace(1.0, 6.0, 50)
    falling = silhouette.fin_alpha(past, past - 2.0, 3.0, half, 1.0)
    assert (np.diff(falling) <= 0.0).all()
    assert (falling[0], falling[-1]) == (1.0, 0.0)


def test_a_hundred_thousand_faces_take_half_a_second() -> None:
    mesh = ball(320, 160)
    assert len(mesh[2]) == 102_400
    spent = []
    for _ in range(2):
        start = process_time()
        edges = of_triangles(*mesh)
        spent.append(process_time() - start)
    # Measured 0.37 s on a busy machine
    assert min(spent) < 1.0
    # As the docstring has it: 44 an edge, 32 a face, 24 a point, 56 a smooth vertex
    points = 320 * 159 + 2
    assert edges.nbytes == 40 * len(edges.ends) + 32 * len(edges.planes) + 80 * points
    assert SimpleNamespace(mb=edges.nbytes / 1e6).mb < 14


@pytest.mark.parametrize("most", [3, 1 << 40])
def test_equal_rows_share_a_number_however_wide_their_columns(
    rng: np.random.Generator, most: int
) -> None:
    # Beyond 62 bits columns are told apart by their ranks
    rows = rng.integers(-most, most, (40, 3))[rng.integers(0, 40, 200)]
    number, first = silhouette_edges._same(*rows.T)
    _, at, wanted = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    np.testing.assert_array_equal(number, wanted.ravel())
    np.testing.assert_array_equal(first, at)
