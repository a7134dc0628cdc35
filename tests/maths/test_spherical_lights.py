"""Lamps to spherical harmonics against points, closed forms of irradiance and limits."""

import numpy as np
import pytest

from maths import area_lights
from maths.flat_lights import as_suns, disc_points, polygon_points
from maths.sampling import random_rotation
from maths.spherical_harmonics import evaluate
from maths.spherical_lights import (
    project_disc,
    project_environment,
    project_polygon,
    project_sphere,
    project_sun,
)
from maths.spherical_projection import clamped_cosine
from maths.transforms import latlong_direction, latlong_solid_angles

ONE = np.ones(3)
OUTLINE = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1.2, 1, 0], [0, 1.5, 0]])
CORNERS = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1.0, 0]])
POINTS = np.array([[0.3, 0.2, 1.5], [2, 1, 1.0], [0, 0, 0.6], [0, 0, 30.0], [1e4, 0, 2e5]])


def by_points(points: np.ndarray, areas: np.ndarray) -> np.ndarray:
    d, E = as_suns(POINTS, points, areas, [0, 0, 1.0], ONE)
    return np.einsum("pmk,pm->pk", evaluate(d, 8), E[..., 0])


def test_flat_lights_are_their_points() -> None:
    found = project_polygon(POINTS, OUTLINE, ONE, 8)[..., 0]
    # Points of degree 5 on 40^2 parts, .6 away: measured 1.3e-11
    np.testing.assert_allclose(found, by_points(*polygon_points(OUTLINE, 40)), rtol=0, atol=1e-10)
    found = project_disc(POINTS, [0, 0, 0], [0, 0, 1], 0.7, ONE, 8)[..., 0]
    truth = by_points(*disc_points([0, 0, 0], [0, 0, 1], 0.7, (60, 200)))
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-12)
    # Relative to a light of 1e-11 steradians: measured 1e-14
    np.testing.assert_allclose(found[-1], truth[-1], rtol=0, atol=1e-12 * np.abs(truth[-1]).max())


def test_polygons_add_up_and_shine_to_their_side() -> None:
    parts = [project_polygon(POINTS, OUTLINE[i], ONE, 6) for i in ([0, 1, 2], [0, 2, 3])]
    whole = project_polygon(POINTS, OUTLINE, ONE, 6)
    np.testing.assert_allclose(sum(parts), whole, rtol=0, atol=1e-13)
    behind = POINTS * [1, 1, -1]
    assert not project_polygon(behind, OUTLINE, ONE, 3).any()
    assert not project_disc(behind, [0, 0, 0], [0, 0, 1], 0.7, ONE, 3).any()
    assert not project_polygon([5.0, 0, 0], OUTLINE, ONE, 3, two_sided=True).any()
    both = project_polygon(behind, OUTLINE, ONE, 3, two_sided=True)
    some = project_polygon(behind, OUTLINE, ONE, 3, two_sided=[True, False] * 2 + [True])
    np.testing.assert_array_equal(some, both * [[[1]], [[0]], [[1]], [[0]], [[1]]])
    np.testing.assert_allclose(
        both, project_polygon(behind, OUTLINE[::-1], ONE, 3), rtol=0, atol=1e-13
    )


def rim(count: int, away: float) -> np.ndarray:
    """Corners on the unit circle, as dense around +x as their distance from `away` over it asks."""
    s = np.linspace(-1, 1, count, endpoint=False) * np.arcsinh(np.pi / away)
    turn = away * np.sinh(s)
    return np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)


def test_a_disc_near_its_rim_keeps_its_digits() -> None:
    for x, z in ((0.99, 1e-3), (1.001, 1e-3), (1.0, 1e-3), (0.5, 1e-6)):
        place, away = np.array([x, 0, z]), np.hypot(x - 1, z)
        found = project_disc(place, [0, 0, 0], [0, 0, 1], 1.0, ONE, 4)[..., 0]
        a, b, c = (project_polygon(place, rim(n, away), ONE, 4)[..., 0] for n in (300, 600, 1200))
        # Chords are off by even powers of their length: extrapolated twice, measured 1.1e-8
        np.testing.assert_allclose(found, (64 * c - 20 * b + a) / 45, rtol=0, atol=1e-7)


def test_a_sphere_is_all_around_from_inside_and_a_sun_from_afar() -> None:
    inside = project_sphere([0.2, 0, 0], [0, 0, 0], 1.0, ONE, 3)[:, 0]
    np.testing.assert_allclose(inside, [np.sqrt(4 * np.pi)] + [0] * 15, rtol=0, atol=1e-14)
    far = project_sphere([0, 0, 0], [3e6, 4e6, 0], 1.0, ONE, 3)
    sun = project_sun([3, 4, 0], ONE * np.pi / 25e12, 3)
    np.testing.assert_allclose(far, sun, rtol=0, atol=1e-11 * np.abs(sun).max())
    ball = project_sphere([0, 0, 0], [0, 0, 2], 1.0, ONE, 5)
    disc = project_sun([0, 0, 1], ONE * np.pi / 4, 5, angular_radius=np.pi / 6)
    np.testing.assert_allclose(ball, disc, rtol=0, atol=1e-14)


@pytest.mark.parametrize("precision", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("l_max", [2, 4, 8])
def test_few_points_are_as_precise_as_asked(
    l_max: int, precision: float, rng: np.random.Generator
) -> None:
    n = 400
    centre = rng.normal(size=(n, 3)) * 10 ** rng.uniform(-0.3, 1.2, (n, 1))
    a, b, normal = np.moveaxis(random_rotation(np.arange(n), 3), 2, 0)
    a, b = a * rng.uniform(0.02, 0.5, (n, 1)), b * rng.uniform(0.02, 0.5, (n, 1))
    square = np.sum(centre**2, axis=-1)[:, None]

    corners = centre[:, None] + np.stack([-a - b, a - b, a + b, b - a], axis=1)
    area = 4 * np.linalg.norm(np.cross(a, b), axis=-1)[:, None]
    found, truth = (
        project_polygon(np.zeros(3), corners, [1.0], l_max, precision=p)[..., 0]
        for p in (precision, 1e-16)
    )
    off = np.abs(found - truth) * square / area
    assert off.max() < precision
    # It is another sum than the exact one
    assert off.max() > 1e-3 * precision

    radius = rng.uniform(0.02, 0.5, n)
    found, truth = (
        project_disc(np.zeros(3), centre, normal, radius, [1.0], l_max, precision=p)[..., 0]
        for p in (precision, 1e-16)
    )
    off = np.abs(found - truth) * square / (np.pi * radius[:, None] ** 2)
    assert off.max() < precision
    assert off.max() > 1e-3 * precision


def test_lights_of_any_size_and_shape_keep_few_points(rng: np.random.Generator) -> None:
    tiny = project_polygon(1e-200 * POINTS, 1e-200 * CORNERS, ONE, 4, precision=1e-3)
    huge = project_polygon(1e200 * POINTS, 1e200 * CORNERS, ONE, 4, precision=1e-3)
    np.testing.assert_allclose(tiny, huge, rtol=0, atol=1e-14)
    # Turned about, a quadrangle that is no parallelogram is not taken for one
    for outline in (OUTLINE, OUTLINE[:3]):
        found = project_polygon(POINTS, outline, ONE, 4, precision=1e-6)
        truth = project_polygon(POINTS, outline, ONE, 4)
        np.testing.assert_allclose(found, truth, rtol=0, atol=1e-5)


def test_irradiance_is_that_of_the_closed_forms() -> None:
    # The light wholly above the horizon; bands over 20 hold 1e-5 to 9e-5 of it (measured)
    p, n = np.array([0.3, 0.2, 1.5]), np.array([0, 0, -1.0])
    T = clamped_cosine(n, 20)
    cases = [
        (project_polygon(p, OUTLINE, ONE, 20), area_lights.polygon_irradiance(p, n, OUTLINE, 1.0)),
        (
            project_disc(p, [0, 0, 0], [0, 0, 1], 0.7, ONE, 20),
            area_lights.disc_irradiance(p, n, [0, 0, 0], [0, 0, 1], 0.7, 1.0),
        ),
        (
            project_sphere(p, [0, 0, 0], 0.7, ONE, 20),
            area_lights.sphere_irradiance(p, n, [0, 0, 0], 0.7, 1.0),
        ),
    ]
    for L, expected in cases:
        assert T @ L[:, 0] == pytest.approx(float(expected), rel=2e-4)


def test_maps_are_exact_for_even_texels(rng: np.random.Generator) -> None:
    image = rng.normal(size=(6, 12, 3))
    uv = np.stack(np.meshgrid((np.arange(600) + 0.5) / 600, (np.arange(300) + 0.5) / 300), -1)
    fine = image.repeat(50, 0).repeat(50, 1)
    solid = latlong_solid_angles(300, 600)
    truth = np.einsum("hwk,hwc,h->kc", evaluate(latlong_direction(uv), 4), fine, solid)
    # Texels of pi / 300 at their middles: l (l + 1) (pi / 300)^2 / 24 = 9e-5 of the values
    np.testing.assert_allclose(project_environment(image, 4), truth, rtol=0, atol=2e-4)
    quarter = project_environment(image, 4, yaw=[0, np.pi / 2])
    rolled = project_environment(np.roll(image, 3, axis=1), 4)
    np.testing.assert_allclose(quarter[1], rolled, rtol=0, atol=1e-12)


def test_what_is_no_light_is_refused() -> None:
    with pytest.raises(ValueError, match="radius"):
        project_sphere([0, 0, 0], [0, 0, 1], -1.0, ONE, 2)
    with pytest.raises(ValueError, match="radius"):
        project_disc([0, 0, 0], [0, 0, 1], [0, 0, 1], 0.0, ONE, 2)
    with pytest.raises(ValueError, match="corners"):
        project_polygon([0, 0, 0], OUTLINE[:2], ONE, 2)
    with pytest.raises(ValueError, match="angular"):
        project_sun([0, 0, 1], ONE, 2, angular_radius=3.0)


def test_a_ball_of_radius_0_gives_nothing_at_its_own_place_too() -> None:
    for place in (np.zeros(3), np.array([0.0, 2, 0])):
        assert not project_sphere(np.zeros(3), place, 0.0, [1.0, 1, 1], 3).any()
