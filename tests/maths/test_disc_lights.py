"""Discs: tables of configuration factors, contour by brute force, limits and symmetries."""

import numpy as np
import pytest

from maths.disc_lights import disc_irradiance, disc_solid_angle
from maths.polygon_lights import polygon_solid_angle
from maths.sampling import orthonormal_basis, random_rotation

ORIGIN = np.zeros(3)
UP = np.array([0.0, 0.0, 1.0])
GAUSS = np.polynomial.legendre.leggauss(20)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def contour(c, n, axis, R, panels=200):
    """Half the contour integral of n . r x dr / r^2, by composite Gauss along the arc."""
    w = -axis if -c @ axis > 0 else axis
    along = n - (n @ w) * w
    s = np.linalg.norm(along)
    u = along / s
    v = np.cross(w, u)
    reach = np.clip(n @ c / (R * s), -1, 1)
    t1 = np.arccos(-reach)
    x, g = GAUSS
    ends = np.linspace(-t1, t1, panels + 1)
    t = 0.5 * (ends[:-1, None] + ends[1:, None]) + 0.5 * np.diff(ends)[:, None] * x
    dt = 0.5 * np.diff(ends)[:, None] * g
    r = c + R * (np.cos(t)[..., None] * u + np.sin(t)[..., None] * v)
    d = R * (np.cos(t)[..., None] * v - np.sin(t)[..., None] * u)
    total = 0.5 * np.sum(dt * (np.cross(r, d) @ n) / np.sum(r * r, axis=-1))
    a, b = (c + R * (np.cos(t1) * u + e * np.sin(t1) * v) for e in (1, -1))
    return total + 0.5 * np.arctan2(np.cross(a, b) @ n, a @ b)


def slow_area(c, n, axis, R, cells=1000):
    """Integral of clamped cosines over the disc on rings and sectors; good to about cells^-1.5."""
    a, b = orthonormal_basis(axis)
    radius = R * np.sqrt((np.arange(cells) + 0.5) / cells)[:, None]
    t = 2 * np.pi * (np.arange(cells) + 0.5) / cells
    r = c + radius[..., None] * (np.cos(t)[:, None] * a + np.sin(t)[:, None] * b)
    squared = np.sum(r * r, axis=-1)
    product = np.maximum(0, r @ n) * np.maximum(0, -(r @ axis)) / squared**2
    return np.pi * R * R * product.mean()


def test_above_a_parallel_plane_on_and_off_the_axis() -> None:
    for R in (0.1, 1.0, 7.0):
        for h in (0.01, 0.5, 3.0):
            on = disc_irradiance(ORIGIN, UP, [0, 0, h], -UP, R, 1.0)
            assert abs(on - np.pi * R**2 / (R**2 + h**2)) < 1e-14
            for a in (0.3, 1.0, 20.0):
                H, rho = h / a, R / a
                Z = 1 + H * H + rho * rho
                expected = np.pi / 2 * (1 - (1 + H * H - rho**2) / np.sqrt(Z * Z - 4 * rho**2))
                found = disc_irradiance(ORIGIN, UP, [a, 0, h], -UP, R, 1.0)
                # The table's form cancels by 1e-16
                assert abs(found - expected) < 1e-14


def test_a_wall_that_faces_the_disc_from_beyond_its_rim() -> None:
    """Receiver at right angles, all in sight: H / 2 (Z / sqrt(Z^2 - 4 R^2) - 1) pi."""
    for a, h, R in ((2.0, 1.0, 0.5), (1.0, 3.0, 0.99), (5.0, 0.1, 4.0)):
        H, rho = h / a, R / a
        Z = 1 + H * H + rho * rho
        expected = np.pi * H / 2 * (Z / np.sqrt(Z * Z - 4 * rho**2) - 1)
        found = disc_irradiance(ORIGIN, [1.0, 0, 0], [a, 0, h], -UP, R, 1.0)
        assert abs(found - expected) < 1e-14


def test_a_wall_that_cuts_a_disc_on_its_axis() -> None:
    """Half the disc, from the foot of a wall: atan(R / h) - R h / (R^2 + h^2)."""
    for R, h in ((1.0, 0.1), (1.0, 3.0), (0.02, 1.0), (1e-6, 1.0)):
        found = disc_irradiance(ORIGIN, [1.0, 0, 0], [0, 0, h], -UP, R, 1.0)
        x = R / h
        expected = (
            np.arctan(x) - x / (1 + x * x)
            if x > 0.1
            else 2 / 3 * x**3 - 4 / 5 * x**5 + 6 / 7 * x**7
        )
        # The next term is 8 x^9 / 9
        assert abs(found - expected) < 1e-10 * np.pi * min(1.0, x * x)


def test_any_place_and_orientation(rng: np.random.Generator) -> None:
    count = 400
    c, n, axis = rng.normal(size=(count, 3)), *unit(rng.normal(size=(2, count, 3)))
    R = 10 ** rng.uniform(-0.7, 1, count)
    found = disc_irradiance(ORIGIN, n, c, axis, R, 1.0, two_sided=True)
    slow = np.array([contour(*x) for x in zip(c, n, axis, R, strict=True)])
    rise = np.sum(n * c, -1) / (R * np.sqrt(1 - np.sum(n * axis, -1) ** 2))
    # Above, across and below the horizon are all there
    assert np.all(np.histogram(rise, [-np.inf, -1, 1, np.inf])[0] > 20)
    slow[rise < -1] = 0
    assert np.abs(found - slow).max() < 1e-12


def test_brute_force_over_the_area(rng: np.random.Generator) -> None:
    for _ in range(8):
        c, n, axis = rng.normal(size=3) * 1.5, *unit(rng.normal(size=(2, 3)))
        axis = -np.sign(c @ axis) * axis
        if abs(c @ axis) < 0.3:
            continue
        R = rng.uniform(0.2, 2)
        # Measured 3e-6 for 1000^2 cells
        assert abs(disc_irradiance(ORIGIN, n, c, axis, R, 1.0) - slow_area(c, n, axis, R)) < 3e-5


@pytest.mark.parametrize("R", [0.0099, 0.0101, 1e-3, 1e-6])
def test_a_far_disc_across_the_horizon_keeps_its_digits(R: float, rng: np.random.Generator) -> None:
    """Where two forms meet, and beyond: beside the contour, or the limit of a small disc."""
    count = 200
    c, axis = unit(rng.normal(size=(2, count, 3)))
    n = unit(np.cross(c, rng.normal(size=(count, 3))))
    n = unit(n + c * R * rng.uniform(-1, 1, (count, 1)))
    found = disc_irradiance(ORIGIN, n, c, axis, R, 1.0, two_sided=True)
    m, rise, h = np.sum(n * axis, -1), np.sum(n * c, -1), np.abs(np.sum(c * axis, -1))
    s = np.sqrt(1 - m * m)
    if R > 5e-3:
        slow = [contour(*x, R) for x in zip(c, n, axis, strict=True)]
        tolerance = 1e-12
    else:
        # R^3 s h times the integral of (x - k)+ over the unit disc; r^-4 varies by 4 R
        k = np.clip(-rise / (R * s), -1, 1)
        q = np.sqrt(1 - k * k)
        slow = R**3 * s * h * (2 / 3 * q**3 - k * np.arccos(k) + k * k * q)
        slow = np.where(rise > R * s, np.pi * R * R * h * rise, slow)
        tolerance = 8 * R * R
    assert np.abs(found - slow).max() / (np.pi * R * R) < tolerance


def test_limits_symmetry_and_sides(rng: np.random.Generator) -> None:
    n = unit(rng.normal(size=(100, 3)))
    # A huge disc near by is half of all directions
    wide = disc_irradiance(ORIGIN, n, [0, 0, 1.0], -UP, 1e9, 1.0)
    np.testing.assert_allclose(wide, np.pi / 2 * (1 + n[:, 2]), rtol=0, atol=1e-8)
    # A tiny one is a point
    tiny = disc_irradiance(ORIGIN, n, [0, 0.6, 0.8], -UP, 1e-7, 1.0)
    point = np.pi * 1e-14 * 0.8 * np.maximum(0, n @ [0, 0.6, 0.8])
    np.testing.assert_allclose(tiny, point, rtol=0, atol=1e-21)
    # It shines one way, or two
    assert np.all(disc_irradiance(ORIGIN, n, [0, 0, 1.0], UP, 1.0, 1.0) == 0)
    front = disc_irradiance(ORIGIN, n, [0.2, 0, 1.0], -UP, 1.0, [1.0, 2])
    both = disc_irradiance(ORIGIN, n, [0.2, 0, 1.0], UP, 1.0, [1.0, 2], two_sided=True)
    np.testing.assert_allclose(front, both, rtol=0, atol=1e-15)
    # Turned and scaled as a whole
    turn = random_rotation(3)
    moved = disc_irradiance(
        [5.0, 6, 7], n @ turn.T, turn @ [2e5, 0, 1e6] + [5, 6, 7], turn @ -UP, 1e6, 1.0
    )
    # The centre's coordinates round by 1e-16 of 1e6
    np.testing.assert_allclose(moved, front[:, 0], rtol=0, atol=1e-13)


def test_reciprocity(rng: np.random.Generator) -> None:
    """A disc upon a parallel disc: mean factors times areas are the same both ways."""
    x, g = np.polynomial.legendre.leggauss(60)

    def flux(R, receiver, h):
        r = 0.5 * receiver * (x + 1)
        E = disc_irradiance(np.stack([r, 0 * r, 0 * r], -1), UP, [0, 0, h], -UP, R, 1.0)
        return np.sum(0.5 * receiver * g * 2 * np.pi * r * E)

    for a, b, h in ((1.0, 0.3, 0.7), (2.0, 1.0, 0.5)):
        # Smooth profiles: Gauss is good to 1e-12
        assert abs(flux(a, b, h) - flux(b, a, h)) < 1e-11


def test_in_its_plane_at_the_rim_and_without_a_radius() -> None:
    n = unit(np.array([[0.0, 0, 1], [1, 0, 0], [1, 2, 3]]))
    for centre in ([0.0, 0, 0], [1.0, 0, 0], [5.0, 0, 0]):
        assert np.all(disc_irradiance(ORIGIN, n, centre, UP, 1.0, 1.0, two_sided=True) == 0)
        assert disc_solid_angle(ORIGIN, centre, UP, 1.0) == 0
    assert np.all(disc_irradiance(ORIGIN, n, [0, 0, 1.0], -UP, [0.0, -1, 0], 1.0) == 0)
    rim = disc_irradiance(ORIGIN, n, [1.0, 0, 1e-14], -UP, 1.0, 1.0)
    assert np.all((rim >= 0) & (rim <= np.pi))
    # Just above its middle: all directions of a half
    close = disc_irradiance(ORIGIN, n, [0.3, 0, 1e-12], -UP, 1.0, 1.0)
    np.testing.assert_allclose(close, np.pi / 2 * (1 + n[:, 2]), rtol=0, atol=1e-11)


def test_solid_angle() -> None:
    for R, h in ((1e-6, 1.0), (0.3, 1.0), (4.0, 3.0), (1e6, 1.0)):
        expected = 2 * np.pi * (R * R / (np.hypot(R, h) * (np.hypot(R, h) + h)))
        np.testing.assert_allclose(disc_solid_angle(ORIGIN, [0, 0, h], UP, R), expected, rtol=1e-12)
    # Off axis, beside a polygon of 2,000 corners: its area is less by 1.6e-6
    t = 2 * np.pi * np.arange(2000) / 2000
    for a, h, R in ((0.5, 1, 1), (2, 1, 1), (0.9, 0.1, 1), (3, 3, 1), (1000, 1, 1), (10, 0.01, 1)):
        rim = np.stack([a + R * np.cos(t), R * np.sin(t), np.full_like(t, h)], -1)
        found = disc_solid_angle(ORIGIN, [a, 0.0, h], UP, R)
        np.testing.assert_allclose(polygon_solid_angle(ORIGIN, rim) / found, 1, rtol=0, atol=2e-5)
    # Where the two forms of the integral meet, B = 1/2
    h = np.sqrt(3.75) * np.array([1 - 1e-9, 1 + 1e-9])
    two = disc_solid_angle(ORIGIN, np.stack([0.5 + 0 * h, 0 * h, h], -1), UP, 1.0)
    assert abs(two[0] - two[1]) < 1e-8
