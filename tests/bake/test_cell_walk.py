"""The walk from cell to cell against a slow one by small steps, and where it must not slip."""

import numpy as np
import pytest

from bake.cell_walk import first_solid

RNG = np.random.default_rng(4)
RAYS, STEP = 60, 5e-3


def test_it_finds_what_small_steps_find() -> None:
    solid = RNG.random((6, 7, 8)) < 0.2
    empty = np.argwhere(~solid)[:, ::-1]
    origins = empty[RNG.integers(len(empty), size=RAYS)] + RNG.uniform(0.1, 0.9, (RAYS, 3))
    directions = RNG.normal(size=(RAYS, 3))
    cell, face, distance = first_solid(solid, origins, directions)
    for k in range(RAYS):
        t = 0.0
        expected = -1
        while True:
            t += STEP
            at = np.floor(origins[k] + t * directions[k]).astype(int)
            if np.any(at < 0) or np.any(at >= (8, 7, 6)):
                break
            if solid[at[2], at[1], at[0]]:
                expected = (at[2] * 7 + at[1]) * 8 + at[0]
                break
        # Steps may pass over the corner of a cell, never the other way round
        if cell[k] != expected:
            near = origins[k] + distance[k] * directions[k]
            corner = np.abs(near - np.rint(near))
            assert np.sort(corner)[1] < 5 * STEP
            continue
        assert np.isfinite(distance[k]) == (expected >= 0)
        if expected >= 0:
            assert t - STEP - 1e-9 <= distance[k] <= t + 1e-9
            axis, down = divmod(int(face[k]), 2)
            assert (directions[k, axis] > 0) == bool(down)


def test_rays_along_the_axes_and_along_sides_of_cells() -> None:
    solid = np.zeros((3, 3, 5), bool)
    solid[1, 1, 4] = True
    for y in (1.0, 1.5):
        cell, face, distance = first_solid(
            solid, np.array([[0.25, y, 1.5]]), np.array([[2.0, 0.0, 0.0]])
        )
        assert (int(cell[0]), int(face[0]), float(distance[0])) == ((3 + 1) * 5 + 4, 1, 1.875)
    missed = first_solid(solid, np.array([[0.25, 2.0, 1.5]]), np.array([[2.0, 0.0, 0.0]]))
    assert (int(missed[0][0]), int(missed[1][0]), float(missed[2][0])) == (-1, -1, np.inf)


def test_cells_that_touch_along_an_edge_stop_what_aims_between_them() -> None:
    # A wall of cells that touch along edges alone; every third ray aims at an edge exactly
    n = 12
    solid = np.zeros((3, n, n), bool)
    solid[:, np.arange(n), np.arange(n)] = True
    origins = np.array([n - 1.5, 1.5, 1.5]) + RNG.uniform(-1, 1, (3000, 3)) * (1, 1, 0)
    edges = RNG.integers(4, n - 4, 3000)[:, None] * np.array([1.0, 1, 0]) + [0, 0, 1.5]
    directions = edges - origins
    directions[1::3] += RNG.normal(size=(1000, 3)) * 1e-15
    directions[2::3] += RNG.normal(size=(1000, 3)) * (0.3, 0.3, 0)
    cell, _, _ = first_solid(solid, origins, directions)
    assert np.all(cell >= 0)


def test_a_ray_needs_a_direction() -> None:
    with pytest.raises(ValueError, match="direction"):
        first_solid(np.zeros((1, 1, 1), bool), np.zeros((1, 3)), np.zeros((1, 3)))
