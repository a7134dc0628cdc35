"""Polygons: tables of configuration factors, brute force, additivity, limits."""

import numpy as np
import pytest

from maths.polygon_lights import (
    polygon_irradiance,
    polygon_solid_angle,
    rectangle_corners,
    rectangle_irradiance,
)
from maths.sampling import random_rotation

ORIGIN = np.zeros(3)
UP = np.array([0.0, 0.0, 1.0])


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def slow_rectangle(n, c, u, v, cells=600):
    """Mean of clamped cosines over cells of the area; the horizon costs about cells^-2."""
    x = (np.arange(cells) + 0.5) / cells * 2 - 1
    r = c + x[:, None, None] * u + x[:, None] * v
    area = np.cross(u, v)
    return 4 * np.mean(np.maximum(0, r @ n) * np.abs(r @ area) / np.sum(r * r, -1) ** 2)


def test_a_rectangle_parallel_to_the_receiver() -> None:
    for X, Y in ((1.3, 0.7), (0.01, 5.0), (300.0, 200.0)):
        p, q = np.sqrt(1 + X * X), np.sqrt(1 + Y * Y)
        expected = 0.5 * (X / p * np.arctan(Y / p) + Y / q * np.arctan(X / q))
        corners = np.array([[0, 0, 1.0], [0, Y, 1], [X, Y, 1], [X, 0, 1]])
        assert abs(polygon_irradiance(ORIGIN, UP, corners, 1.0) - expected) < 1e-15 * 4
        assert polygon_irradiance(ORIGIN, UP, corners[::-1], 1.0) == 0


def test_a_rectangle_at_right_angles_to_the_receiver() -> None:
    for b, a, c in ((1.0, 2.0, 0.5), (0.1, 3.0, 1.0), (10.0, 10.0, 0.1)):
        Y = c / b
        A = 1 / np.sqrt((a / b) ** 2 + Y * Y)
        expected = 0.5 * (np.arctan(1 / Y) - A * Y * np.arctan(A))
        # A wall of width b and height a at distance c, from its corner's foot
        corners = np.array([[c, 0, 0], [c, b, 0], [c, b, a], [c, 0, a]], float)
        found = polygon_irradiance(ORIGIN, UP, corners, 1.0, two_sided=True)
        assert abs(found - expected) < 1e-14
        # What the ground hides makes no difference
        deep = np.array([[c, 0, -3], [c, b, -3], [c, b, a], [c, 0, a]], float)
        assert abs(polygon_irradiance(ORIGIN, UP, deep, 1.0, two_sided=True) - expected) < 1e-14


def test_walls_without_end_and_a_box_all_around() -> None:
    far = 1e8
    wall = np.array([[1, -far, 0], [1, far, 0], [1, far, far], [1, -far, far]], float)
    # An endless wall is half the sky by cosine, the edge left over 1e-8
    assert abs(polygon_irradiance(ORIGIN, UP, wall, 1.0, two_sided=True) - np.pi / 2) < 1e-7
    n = unit(np.array([[0.3, -0.5, 0.8], [1, 0, 0], [0, 0, -1]]))
    total = np.zeros(3)
    for axis in range(3):
        for side in (-1.0, 1.0):
            c, u, v = side * np.eye(3)[axis], np.eye(3)[axis - 2], np.eye(3)[axis - 1]
            total += rectangle_irradiance([0.3, -0.2, 0.9], n, c, u, v, 1.0, two_sided=True)
    # Inside a closed box of radiance 1, whatever the horizon cuts
    np.testing.assert_allclose(total, np.pi, rtol=0, atol=1e-14)


def test_brute_force_over_the_area(rng: np.random.Generator) -> None:
    for _ in range(8):
        c, n = rng.normal(size=3) * 1.5, unit(rng.normal(size=3))
        u, v = rng.normal(size=(2, 3)) * 0.5
        if abs(c @ unit(np.cross(u, v))) < 0.3:
            continue
        found = rectangle_irradiance(ORIGIN, n, c, u, v, 1.0, two_sided=True)
        # Cells of 600^2 that the horizon cuts: measured under 1e-5
        assert abs(found - slow_rectangle(n, c, u, v)) < 3e-5


def test_the_whole_is_its_parts(rng: np.random.Generator) -> None:
    count = 500
    n, size = unit(rng.normal(size=(count, 3))), 10.0 ** rng.uniform(-6, 6, (count, 1))
    a, b, c, d = (np.array(x, float) for x in ([0, 0, 0], [1, 0.2, 0], [1.5, 1, 0], [0.2, 1.3, 0]))
    turn, move = random_rotation(np.arange(count)), rng.normal(size=(count, 1, 3))
    shapes = [np.stack(x) for x in ([a, b, c, d], [a, b, c], [a, c, d], [a, b, d], [b, c, d])]
    placed = [(s @ np.swapaxes(turn, -1, -2) + move) * size[..., None] for s in shapes]
    E = [polygon_irradiance(ORIGIN, n, s, 1.0, two_sided=True) for s in placed]
    lit = E[0] > 0
    assert 0.5 < lit.mean() < 0.95
    assert np.abs(E[0] - E[1] - E[2]).max() < 1e-14
    assert np.abs(E[0] - E[3] - E[4]).max() < 1e-14
    solid = [polygon_solid_angle(ORIGIN, s) for s in placed]
    assert np.abs(solid[0] - solid[1] - solid[2]).max() < 1e-14


def test_a_polygon_that_is_not_convex_and_comes_up_twice() -> None:
    """A comb whose two teeth stand over the horizon is its two teeth."""
    comb = np.array([[1, -3, -1], [1, 3, -1], [1, 3, 1], [1, 1, 1], [1, 1, -0.5], [1, -1, -0.5]])
    comb = np.concatenate([comb, [[1, -1, 2], [1, -3, 2]]])
    right = [[1, 1, 0], [1, 3, 0], [1, 3, 1], [1, 1, 1]]
    left = [[1, -3, 0], [1, -1, 0], [1, -1, 2], [1, -3, 2]]
    whole = polygon_irradiance(ORIGIN, UP, comb, 1.0, two_sided=True)
    parts = sum(polygon_irradiance(ORIGIN, UP, t, 1.0, two_sided=True) for t in (left, right))
    assert abs(whole - parts) < 1e-15


@pytest.mark.parametrize("size", [1e-3, 1e-6])
def test_a_tiny_rectangle_is_a_point(size: float, rng: np.random.Generator) -> None:
    n, c = unit(rng.normal(size=(2, 300, 3)))
    u, v = np.array([1.0, 0, 0]), np.array([0, 0.5, 0])
    found = rectangle_irradiance(ORIGIN, n, c, size * u, size * v, 1.0, two_sided=True)
    point = 2 * size**2 * np.abs(c[:, 2]) * np.maximum(0, np.sum(n * c, -1))
    # The middle of an even spread: first order vanishes above the horizon, size at it; the corners
    # themselves round by 1e-16 / size
    clear = np.abs(np.sum(n * c, -1)) > 2 * size
    assert np.abs(found - point)[clear].max() / size**2 < 20 * size**2 + 1e-15 / size
    assert np.abs(found - point).max() / size**2 < 2 * size


def test_where_two_forms_meet_they_agree(rng: np.random.Generator) -> None:
    """Size / distance = FAR: the closed form has 1e-16 / .004 of its own, Radon's rule 1e-16."""
    count = 500
    c = unit(rng.normal(size=(count, 3)))
    n = unit(np.cross(c, rng.normal(size=(count, 3)))) + c * 0.002 * rng.uniform(-1, 1, (count, 1))
    u = unit(rng.normal(size=(count, 3)))
    v = np.cross(u, unit(rng.normal(size=(count, 3))))
    corners = rectangle_corners(c, 0.0016 * u, 0.0016 * v)
    big = polygon_irradiance(ORIGIN, unit(n), corners, 1.0, two_sided=True)
    quarters = np.zeros(count)
    for i in (-0.5, 0.5):
        for j in (-0.5, 0.5):
            at = c + 0.0016 * (i * u + j * v)
            quarter = rectangle_corners(at, 0.0008 * u, 0.0008 * v)
            quarters += polygon_irradiance(ORIGIN, unit(n), quarter, 1.0, two_sided=True)
    assert np.abs(big - quarters).max() / 0.0016**2 < 1e-11


def test_in_its_plane_and_without_an_area() -> None:
    n = unit(np.array([[0.0, 0, 1], [1, 0, 0], [1, 2, 3]]))
    square = rectangle_corners(ORIGIN, [1.0, 0, 0], [0, 1.0, 0])
    for at in ([0.0, 0, 0], [1.0, 0, 0], [1.0, 1, 0], [4.0, 0, 0]):
        assert np.all(polygon_irradiance(at, n, square, 1.0, two_sided=True) == 0)
        assert polygon_solid_angle(at, square) == 0
    for flat in (square * 0, square * [1.0, 0, 0]):
        assert np.all(polygon_irradiance([0.0, 0, 1], n, flat, 1.0, two_sided=True) == 0)
    with pytest.raises(ValueError, match="three finite corners"):
        polygon_irradiance(ORIGIN, UP, square[:2], 1.0)


def test_solid_angle_of_a_rectangle() -> None:
    """On axis: 4 asin(a b / sqrt((a^2 + h^2)(b^2 + h^2)))."""
    for a, b, h in ((1.0, 1.0, 1.0), (0.2, 3.0, 0.5), (1e-5, 2e-5, 1.0), (100.0, 50.0, 0.1)):
        expected = 4 * np.arcsin(a * b / np.sqrt((a * a + h * h) * (b * b + h * h)))
        found = polygon_solid_angle(ORIGIN, rectangle_corners([0, 0, h], [a, 0, 0], [0, b, 0]))
        np.testing.assert_allclose(found, expected, rtol=1e-8 if b > 10 else 1e-13)
