"""Triangles against cells: exact clipping, a cell at a time, is the truth."""

from fractions import Fraction

import numpy as np
import pytest

from bake import triangle_boxes

SIZE = (4, 5, 3)


def found(corners: np.ndarray, size: tuple[int, int, int] = SIZE) -> set[tuple[int, int]]:
    """Return the pairs (triangle, cell)."""
    parts = list(triangle_boxes.overlaps(corners, size))
    pairs = [pair for faces, cells in parts for pair in zip(faces, cells, strict=True)]
    assert len(set(pairs)) == len(pairs)
    return {(int(face), int(cell)) for face, cell in pairs}


def clipped(corners: list, low: tuple[int, int, int]) -> list:
    """Cut a polygon to a closed unit cell (Sutherland, Hodgman 1974), in the numbers given."""
    polygon = corners
    for axis in range(3):
        for sign, limit in ((1, low[axis]), (-1, -low[axis] - 1)):
            kept = []
            for start, end in zip(polygon, polygon[1:] + polygon[:1], strict=True):
                a, b = sign * start[axis] - limit, sign * end[axis] - limit
                if a >= 0:
                    kept.append(start)
                if (a > 0 > b) or (a < 0 < b):
                    t = a / (a - b)
                    kept.append([s + t * (e - s) for s, e in zip(start, end, strict=True)])
            polygon = kept
    return polygon


def truth(corners: np.ndarray, number: type) -> tuple[set, set]:
    """Return the pairs that touch a closed cell, and those that touch one without upper sides.

    A convex polygon lies in no upper side exactly when the mean of its corners lies in none.
    """
    closed, half_open = set(), set()
    nx, ny, nz = SIZE
    for face, triangle in enumerate(corners):
        exact = [[number(float(x)) for x in corner] for corner in triangle]
        lowest, highest = triangle.min(axis=0) - 1, triangle.max(axis=0)
        for low in np.ndindex(SIZE):
            if (np.array(low) < lowest).any() or (np.array(low) > highest).any():
                continue
            polygon = clipped(exact, low)
            if not polygon:
                continue
            cell = (low[2] * ny + low[1]) * nx + low[0]
            closed.add((face, cell))
            mean = [sum(p[axis] for p in polygon) / len(polygon) for axis in range(3)]
            if all(mean[axis] < min(low[axis] + 1, SIZE[axis]) for axis in range(3)):
                half_open.add((face, cell))
    assert nz == SIZE[2]
    return closed, half_open


@pytest.mark.parametrize("small", [0, 2, 4])
def test_random_triangles_touch_what_clipping_says(
    small: int, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(triangle_boxes, "SMALL", small)
    monkeypatch.setattr(triangle_boxes, "TOGETHER", 100)
    centre = rng.random((60, 1, 3)) * SIZE
    spread = rng.choice([0.3, 1.0, 4.0], (60, 1, 1))
    corners = np.clip(centre + spread * (rng.random((60, 3, 3)) - 0.5), 0, SIZE)
    # Those cut off at the box lie in its sides: what they touch on the upper ones has no cell
    inside = ((corners > 0) & (corners < SIZE)).all(axis=(1, 2))
    assert inside.sum() > 20
    closed, half_open = truth(corners[inside], float)
    assert closed == half_open
    assert found(corners[inside]) == closed


@pytest.mark.parametrize("small", [0, 4])
def test_corners_on_the_grid_touch_as_exact_numbers_say(
    small: int, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    """Half cells: many edges and planes go through corners of cells, or lie in their sides."""
    monkeypatch.setattr(triangle_boxes, "SMALL", small)
    corners = rng.integers(0, 2 * np.array(SIZE) + 1, (60, 3, 3)) / 2
    corners[:20, :, 2] = corners[:20, :1, 2]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners = corners[area.any(axis=1)]
    closed, half_open = truth(corners, Fraction)
    assert half_open < closed
    pairs = found(corners)
    assert half_open <= pairs <= closed


def test_slivers_lose_no_cell(rng: np.random.Generator) -> None:
    start, end = rng.random((2, 40, 3)) * (np.array(SIZE) - 1e-6)
    third = start + rng.random((40, 1)) * (end - start) + 1e-9 * rng.random((40, 3))
    corners = np.stack([start, end, third], axis=1)
    _, half_open = truth(corners, Fraction)
    pairs = found(corners)
    assert half_open <= pairs
    # Their planes are unsure, their edges are not: few cells are added
    assert len(pairs) <= 1.02 * len(half_open)


def test_a_plane_between_cells_touches_the_upper_ones_only() -> None:
    square = np.array([[[0.5, 0.5, 1], [2.5, 0.5, 1], [0.5, 2.5, 1]]])
    for axis in range(3):
        turned = np.roll(square, axis, axis=2)
        cells = np.array([cell for _, cell in found(turned, (3, 3, 3))])
        across = cells // [9, 1, 3][axis] % 3
        assert len(cells) == 6 + 2  # a triangle of side 2 from the middle of a cell touches 8
        assert (across == 1).all()


def test_the_upper_end_of_the_box_belongs_to_its_last_cells() -> None:
    corners = np.array([[[4.0, 0.2, 0.2], [4.0, 0.8, 0.2], [4.0, 0.2, 0.8]]])
    assert found(corners) == {(0, 3)}


def test_what_has_no_area_touches_nothing() -> None:
    line = np.array([[[0.1, 0.1, 0.1], [2.1, 2.1, 2.1], [1.1, 1.1, 1.1]]])
    assert found(line) == set()
    assert found(np.zeros((0, 3, 3))) == set()


def test_large_triangles_come_the_same_both_ways(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    size = (40, 30, 50)
    corners = rng.random((30, 3, 3)) * size
    expected = found(corners, size)
    monkeypatch.setattr(triangle_boxes, "SMALL", 50)
    assert found(corners, size) == expected
    assert len(expected) > 10000
