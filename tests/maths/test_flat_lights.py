"""Quadrature points of flat lights against closed forms of irradiance and moments."""

import numpy as np
import pytest

from maths import flat_lights

SQUARE = np.array([[-1.0, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]])  # faces +y
UP = np.array([0.0, 1.0, 0.0])


def irradiance(places, points, areas, axis, normal, **kind):
    """Sum of small suns on a surface of unit normal, radiance 1."""
    towards, light = flat_lights.as_suns(places, points, areas, axis, np.ones(3), **kind)
    return (light[..., 0] * np.maximum(towards @ normal, 0)).sum(axis=-1)


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_polygon_areas_and_fifth_moments_are_exact(parts):
    points, areas = flat_lights.polygon_points(SQUARE, parts)
    assert areas.sum() == pytest.approx(4, rel=1e-14)
    # The integral of x^4 over [-1, 1]^2 is 4/5, of x^4 z zero, of x^2 z^2 4/9: degree 5 is exact
    x, _, z = points.T
    assert areas @ x**4 == pytest.approx(4 / 5, rel=1e-13)
    assert areas @ (x**4 * z) == pytest.approx(0, abs=1e-14)
    assert areas @ (x**2 * z**2) == pytest.approx(4 / 9, rel=1e-13)


def test_disc_areas_and_moments_are_exact():
    points, areas = flat_lights.disc_points([1.0, 2.0, 3.0], [0.0, 0.0, 1.0], 2.0)
    assert areas.sum() == pytest.approx(4 * np.pi, rel=1e-14)
    x, y, z = (points - [1.0, 2.0, 3.0]).T
    assert np.abs(z).max() == 0
    # The integral of x^2 over a disc is pi R^4 / 4, of x^4 pi R^6 / 8
    assert areas @ x**2 == pytest.approx(np.pi * 16 / 4, rel=1e-13)
    assert areas @ y**4 == pytest.approx(np.pi * 64 / 8, rel=1e-13)


@pytest.mark.parametrize("height", [1.0, 2.0, 5.0])
def test_coaxial_disc_meets_its_closed_form(height):
    points, areas = flat_lights.disc_points([0.0, height, 0.0], -UP, 1.0)
    found = irradiance(np.zeros(3), points, areas, -UP, UP)
    # pi R^2 / (R^2 + h^2); four Gauss nodes in r^2: the integrand 1 / (r^2 + h^2)^2 is analytic up
    # to r^2 = -h^2, so the error falls as rho^-8, rho = 5.8 at h = R, times 2n + 1 = 9 for a double
    # pole, and 2 pi for what the bound's constant hides (measured: 1e-5)
    assert found == pytest.approx(np.pi / (1 + height**2), rel=5.8**-8 * 9 * 2 * np.pi)


def test_square_over_a_floor_meets_its_closed_form():
    points, areas = flat_lights.polygon_points(SQUARE + 2 * UP, 2)
    found = irradiance(np.zeros(3), points, areas, -UP, UP)
    # Four times the corner formula, X = Y = 1/2
    X = 0.5
    corner = X / np.sqrt(1 + X * X) * np.arctan(X / np.sqrt(1 + X * X))
    # Degree 5 on triangles of half the side: measured 1.1e-6
    assert found == pytest.approx(4 * corner, rel=5e-6)


def test_a_one_sided_light_is_dark_from_behind():
    points, areas = flat_lights.polygon_points(SQUARE)
    behind = np.array([0.0, -1.0, 0.0])
    _, light = flat_lights.as_suns(behind, points, areas, UP, np.ones(3))
    assert light.max() == 0
    _, light = flat_lights.as_suns(behind, points, areas, UP, np.ones(3), two_sided=True)
    assert light.min() > 0


def test_no_place_gets_more_than_a_half_space():
    points, areas = flat_lights.polygon_points(SQUARE, 2)
    places = np.concatenate([points, points + 1e-9, np.zeros((1, 3))])
    towards, light = flat_lights.as_suns(places, points, areas, UP, np.ones(3))
    assert np.isfinite(towards).all()
    assert np.isfinite(light).all()
    assert light.max() <= 2 * np.pi


def test_other_shapes_are_refused():
    with pytest.raises(ValueError, match="three or more"):
        flat_lights.polygon_points([[0.0, 0, 0], [1, 0, 0]])
    with pytest.raises(ValueError, match="radius"):
        flat_lights.disc_points([0.0, 0, 0], UP, 0.0)
