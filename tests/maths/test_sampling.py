"""Triples of sample, pdf, invert; even point sets; cap quadrature."""

import numpy as np
import pytest
from scipy import integrate

from maths import sampling as s

GRID = (np.stack(np.meshgrid(np.arange(64), np.arange(64), indexing="ij"), -1) + 0.5) / 64


@pytest.mark.parametrize("half_angle", [0.0047, 0.5, np.pi / 2, 3.0])
def test_cone_round_trip(half_angle: float) -> None:
    d = s.uniform_cone(GRID, half_angle)
    assert np.allclose(np.linalg.norm(d, axis=-1), 1, rtol=0, atol=1e-15 * 4)
    # 1 - z of a cone of .0047 has lost nothing: x and y carry it
    assert np.allclose(s.invert_uniform_cone(d, half_angle), GRID, rtol=0, atol=1e-11)
    solid_angle = 2 * np.pi * (1 - np.cos(half_angle))
    assert np.isclose(s.uniform_cone_pdf(half_angle) * solid_angle, 1, rtol=1e-9)
    # Even in z: the mean of z is that of a uniform distribution
    assert np.isclose(d[..., 2].mean(), 0.5 * (1 + np.cos(half_angle)), rtol=1e-13)


def test_disc_round_trip_and_area() -> None:
    p = s.concentric_disc(GRID)
    assert np.allclose(s.invert_concentric_disc(p), GRID, rtol=0, atol=1e-14)
    r = np.linalg.norm(p, axis=-1)
    assert r.max() < 1
    assert np.all(s.concentric_disc_pdf(p) == 1 / np.pi)
    assert s.concentric_disc_pdf([2.0, 0.0]) == 0
    # Squares go to circles: the 32^2 in the middle are within half a radius
    assert np.count_nonzero(r < 0.5) == 32 * 32
    assert s.concentric_disc([[0, 0], [1, 0.5], [0.5, 0]]).round(12).tolist() == [
        [-0.707106781187, -0.707106781187],
        [1, 0],
        [0, -1],
    ]


def test_cosine_hemisphere_round_trip_and_moments() -> None:
    d = s.cosine_hemisphere(GRID)
    assert np.allclose(s.invert_cosine_hemisphere(d), GRID, rtol=0, atol=1e-13)
    # E[z] = 2/3, E[z^2] = 1/2 for cos / pi: midpoint rule on 64^2
    # cells, 64^-1.5 = 2e-3 where z falls to 0 like a square root
    assert abs(d[..., 2].mean() - 2 / 3) < 2e-3
    assert abs((d[..., 2] ** 2).mean() - 1 / 2) < 1e-3
    # The density integrates to one over the hemisphere
    total = integrate.quad(
        lambda z: 2 * np.pi * s.cosine_hemisphere_pdf(np.array([np.sqrt(1 - z * z), 0, z])), 0, 1
    )[0]
    assert abs(total - 1) < 1e-12
    assert s.cosine_hemisphere_pdf([0.0, 0.0, -1.0]) == 0


def test_r2_fills_boxes_far_better_than_random(rng: np.random.Generator) -> None:
    n = 1024
    corners = rng.uniform(size=(500, 2))

    def discrepancy(points):
        inside = np.all(points[None] < corners[:, None], axis=-1).mean(axis=1)
        return np.abs(inside - corners.prod(axis=1)).max()

    for start in (0, 12345):
        points = s.r2(np.arange(start, start + n))
        assert points.min() >= 0
        assert points.max() < 1
        # Random points: about 1 / sqrt(N) = .03
        assert discrepancy(points) < 0.006
    assert discrepancy(rng.uniform(size=(n, 2))) > 0.012


def test_r2_offset_wraps() -> None:
    moved = s.r2(np.arange(100), [0.3, 0.9])
    assert np.allclose(
        moved, np.mod(s.r2(np.arange(100)) + np.array([0.3, 0.9]), 1), rtol=0, atol=1e-13
    )


def test_fibonacci_sphere_measures_a_cap() -> None:
    axis = np.array([0.48, 0.6, 0.64])
    for count in (256, 1024, 4096):
        points = s.fibonacci_sphere(count, s.random_rotation(1))
        assert np.allclose(np.linalg.norm(points, axis=-1), 1, rtol=0, atol=1e-14)
        share = np.mean(points @ axis > np.cos(np.radians(40)))
        truth = 0.5 * (1 - np.cos(np.radians(40)))
        # N^-3/4, as for stratified points; random ones stay at sqrt(p q / N) = .02 for 256
        assert abs(share - truth) < 1.5 * count**-0.75
    with pytest.raises(ValueError, match="one or more"):
        s.fibonacci_sphere(0)


def test_random_rotations_are_rotations_and_spread() -> None:
    R = s.random_rotation(7, np.arange(4096))
    assert np.allclose(R @ np.swapaxes(R, -1, -2), np.eye(3), rtol=0, atol=1e-14)
    assert np.allclose(np.linalg.det(R), 1, rtol=0, atol=1e-14)
    # Every element has mean 0 and variance 1/3: 5 sigma of 4096
    assert np.abs(R.mean(axis=0)).max() < 5 * np.sqrt(1 / 3 / 4096)
    assert np.abs((R**2).mean(axis=0) - 1 / 3).max() < 5 * np.sqrt(4 / 45 / 4096)


def test_basis_is_right_handed_everywhere(rng: np.random.Generator) -> None:
    n = rng.normal(size=(1000, 3))
    n[:4] = [[0, 0, 1], [0, 0, -1], [1e-9, 0, -1], [0, -1e-200, -1]]
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    a, b = s.orthonormal_basis(n)
    frame = np.stack([a, b, n], axis=-2)
    assert np.allclose(frame @ np.swapaxes(frame, -1, -2), np.eye(3), rtol=0, atol=1e-14)
    assert np.allclose(np.cross(a, b), n, rtol=0, atol=1e-14)


@pytest.mark.parametrize("half_angle", [0.01, 0.4, 1.5, np.pi])
def test_cap_quadrature_measures_the_cap(half_angle: float, rng: np.random.Generator) -> None:
    centre = rng.normal(size=(40, 3))
    centre[:2] = [[0, 0, 1], [0, 0, -1]]
    centre /= np.linalg.norm(centre, axis=-1, keepdims=True)
    d, area = s.cap_quadrature(centre, np.full(40, half_angle), (32, 8))
    assert np.all(area >= 0)
    # 32 strips see the corners of a rim that touches a pole to 2e-4
    assert np.allclose(area.sum(-1) / (2 * np.pi * (1 - np.cos(half_angle))), 1, rtol=0, atol=1e-3)
    lit = area > 0
    outside = np.sum(d * centre[:, None], -1) < np.cos(half_angle) - 1e-9
    assert not np.any(outside & lit)
    # Above and below make the whole
    _, above = s.cap_quadrature(centre, np.full(40, half_angle), (32, 8), above=True)
    _, below = s.cap_quadrature(centre * [1, 1, -1], np.full(40, half_angle), (32, 8), above=True)
    halves = (above.sum(-1) + below.sum(-1)) / (2 * np.pi * (1 - np.cos(half_angle)))
    assert np.allclose(halves, 1, rtol=0, atol=1e-3)
