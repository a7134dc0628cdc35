"""Sums over many flat lights by few points of each, against their outlines."""

import numpy as np
import pytest

from maths.sampling import random_rotation
from maths.spherical_cubature import (
    MARGIN,
    Patches,
    _rule,
    disc_patches,
    is_parallelogram,
    polygon_patches,
    reach,
    total,
)
from maths.spherical_lights import project_disc, project_polygon

PRECISION = 1e-3
POINTS = np.array([[0.0, 0, 0], [0.3, -0.2, 0.1], [-1.0, 0.5, 0.2]])


def monomial(shape: str, i: int, j: int) -> float:
    """Mean of x^i y^j over the square +-1, the unit disc, or the unit triangle."""
    from math import factorial, gamma

    if shape == "triangle":
        return 2 * factorial(i) * factorial(j) / factorial(i + j + 2)
    if i % 2 or j % 2:
        return 0.0
    if shape == "parallelogram":
        return 1 / ((i + 1) * (j + 1))
    around = 2 * gamma((i + 1) / 2) * gamma((j + 1) / 2) / gamma((i + j) / 2 + 1)
    return float(around / ((i + j + 2) * np.pi))


@pytest.mark.parametrize("shape", MARGIN)
def test_rules_are_exact_to_their_degrees(shape: str) -> None:
    for degree in MARGIN[shape]:
        points, weights = _rule(degree, shape)
        powers = [(i, d - i) for d in range(degree + 2) for i in range(d + 1)]
        off = [
            np.sum(weights * points[:, 0] ** i * points[:, 1] ** j) - monomial(shape, i, j)
            for i, j in powers
        ]
        at = np.array([i + j for i, j in powers])
        # Sums of at most 36 numbers up to 1, and of Radon's 15 digits
        assert np.abs(np.array(off)[at <= degree]).max() < 1e-14
        assert np.abs(np.array(off)[at > degree]).max() > 1e-5


def some(n: int, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    centre = rng.normal(size=(n, 3)) * 10 ** rng.uniform(-0.3, 1.2, (n, 1))
    a, b, normal = np.moveaxis(random_rotation(np.arange(n), 3), 2, 0)
    return centre, a, b, normal, rng.random(n) < 0.5, rng.uniform(0, 2, (n, 3))


def near_and_far(
    found: np.ndarray, near: np.ndarray, exact: np.ndarray, light: np.ndarray, area: np.ndarray
) -> None:
    """Compare sums (p, K, 3) with exact coefficients (p, n, K) of those that are not near.

    area : (p, n) of each over the square of its distance.
    """
    assert 0.02 < near.mean() < 0.8
    far = ~near
    expected = np.einsum("pn,pnk,nc->pkc", far, exact, light)
    allowed = PRECISION * np.einsum("pn,pn,nc->pc", far, area, light)
    off = np.abs(found - expected)
    assert np.all(off.max(axis=1) < allowed)
    # It is another sum than the exact one
    assert off.max() > 1e-6 * allowed.max()


@pytest.mark.parametrize("l_max", [2, 4, 8])
def test_discs(l_max: int, rng: np.random.Generator) -> None:
    centre, _, _, normal, both, light = some(300, rng)
    radius = rng.uniform(0.02, 0.8, 300)
    patches = disc_patches(centre, normal, radius, both)
    place = POINTS[:, None], centre, normal, radius, [1.0], l_max
    exact = project_disc(*place, two_sided=both)[..., 0]
    square = np.sum((centre - POINTS[:, None]) ** 2, axis=-1)
    found, near = total(POINTS, patches, light, l_max, PRECISION)
    near_and_far(found, near, exact, light, np.pi * radius**2 / square)


@pytest.mark.parametrize("corners", [3, 4, 5])
@pytest.mark.parametrize("l_max", [2, 4, 8])
def test_polygons(l_max: int, corners: int, rng: np.random.Generator) -> None:
    n = 300
    centre, a, b, _, both, light = some(n, rng)
    wide, high = rng.uniform(0.02, 0.8, (2, n, 1, 1))
    turn = 2 * np.pi * np.arange(corners) / corners
    shape = np.cos(turn)[:, None] * a[:, None] * wide + np.sin(turn)[:, None] * b[:, None] * high
    outline = centre[:, None] + shape
    assert is_parallelogram(outline).all() if corners == 4 else True
    patches = polygon_patches(outline, both)
    assert patches.pieces == {3: 1, 4: 1, 5: 3}[corners]
    exact = project_polygon(POINTS[:, None], outline, [1.0], l_max, two_sided=both)[..., 0]
    area = np.linalg.norm(patches.area, axis=1)
    square = np.sum((patches.middle - POINTS[:, None]) ** 2, axis=-1)
    share = (area / square).reshape(len(POINTS), n, -1).sum(axis=2)
    found, near = total(POINTS, patches, light, l_max, PRECISION)
    near_and_far(found, near, exact, light, share)


@pytest.mark.parametrize("shape", MARGIN)
@pytest.mark.parametrize("l_max", [2, 4, 8, 10])
def test_every_light_within_reach_is_as_precise_as_asked(
    shape: str, l_max: int, rng: np.random.Generator
) -> None:
    """Each rule by itself at the ends of its reach, where its error is the largest."""
    n = 60
    for degree in MARGIN[shape]:
        ratio = 0.999 * reach(l_max, degree, PRECISION, shape)
        a, b, normal = np.moveaxis(random_rotation(np.arange(n) + degree, 3), 2, 0)
        centre = np.repeat([[0.0, 0.0, 1.0]], n, axis=0)
        both = np.ones(n, bool)
        if shape == "disc":
            patches = disc_patches(centre, normal, np.full(n, ratio), both)
            place = np.zeros(3), centre, normal, ratio, [1.0], l_max
            exact = project_disc(*place, two_sided=True)[..., 0]
        else:
            k = 4 if shape == "parallelogram" else 3
            turn = 2 * np.pi * np.arange(k) / k
            ring = np.cos(turn)[:, None] * a[:, None] + np.sin(turn)[:, None] * b[:, None]
            outline = centre[:, None] + ratio * ring
            patches = polygon_patches(outline, both)
            exact = project_polygon(np.zeros(3), outline, [1.0], l_max, two_sided=True)[..., 0]
        # A light each: the identity as radiance keeps them apart
        found, near = total(np.zeros((1, 3)), patches, np.eye(n), l_max, PRECISION)
        assert not near.any()
        area = np.linalg.norm(patches.area, axis=1)
        off = np.abs(found[0].T - exact).max(axis=1) / area
        assert off.max() < PRECISION
        # Where the measured half is the limit it is more precise
        assert off.max() > 1e-2 * PRECISION or ratio > 0.49


def test_points_behind_and_in_the_plane_get_nothing() -> None:
    square = np.array([[[-0.1, -0.1, 2], [-0.1, 0.1, 2], [0.1, 0.1, 2], [0.1, -0.1, 2.0]]])
    points = np.array([[0.0, 0, 0], [0, 0, 4.0], [3.0, 0, 2], [0, 0, 2.0]])
    for both in (False, True):
        patches = polygon_patches(square, np.array([both]))
        found, near = total(points, patches, np.ones((1, 1)), 2, PRECISION)
        assert not near.any()
        lit = found[:, 0, 0] > 1e-4
        assert lit.tolist() == [True, both, False, False]
        assert np.all(found[~lit] == 0)


def test_lights_of_any_size_have_the_same_sum() -> None:
    corners = np.array([[[-0.1, -0.1, 2], [-0.1, 0.1, 2], [0.1, 0.1, 2], [0.1, -0.1, 2.0]]])
    both = np.array([False])

    def seen(scale: float) -> np.ndarray:
        patches: Patches = polygon_patches(scale * corners, both)
        return total(np.zeros((1, 3)), patches, np.ones((1, 1)), 4, PRECISION)[0]

    for scale in (1e-60, 1e60):
        np.testing.assert_allclose(seen(scale), seen(1.0), rtol=1e-5, atol=1e-8)
