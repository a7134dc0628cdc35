"""Samplers of lights: even over the solid angle, and unbiased beside the closed forms."""

import numpy as np
import pytest

from maths import area_lights as lights
from maths.light_sampling import sample_disc, sample_rectangle, sample_sphere

COUNT = 20_000
ORIGIN = np.zeros(3)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def z_score(samples: np.ndarray, truth: float) -> float:
    """Distance of a mean from the truth, in its standard deviations."""
    return float((samples.mean() - truth) / (samples.std(ddof=1) / np.sqrt(len(samples))))


def estimates(d, density, n):
    return np.maximum(0, d @ n) / density


@pytest.mark.parametrize("case", range(6))
def test_irradiance_of_every_light(case: int, rng: np.random.Generator) -> None:
    u = rng.uniform(size=(COUNT, 2))
    n, c = unit(rng.normal(size=(2, 3)))
    n = unit(n + 0.8 * c)
    c = c * rng.uniform(0.4, 2)
    axis = unit(rng.normal(size=3))
    half_u, half_v = axis * 0.7, unit(np.cross(axis, rng.normal(size=3))) * 1.1
    ball = sample_sphere(ORIGIN, c, 0.6, u)
    disc = sample_disc(ORIGIN, c, axis, 0.6, u)
    flat = sample_rectangle(ORIGIN, c, half_u, half_v, u)
    truths = [
        lights.sphere_irradiance(ORIGIN, n, c, 0.6, 1.0),
        lights.disc_irradiance(ORIGIN, n, c, axis, 0.6, 1.0, two_sided=True),
        lights.rectangle_irradiance(ORIGIN, n, c, half_u, half_v, 1.0, two_sided=True),
    ]
    for (d, density), truth in zip((ball, disc, flat), truths, strict=True):
        np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1, rtol=0, atol=1e-14)
        # 18 tests of a fixed seed: 4.5 sigma is 1e-4 in all
        assert abs(z_score(estimates(d, density, n), float(truth))) < 4.5


@pytest.mark.parametrize("case", range(4))
def test_densities_are_one_over_the_solid_angle(case: int, rng: np.random.Generator) -> None:
    u = rng.uniform(size=(COUNT, 2))
    c, axis = unit(rng.normal(size=(2, 3)))
    u_axis, v_axis = axis * 0.5, unit(np.cross(axis, c)) * 0.3
    _, density = sample_sphere(ORIGIN, c, 0.3, u)
    solid = lights.sphere_solid_angle(ORIGIN, c, 0.3)
    np.testing.assert_allclose(density * solid, 1, rtol=1e-12)
    _, density = sample_rectangle(ORIGIN, c, u_axis, v_axis, u)
    solid = lights.polygon_solid_angle(ORIGIN, lights.rectangle_corners(c, u_axis, v_axis))
    # Sums of four angles of arccos: 1e-16 / sin of the angle, over the solid angle
    np.testing.assert_allclose(density * solid, 1, rtol=1e-11)
    # Even over the area: the mean of 1 / density is the solid angle
    _, density = sample_disc(ORIGIN, c, axis, 0.7, u)
    assert abs(z_score(1 / density, float(lights.disc_solid_angle(ORIGIN, c, axis, 0.7)))) < 4.5


def test_directions_hit_their_rectangle_evenly(rng: np.random.Generator) -> None:
    """Halves of a rectangle get their shares of its solid angle."""
    c, half_u, half_v = np.array([0.5, 0.2, 0.4]), np.array([1.0, 0, 0]), np.array([0, 0.8, 0])
    d, _ = sample_rectangle(ORIGIN, c, half_u, half_v, rng.uniform(size=(COUNT, 2)))
    hit = d * (c[2] / d[:, 2])[:, None]
    assert np.all(np.abs(hit - c) <= [1 + 1e-9, 0.8 + 1e-9, 1e-12])
    whole = lights.polygon_solid_angle(ORIGIN, lights.rectangle_corners(c, half_u, half_v))
    for half in (half_u, half_v):
        other = half_u + half_v - half
        part = lights.rectangle_corners(c + half / 2, half / 2, other)
        share = lights.polygon_solid_angle(ORIGIN, part) / whole
        inside = ((hit - c) @ half > 0).astype(float)
        assert abs(z_score(inside, float(share))) < 4.5


def test_far_rectangles_and_hard_places(rng: np.random.Generator) -> None:
    u = rng.uniform(size=(COUNT, 2))
    a, b = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    for scale in (1e-6, 1e-2):
        d, density = sample_rectangle(ORIGIN, [0.3, 0.2, 0.9], scale * a, scale * b, u)
        truth = lights.rectangle_irradiance(
            ORIGIN, [0, 0, 1.0], [0.3, 0.2, 0.9], scale * a, scale * b, 1.0, two_sided=True
        )
        # All estimates are nearly the same: the mean itself is good to the light's size
        assert abs(estimates(d, density, np.array([0, 0, 1.0])).mean() / truth - 1) < 3 * scale
    # On, in and in the plane of lights, and lights without a size: finite
    for centre in ([0.0, 0, 0], [0.0, 0, 1e-9], [1.0, 0, 0], [3.0, 0, 0]):
        for d, density in (
            sample_sphere(ORIGIN, centre, 1.0, u[:99]),
            sample_sphere(ORIGIN, centre, 0.0, u[:99]),
            sample_disc(ORIGIN, centre, [0, 0, 1.0], 1.0, u[:99]),
            sample_disc(ORIGIN, centre, [0, 0, 1.0], 0.0, u[:99]),
            sample_rectangle(ORIGIN, centre, a, b, u[:99]),
            sample_rectangle(ORIGIN, centre, 0 * a, b, u[:99]),
        ):
            assert np.all(np.isfinite(d))
            assert np.all(density >= 0)
    inside, density = sample_sphere([0.2, 0, 0], [0.0, 0, 0], 1.0, u)
    assert np.allclose(density, 1 / (4 * np.pi), rtol=1e-14)
    assert np.abs(inside.mean(axis=0)).max() < 4.5 * np.sqrt(1 / 3 / COUNT)
