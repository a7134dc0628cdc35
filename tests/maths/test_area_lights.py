"""Suns and spheres: Snyder's formula, brute force across the horizon, limits."""

import numpy as np
import pytest

from maths import area_lights as lights
from maths.sampling import orthonormal_basis

UP = np.array([0.0, 1.0, 0.0])
NODES, WEIGHTS = np.polynomial.legendre.leggauss(100)


def snyder(s: float, omega: float) -> float:
    """Irradiance of a ball of radiance 1, as printed; s = R / D, omega from the normal."""
    if omega <= np.pi / 2 - np.arcsin(s):
        return float(np.pi * s * s * np.cos(omega))
    if omega >= np.pi / 2 + np.arcsin(s):
        return 0.0
    x = np.sqrt(1 / s**2 - 1)
    y = -x / np.tan(omega)
    q = np.sin(omega) * np.sqrt(1 - y * y)
    return float((np.cos(omega) * np.arccos(y) - x * q) * s * s + np.arctan(q / x))


def slow_cap(s: float, omega: float) -> float:
    """Integral of the clamped cosine over a cap, strip by strip about its axis."""
    sigma = np.arcsin(s)
    # Strips where the horizon starts and stops cutting end the panels
    start = float(np.clip(abs(np.pi / 2 - omega), 0, sigma))
    total = 0.0
    for low, high in ((0.0, start), (start, sigma)):
        # Squares like a square root at either end are undone by a cosine
        t = low + (high - low) * 0.5 * (1 - np.cos(np.pi / 2 * (NODES + 1)))
        dt = (high - low) * 0.5 * np.sin(np.pi / 2 * (NODES + 1)) * np.pi / 2 * WEIGHTS
        A, B = np.cos(t) * np.cos(omega), np.sin(t) * np.sin(omega)
        half = np.arccos(np.clip(-A / np.maximum(B, 1e-300), -1, 1))
        total += np.sum(dt * np.sin(t) * 2 * (A * half + B * np.sin(half)))
    return float(total)


def placed(s, omega):
    """Point, normal, centre and radius of a ball seen at omega with sine s."""
    centre = np.array([np.sin(omega), np.cos(omega), 0.0])
    return np.zeros(3), UP, centre, s


@pytest.mark.parametrize("s", [0.1, 0.5, 0.95, 1 / 1.05])
def test_a_sphere_above_across_and_below_the_horizon(s: float) -> None:
    for omega in np.linspace(0.01, np.pi - 0.01, 41):
        found = lights.sphere_irradiance(*placed(s, omega), 1.0)
        # The two agree to rounding of terms of size 1
        assert abs(found - snyder(s, omega)) < 1e-14 / s
        assert abs(found - slow_cap(s, omega)) < 1e-12


@pytest.mark.parametrize("s", [1e-6, 1e-3, 0.05, 0.3, 0.287])
def test_a_small_sphere_keeps_its_digits_across_the_horizon(s: float) -> None:
    k = np.linspace(-0.999, 0.999, 101)
    found = lights.cap_cosine(s * k, s, np.sqrt(1 - s * s))
    if s <= 1e-3:
        # A small disc of normals: integral of (k + x)+ over the unit disc, relative error s^2
        q = np.sqrt(1 - k * k)
        flat = s * (k * np.arccos(-k) + k * k * q + 2 / 3 * q**3)
        np.testing.assert_allclose(found, flat / np.pi, rtol=0, atol=2 * s * s * s + 1e-16)
    slow = [slow_cap(s, np.arccos(s * x)) / (np.pi * s * s) for x in k]
    # arccos near pi / 2 is good to 1e-16, of s
    np.testing.assert_allclose(found, slow, rtol=0, atol=1e-13 + 1e-16 / s * s)


def test_inside_on_and_without_a_sphere() -> None:
    n = np.stack([UP, -UP, [1.0, 0, 0]])
    assert np.all(lights.sphere_irradiance([0.2, 0, 0], n, [0.0, 0, 0], 1.0, 2.0) == 2 * np.pi)
    assert np.all(lights.sphere_irradiance([0.0, 0, 0], n, [0.0, 0, 0], 1.0, 2.0) == 2 * np.pi)
    # On it, half of all directions: (1 + cos) pi / 2
    on = lights.sphere_irradiance([0.0, 0, 0], n, [0.0, 1.0, 0], 1.0, 1.0)
    np.testing.assert_allclose(on, [np.pi, 0, np.pi / 2], rtol=0, atol=1e-15)
    assert np.all(lights.sphere_irradiance([0.0, 0, 0], n, [0.0, 0, 0], 0.0, 1.0) == 0)
    assert np.all(lights.sphere_irradiance([0.0, 0, 0], n, [0.0, 1, 0], 0.0, 1.0) == 0)


def test_scale_and_colour() -> None:
    for scale in (1e-6, 1.0, 1e6):
        E = lights.sphere_irradiance(
            np.full((4, 3), 5 * scale),
            UP,
            [5 * scale, 6.3 * scale, 5 * scale],
            0.3 * scale,
            [1.0, 2],
        )
        assert E.shape == (4, 2)
        np.testing.assert_allclose(
            E, [[np.pi * (0.3 / 1.3) ** 2 * c for c in (1, 2)]] * 4, rtol=1e-13
        )


def test_a_sun_is_a_sphere_by_angle(rng: np.random.Generator) -> None:
    to = rng.normal(size=(500, 3))
    to /= np.linalg.norm(to, axis=-1, keepdims=True)
    n = np.array([0.6, 0.0, 0.8])
    point = lights.sun_irradiance(n, to, 3.0)
    np.testing.assert_allclose(point, 3 * np.maximum(0, to @ n), rtol=0, atol=2e-15)
    for radius in (0.0046, 0.3, 1.2):
        ball = lights.sphere_irradiance([0.0, 0, 0], n, to, np.sin(radius), 1.0)
        found = lights.sun_irradiance(n, to, np.pi * np.sin(radius) ** 2, radius)
        np.testing.assert_allclose(found, ball, rtol=0, atol=5e-15)
    # A whole half of the sky, turned away: what is left is a wedge of (1 + cos) / 2
    half = lights.sun_irradiance(n, to, 1.0, np.pi / 2)
    np.testing.assert_allclose(half, 0.5 * (1 + to @ n), rtol=0, atol=1e-15)


def test_solid_angles_of_spheres() -> None:
    assert lights.sphere_solid_angle([0.0, 0, 0], [0.0, 0, 0.5], 1.0) == 4 * np.pi
    far = lights.sphere_solid_angle([0.0, 0, 0], [0.0, 0, 1e6], 1.0)
    np.testing.assert_allclose(far, np.pi * 1e-12, rtol=1e-12)
    half = lights.sphere_solid_angle([0.0, 0, 0], [0.0, 0, 1], 0.6)
    np.testing.assert_allclose(half, 2 * np.pi * 0.2, rtol=1e-15)


def test_no_input_gives_a_number_that_is_none(rng: np.random.Generator) -> None:
    """Grazing, touching, tiny and huge: finite, between 0 and pi; numpy raises on accidents."""
    n = rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    size = 10.0 ** rng.uniform(-6, 6, (2, 4000))
    a, b = orthonormal_basis(n)
    at = (a + b * rng.choice([0, 1e-16, 1e-8, 1], (4000, 1))) * size[0][:, None]
    at[::7] = n[::7] * size[1, ::7, None]
    at[::11] = -n[::11] * size[1, ::11, None]
    at[::13] = 0
    E = lights.sphere_irradiance(np.zeros(3), n, at, size[1], 1.0)
    E = np.stack([E, *flat_lights(n, at, a, size[1])])
    assert np.all((E >= 0) & (np.pi * (1 + 1e-14) >= E))


def flat_lights(n, at, a, size):
    for axis in (n, -n, a):
        yield lights.disc_irradiance(np.zeros(3), n, at, axis, size, 1.0, two_sided=True)
        yield lights.disc_solid_angle(np.zeros(3), at, axis, size) / 2
    edge = np.cross(n, a)
    for u, v in ((a, edge), (n, edge), (a, a), (0 * a, edge)):
        yield lights.rectangle_irradiance(
            np.zeros(3), n, at, u * size[:, None], v * size[:, None], 1.0, two_sided=True
        )


def test_a_ball_of_radius_0_gives_nothing_at_its_own_place_too() -> None:
    for place in ([0.0, 0, 0], [0.0, 2, 0]):
        assert lights.sphere_irradiance([0.0, 0, 0], [0, 1.0, 0], place, 0.0, 1.0) == 0


def test_what_is_not_finite_is_refused() -> None:
    here, up = [0.0, 0, 0], [0.0, 1, 0]
    for x in (np.nan, np.inf):
        with pytest.raises(ValueError, match="finite place"):
            lights.sphere_irradiance(here, up, [0.0, x, 0], 1.0, 1.0)
        with pytest.raises(ValueError, match="finite radius"):
            lights.sphere_irradiance(here, up, up, x, 1.0)
        with pytest.raises(ValueError, match="finite direction"):
            lights.sun_irradiance(up, [x, 0.0, 0.0], 1.0)
        with pytest.raises(ValueError, match="angular radius"):
            lights.sun_irradiance(up, up, 1.0, x)
        with pytest.raises(ValueError, match="disc light"):
            lights.disc_irradiance(here, up, [0.0, x, 0], up, 1.0, 1.0)
        with pytest.raises(ValueError, match="finite corners"):
            lights.polygon_irradiance(here, up, [[0.0, 1, 0], [1, x, 0], [0, 1, 1]], 1.0)
