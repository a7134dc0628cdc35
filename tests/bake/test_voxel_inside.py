"""What a mesh encloses: spheres and boxes whose inside is known."""

import numpy as np

from bake import voxel_inside, voxelise
from tests.bake.small_meshes import sphere_arrays

N = 24  # cells a side


def ball(open_top: float = 2.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (m, 3, 3) of a sphere over N cells, less the faces above `open_top` of its radius;
    the distance of the cells' centres from its middle, in radii; and their height (N, N, N)."""
    vertices, faces = sphere_arrays(24, 48)
    corners = vertices[faces[vertices[faces][:, :, 1].min(axis=1) < open_top]]
    z, y, x = (np.indices((N, N, N)) + 0.5) * 2 / N - 1
    return (corners + 1) * N / 2, np.sqrt(x * x + y * y + z * z), y


def test_a_sphere_and_a_sphere_with_a_hole() -> None:
    vertices, faces = sphere_arrays(8, 16)
    assert voxel_inside.is_closed(vertices, faces)
    assert not voxel_inside.is_closed(vertices, faces[1:])
    # Corners of their own for each face, as STL has them, and both signs of zero
    loose = np.where(vertices == 0, -0.0, vertices)[faces].reshape(-1, 3)
    loose[::2] += 0.0
    assert voxel_inside.is_closed(loose, np.arange(len(loose)).reshape(-1, 3))
    # A sheet twice, front and back, has no hole either
    assert voxel_inside.is_closed(vertices, np.concatenate([faces[:1], faces[:1, ::-1]]))


def test_flood_and_votes_fill_a_closed_sphere_alike() -> None:
    corners, distance, _ = ball()
    surface = voxelise.surface(corners, (N, N, N))
    enclosed = voxel_inside.enclosed(surface)
    voted = voxel_inside.voted(corners, (N, N, N))
    assert not (enclosed & surface).any()
    np.testing.assert_array_equal(enclosed, voted & ~surface)
    # The polyhedron lies between the sphere and one smaller by the sag of its faces, half an edge
    # of pi / 24 off: 1 - cos(pi / 24) = 0.9 % twice over
    assert voted[distance < 0.98].all()
    assert not voted[distance > 1].any()


def test_votes_see_past_a_hole() -> None:
    corners, distance, height = ball(open_top=0.8)
    surface = voxelise.surface(corners, (N, N, N))
    # The flood runs in through the hole
    assert not voxel_inside.enclosed(surface).any()
    voted = voxel_inside.voted(corners, (N, N, N))
    below = height < 0.8
    assert voted[below & (distance < 0.98)].all()
    assert not voted[distance > 1].any()
    assert not voted[height > 0.85].any()


def test_a_box_without_a_side_is_filled_to_its_rim() -> None:
    low, high = 3.0, 9.0
    square = np.array([[low, low], [high, low], [high, high], [low, high]])
    walls = []
    for axis in range(3):
        for level in (low, high):
            if (axis, level) != (2, high):
                wall = np.insert(square, axis, level, axis=1)
                walls += [wall[[0, 1, 2]], wall[[0, 2, 3]]]
    voted = voxel_inside.voted(np.array(walls), (12, 12, 12))
    expected = np.zeros((12, 12, 12), bool)
    expected[3:9, 3:9, 3:9] = True
    np.testing.assert_array_equal(voted, expected)


def test_no_line_is_counted_twice_or_not_at_all_on_a_shared_edge(rng: np.random.Generator) -> None:
    """Edges that go exactly through centres of columns: each line still meets a wall once."""
    grid = np.arange(9) + 0.5
    x, y = np.meshgrid(grid, grid)
    z = rng.integers(2, 7, x.shape) + 0.25
    points = np.stack([x, y, z], axis=-1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    flip = rng.random((*a.shape[:2], 1, 1)) < 0.5
    first = np.where(flip, np.stack([a, b, c], axis=2), np.stack([a, b, d], axis=2))
    second = np.where(flip, np.stack([c, d, a], axis=2), np.stack([b, c, d], axis=2))
    corners = np.concatenate([first.reshape(-1, 3, 3), second.reshape(-1, 3, 3)])
    crossings = voxel_inside._crossings(corners, (9, 9, 9), 2).sum(axis=0)
    # A half-open rule: the last row and column of lines belong to neighbours that are not there
    np.testing.assert_array_equal(crossings[:8, :8], 1)
    assert not crossings[8].any()
    assert not crossings[:, 8].any()


def test_rows_spread_by_the_fewest_steps(rng: np.random.Generator) -> None:
    inside = rng.random((7, 8, 9)) < 0.7
    rows = np.zeros(inside.shape, np.uint16)
    seeds = np.argwhere(~inside)[rng.permutation(np.count_nonzero(~inside))[:4]]
    rows[tuple(seeds.T)] = [1, 2, 3, 4]
    found = rows.copy()
    voxel_inside.spread(found, inside)
    # Slow truth: steps from each seed alone
    steps = np.full((5, *inside.shape), 1000)
    for row, seed in enumerate(seeds, 1):
        steps[row][tuple(seed)] = 0
        for _ in range(80):
            padded = np.pad(steps[row], 1, constant_values=1000)
            around = [
                np.roll(padded, s, axis=a)[1:-1, 1:-1, 1:-1] for a in range(3) for s in (1, -1)
            ]
            steps[row] = np.minimum(steps[row], np.where(inside, np.min(around, axis=0) + 1, 1000))
    reached = inside & (steps.min(axis=0) < 1000)
    assert reached.sum() > 200
    taken = np.take_along_axis(steps, found[None].astype(int), axis=0)[0]
    np.testing.assert_array_equal(taken[reached], steps.min(axis=0)[reached])
    np.testing.assert_array_equal(found[~inside], rows[~inside])
    assert not found[inside & ~reached].any()
