"""Rays through cubes against interval arithmetic over all cells, and against closed forms."""

import numpy as np
import pytest

from maths import voxel_traversal as traversal

SIZE = (7, 5, 6)  # nx, ny, nz


def world(rng, share=0.15, size=SIZE):
    return rng.random(size[::-1]) < share


def rays(rng, solid, count):
    """Rays from anywhere inside of empty cells, and in all sorts of directions."""
    z, y, x = np.nonzero(~solid)
    row = rng.integers(0, len(x), count)
    cell = np.stack([x, y, z], axis=1)[row]
    direction = rng.normal(size=(count, 3))
    # Some along an axis or in a plane
    flat = rng.random((count, 3)) < 0.15
    flat[flat.all(axis=1)] = False
    direction[flat] = 0
    return cell, cell + rng.random((count, 3)), direction


def slow(solid, cell, origin, direction):
    """First solid cell by the interval of t in which a ray is in each; cells it crosses; t."""
    best, where, crossed = np.inf, None, 0
    for z, y, x in np.ndindex(solid.shape):
        low, high = 0.0, np.inf
        for axis, c in enumerate((x, y, z)):
            if direction[axis] == 0:
                if not c <= origin[axis] < c + 1:
                    low, high = 1.0, 0.0
                continue
            ends = (np.array([c, c + 1]) - origin[axis]) / direction[axis]
            low, high = max(low, ends.min()), min(high, ends.max())
        if low < high:
            crossed += 1
            if solid[z, y, x] and low < best:
                best, where = low, (x, y, z)
    return best, where, crossed


def test_hits_are_those_of_interval_arithmetic(rng):
    solid = world(rng)
    cell, origin, direction = rays(rng, solid, 150)
    found = traversal.exact(solid, cell, origin, direction)
    misses = 0
    for i in range(len(cell)):
        t, where, _ = slow(solid, cell[i], origin[i], direction[i])
        if where is None:
            misses += 1
            assert found.face[i] == traversal.MISS
            continue
        assert tuple(found.cell[i]) == where
        # One subtraction and one product in float64
        assert found.t[i] == pytest.approx(t, rel=1e-12)
        axis, up = divmod(int(found.face[i]), 2)
        place = origin[i, axis] + found.t[i] * direction[i, axis]
        # +x is met by rays that go down the axis
        assert place == pytest.approx(where[axis] + (up == 0), abs=1e-12)
        assert (direction[i, axis] < 0) == (up == 0)
    assert 10 < misses < 140


def test_every_crossed_cell_is_visited_once(rng):
    empty = np.zeros(SIZE[::-1], bool)
    cell, origin, direction = rays(rng, empty, 60)
    found = traversal.exact(empty, cell, origin, direction)
    np.testing.assert_array_equal(found.visited, 1 + np.abs(found.cell - cell).sum(axis=1))
    # The outside counts as one
    crossed = [slow(empty, cell[i], origin[i], direction[i])[2] for i in range(len(cell))]
    np.testing.assert_array_equal(found.visited, np.array(crossed) + 1)


def test_axes_grid_lines_and_other_starts():
    solid = np.zeros((4, 4, 4), bool)
    solid[1, 1, 3] = True
    # Along a grid line cells are half open; from a face the cell is the one that is named
    found = traversal.exact(solid, [[0, 1, 1]], [[0.0, 1.0, 1.0]], [[2.0, 0.0, 0.0]])
    assert (found.cell[0].tolist(), found.face[0], found.t[0]) == ([3, 1, 1], 1, 1.5)
    found = traversal.exact(solid, [[2, 1, 1]], [[3.0, 1.5, 1.5]], [[1.0, 0.0, 0.0]])
    assert (found.face[0], found.t[0]) == (1, 0.0)
    found = traversal.exact(solid, [[3, 1, 1]], [[3.0, 1.5, 1.5]], [[1.0, 0.0, 0.0]])
    assert found.face[0] == traversal.INSIDE
    found = traversal.exact(solid, [[9, 1, 1]], [[9.0, 1.5, 1.5]], [[1.0, 0.0, 0.0]])
    assert (found.face[0], found.visited[0]) == (traversal.MISS, 1)
    for direction in ([0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [np.inf, 0.0, 1.0]):
        with pytest.raises(ValueError, match=r"(?i)ray"):
            traversal.exact(solid, [[0, 0, 0]], [[0.5, 0.5, 0.5]], [direction])


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_walls_that_touch_by_edges_or_corners_alone_leak_nothing(rng, kind):
    """Cells with x + y + z = 12, a wall that only touches itself at corners and edges."""
    n = 16
    z, y, x = np.indices((n, n, n))
    cell = rng.integers(0, 4, (40000, 3))
    # Half the rays start at middles and run along diagonals: they meet edges and corners exactly
    origin = np.where(rng.random((len(cell), 1)) < 0.5, cell + 0.5, cell + rng.random(cell.shape))
    direction = np.where(rng.random(cell.shape) < 0.5, 1.0, rng.random(cell.shape))
    arguments = (cell, origin.astype(kind), direction.astype(kind))
    for normal, plane in (((1, 1, 1), 12), ((1, 1, 0), 9), ((0, 1, 1), 8)):
        wall = np.tensordot(normal, [x, y, z], 1) == plane
        slowly = traversal.exact(wall, *arguments)
        fast = traversal.sphere(traversal.distances(wall), *arguments)
        for hits in (slowly, fast):
            # Who misses the wall leaves on this side of it
            missed = hits.face == traversal.MISS
            assert np.all(hits.cell[missed] @ normal < plane)
            assert np.mean(~missed) > 0.5


def test_leaps_hit_what_steps_hit(rng):
    solid = world(rng, 0.008, (40, 32, 36))
    cell, origin, direction = rays(rng, solid, 6000)
    slowly = traversal.exact(solid, cell, origin, direction)
    fast = traversal.sphere(traversal.distances(solid), cell, origin, direction)
    np.testing.assert_array_equal(fast.face, slowly.face)
    hit = slowly.face >= 0
    np.testing.assert_array_equal(fast.cell[hit], slowly.cell[hit])
    np.testing.assert_allclose(fast.t[hit], slowly.t[hit], rtol=1e-12)
    assert hit.mean() > 0.1
    assert fast.visited.mean() < 0.5 * slowly.visited.mean()


def test_distances_are_those_to_the_nearest(rng):
    solid = world(rng, 0.01, (12, 9, 10))
    where = np.argwhere(solid)
    every = np.argwhere(np.ones_like(solid))
    apart = np.abs(every[:, None] - where[None]).max(axis=2).min(axis=1)
    found = traversal.distances(solid, 4)
    np.testing.assert_array_equal(found.ravel(), np.minimum(apart, 4))
    with pytest.raises(ValueError, match="reaches"):
        traversal.distances(solid, 0)


@pytest.mark.parametrize("step", [1.25, 2.0, 5.0])
def test_fixed_steps_miss_a_wall_as_often_as_the_formula_says(rng, step):
    """A wall one cell thick, chord 1 / cos: missed with chance max(0, 1 - chord / step)."""
    solid = np.zeros((40, 40, 40), bool)
    solid[:, :, 20] = True
    m, slope = 20000, 0.6
    cell = np.tile([2, 5, 20], (m, 1))
    direction = np.tile([1.0, slope, 0.0] / np.hypot(1, slope), (m, 1))
    jitter, samples = rng.random(m), round(30 / step)
    found = traversal.march(solid, cell, cell + 0.5, direction, samples * step, samples, jitter)
    chance = max(0.0, 1 - np.hypot(1, slope) / step)
    missed = np.mean(found.face == traversal.MISS)
    # Five standard errors of a share
    assert abs(missed - chance) <= 5 * np.sqrt(chance * (1 - chance) / m)
    hit = found.face >= 0
    assert np.all(found.face[hit] == 1)
    assert np.all(found.cell[hit, 0] == 20)


def test_rays_leave_where_the_box_ends(rng):
    empty = np.zeros(SIZE[::-1], bool)
    cell, origin, direction = rays(rng, empty, 500)
    length = traversal.exit_length(SIZE, origin, direction)
    np.testing.assert_allclose(
        length, traversal.exact(empty, cell, origin, direction).t, rtol=1e-12
    )
