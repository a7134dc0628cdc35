"""Irradiance of maps: even skies, single suns, and the bound of nine harmonics."""

import numpy as np

from maths import environment_irradiance as env
from maths.spherical_rotation import rotate
from maths.transforms import latlong_direction, latlong_solid_angles, rotation


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def test_an_even_sky_and_an_even_half_of_it(rng: np.random.Generator) -> None:
    n = unit(rng.normal(size=(50, 3)))
    sky = np.ones((32, 64, 2)) * [1, 3]
    E = env.environment_irradiance(sky, n)
    assert E.shape == (50, 2)
    # Texels that the horizon crosses: measured 3.3e-3, four times less when cut in two
    assert np.abs(E[:, 0] - np.pi).max() < 5e-3
    fine = env.environment_irradiance(sky, n, cuts=2)
    assert np.abs(fine[:, 0] - np.pi).max() < 1.3e-3
    sky[16:] = 0
    top = env.environment_irradiance(sky, n, cuts=4)[:, 0]
    # A half above: (1 + n . up) pi / 2
    assert np.abs(top - np.pi / 2 * (1 + n[:, 1])).max() < 3e-4
    # Level, nothing is crossed
    assert abs(env.environment_irradiance(sky, [0.0, 1, 0])[0] - np.pi) < 1e-13
    assert env.environment_irradiance(sky, np.zeros((0, 3))).shape == (0, 2)


def test_single_texels_are_suns(rng: np.random.Generator) -> None:
    """Beside 60^2 points in the texel."""
    h, w = 16, 32
    n = unit(rng.normal(size=(30, 3)))
    for i, j in ((3, 5), (0, 20), (9, 31)):
        sky = np.zeros((h, w, 1))
        sky[i, j] = 7.0
        x = (np.arange(60) + 0.5) / 60
        v, u = np.meshgrid((i + x) / h, (j + x) / w, indexing="ij")
        d = latlong_direction(np.stack([u, v], -1)).reshape(-1, 3)
        area = np.sin(np.pi * v).ravel()
        area *= latlong_solid_angles(h, w)[i] / area.sum()
        above = np.all(d @ n.T > 0, axis=0) | np.all(d @ n.T < 0, axis=0)
        slow = 7 * np.maximum(0, d @ n.T).T @ area
        found = env.environment_irradiance(sky, n)[:, 0]
        # Midpoints of 60 cells: 60^-2 / 24 of the texel's square
        assert np.abs(found - slow)[above].max() < 1e-5 * slow.max()
        assert above.sum() > 20


def test_harmonics_keep_their_bound_for_any_sun(rng: np.random.Generator) -> None:
    assert abs(1 / 4 - 5 / 32) == env.BOUND
    n = unit(rng.normal(size=(2000, 3)))
    worst = 0.0
    for i, j in ((20, 40), (32, 0), (50, 100)):
        sky = np.full((64, 128, 1), 1e-3)
        sky[i, j] = 1e4
        power = float(np.sum(sky[..., 0] * latlong_solid_angles(64, 128)[:, None]))
        exact = env.environment_irradiance(sky, n)
        found = env.harmonic_irradiance(n, env.irradiance_harmonics(sky))
        assert found.min() >= 0
        worst = max(worst, float(np.abs(found - exact).max() / power))
    # The sun's texel is .05 wide: l = 2 taken at its middle is off by .05^2 / 24 * 5
    assert worst < env.BOUND + 5e-4
    # And the bound is met
    assert worst > 0.9 * env.BOUND


def test_a_sky_of_two_bands_is_exact(rng: np.random.Generator) -> None:
    """Radiance 1 + d . a gives irradiance pi + 2 pi / 3 n . a."""
    h, w = 64, 128
    v, u = np.meshgrid((np.arange(h) + 0.5) / h, (np.arange(w) + 0.5) / w, indexing="ij")
    a = np.array([0.3, -0.4, 0.2])
    sky = 1 + (latlong_direction(np.stack([u, v], -1)) @ a)[..., None]
    n = unit(rng.normal(size=(200, 3)))
    truth = np.pi + 2 * np.pi / 3 * (n @ a)
    # Even texels stand for the gradient within them: (pi / 64)^2 / 8
    for found in (
        env.harmonic_irradiance(n, env.irradiance_harmonics(sky)),
        env.environment_irradiance(sky, n, cuts=2),
    ):
        assert np.abs(found[:, 0] - truth).max() < 2e-3


def test_turning_harmonics_is_turning_the_map(rng: np.random.Generator) -> None:
    radiance = rng.uniform(0, 1, (16, 32, 3))
    # Counter-clockwise from above: u grows towards +x, so the picture moves to smaller u
    moved = np.roll(radiance, -5, axis=1)
    turned = rotate(env.irradiance_harmonics(radiance), rotation("y", 5 / 32 * 2 * np.pi))
    np.testing.assert_allclose(turned, env.irradiance_harmonics(moved), atol=1e-12)
