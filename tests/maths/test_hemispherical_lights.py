"""Lamps seen by a dome: closed forms of a Lambert pixel, and brute force."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre

from maths import hemispherical_lights as lights
from maths.hemispherical_harmonics import evaluate
from maths.sampling import fibonacci_sphere, orthonormal_basis, r2, uniform_cone
from maths.transforms import latlong_direction, normalise, rotation

GRAZING = lights.GRAZING
# z as a series: 1/2 + (2 z - 1) / 2
LAMBERT = np.array([np.sqrt(2 * np.pi) / 2, 0.0, np.sqrt(2 * np.pi / 3) / 2, 0.0])


def faded(zonal: Polynomial) -> float:
    """Integral over z from 0 to 1 of fade times a polynomial in z, exact."""
    low, high = (zonal * Polynomial([0, 1 / GRAZING])).integ(), zonal.integ()
    return float(low(GRAZING) - low(0) + high(1) - high(GRAZING))


def test_a_sun_lights_a_matt_pixel_by_the_cosine(rng: np.random.Generator) -> None:
    d = normalise(rng.normal(size=(40, 3)))
    found = np.einsum("nkc,k->nc", lights.project_sun(d, [3.0, 2.0, 1.0], 2), LAMBERT)
    fade = np.clip(d[:, 2:] / GRAZING, 0, 1)
    expected = np.maximum(d[:, 2:], 0) * fade * np.array([3.0, 2.0, 1.0]) / np.pi
    np.testing.assert_allclose(found, expected, atol=1e-15)
    assert np.count_nonzero(found[:, 0]) == np.count_nonzero(d[:, 2] > 0) > 10


def test_a_sun_sets_without_a_jump_and_stays_down() -> None:
    z = np.linspace(-0.02, 0.2, 2201)
    d = np.stack([np.sqrt(1 - z * z), np.zeros_like(z), z], axis=-1)
    L = lights.project_sun(d, np.ones(3), 3)[:, :, 0]
    # Steps of 1e-4 in z are a thousandth of the fade; H itself turns by less than that again
    assert np.abs(np.diff(L, axis=0)).max() < 2e-3 * np.abs(L).max()
    assert np.array_equal(L[z < 0], np.zeros_like(L[z < 0]))
    full = evaluate(d[z > GRAZING], 3) / np.pi
    np.testing.assert_allclose(L[z > GRAZING], full, rtol=0, atol=1e-14)


@pytest.mark.parametrize("bands", [1, 3, 6])
def test_an_even_environment_is_the_integral_of_the_fade(bands: int) -> None:
    L = lights.project_environment(np.ones((128, 256, 3)), bands)
    expected = np.zeros((bands * bands, 3))
    for band in range(bands):
        # P_l(2 z - 1) of norm sqrt((2 l + 1) / 2 pi), over an azimuth of 2 pi, divided by pi
        zonal = Legendre.basis(band).convert(kind=Polynomial)(Polynomial([-1, 2]))
        expected[band * (band + 1)] = 2 * np.sqrt((2 * band + 1) / (2 * np.pi)) * faded(zonal)
    # Kinks of the fade, .1 wide, on texels of pi / 128 = .025: measured 3.4e-4, below .3e-4
    np.testing.assert_allclose(L, expected, rtol=0, atol=6e-4)
    share = lights.project_environment(np.ones((128, 256, 3)), 2)[:, 0] @ LAMBERT
    # A matt sheet loses the integral of 2 z (1 - z / g) up to g: g^2 / 3
    assert share == pytest.approx(1 - GRAZING**2 / 3, abs=1e-4)


def smooth_map(height: int) -> np.ndarray:
    """Radiance 1 + x / 2 + y z, and other colours: a polynomial of the direction, (h, 2 h, 3)."""
    u, v = (np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height
    x, y, z = np.moveaxis(latlong_direction(np.stack(np.meshgrid(u, v), axis=-1)), -1, 0)
    return np.stack([1 + x / 2 + y * z, 1 + z / 2, 1 - y / 2], axis=-1)


def test_an_environment_is_the_sum_of_a_thousand_suns() -> None:
    found = lights.project_environment(smooth_map(512), 4)
    # Points against the kinks of the fade, of the largest coefficient: measured 2.6e-4 and 2.0e-5
    for count, error in ((1000, 5e-4), (10_000, 4e-5)):
        d = fibonacci_sphere(count)
        x, y, z = d.T
        radiance = np.stack([1 + x / 2 + y * z, 1 + z / 2, 1 - y / 2], axis=-1)
        suns = lights.project_sun(d, radiance * (4 * np.pi / count), 4).sum(axis=0)
        np.testing.assert_allclose(found, suns, rtol=0, atol=error * np.abs(suns).max())


def test_a_turned_sprite_sees_the_map_turned(rng: np.random.Generator) -> None:
    image = np.zeros((32, 64, 3))
    image[9, 20] = [1.0, 2.0, 3.0]
    world = latlong_direction([20.5 / 64, 9.5 / 32])
    yaws = np.array([-1.2, 2.4, -2.6])
    found = lights.project_environment(image, 4, yaw=yaws)
    sun = np.einsum("nij,j->ni", [rotation("y", -yaw) for yaw in yaws], world)
    power = np.full(3, np.cos(9 * np.pi / 32) - np.cos(10 * np.pi / 32)) * 2 * np.pi / 64
    expected = lights.project_sun(sun, power * [1.0, 2.0, 3.0], 4)
    # One texel is a sun at its centre
    np.testing.assert_allclose(found, expected, atol=1e-14)
    assert (np.abs(expected).max(axis=(1, 2)) > 0).tolist() == [True, False, True]


def sphere_by_brute_force(
    offset: np.ndarray, radius: float, bands: int
) -> tuple[np.ndarray, float]:
    distance = np.linalg.norm(offset)
    towards, half_angle = offset / distance, np.arcsin(radius / distance)
    local = uniform_cone(r2(np.arange(20_000)), half_angle)
    a, b = orthonormal_basis(towards)
    d = local[:, :1] * a + local[:, 1:2] * b + local[:, 2:] * towards
    cap = 2 * (1 - np.cos(half_angle))
    return lights.evaluate_direction(d, bands).mean(axis=0) * cap, float(cap)


@pytest.mark.parametrize("size", [0.02, 0.3, 0.95])
def test_sphere_light_is_its_cap(size: float, rng: np.random.Generator) -> None:
    offset = rng.normal(size=(6, 3))
    # Half of them set: their caps straddle the plane of the sprite
    offset[::2, 2] = rng.uniform(-1, 1, 3) * size * np.linalg.norm(offset[::2, :2], axis=-1)
    radius = size * np.linalg.norm(offset, axis=-1)
    coarse = lights.project_sphere(offset, radius, np.ones(3), 5)[..., 0]
    fine = lights.project_sphere(offset, radius, np.ones(3), 5, nodes=(48, 32))[..., 0]
    for n in range(6):
        truth, whole = sphere_by_brute_force(offset[n], radius[n], 5)
        # 8 strips cost up to 1.4 % (measured over 300 lamps), 48 of them .04 %; 20,000 points of R2
        # about .1 %
        assert np.abs(coarse[n] - truth).max() < 0.02 * whole
        assert np.abs(fine[n] - truth).max() < 0.003 * whole


def test_a_small_sphere_is_a_sun(rng: np.random.Generator) -> None:
    offset, radius = rng.normal(size=(30, 3)) * 500 + [0, 0, 300], 0.05
    offset = offset[np.abs(offset[:, 2]) > 10]
    power = np.array([2.0, 1.0, 3.0])
    sphere = lights.project_sphere(offset, radius, power, 4)
    E = np.pi * radius**2 / np.sum(offset**2, axis=-1)[:, None] * power
    sun = lights.project_sun(offset, E, 4)
    # A cap of 1e-3 rad instead of 7e-5 is second order, 1e-6, but where it meets a kink of the
    # fade: of 1e-3 / .1 a fifth
    error = np.abs(sphere - sun).max(axis=(1, 2)) / E.max(axis=1)
    assert error.max() < 2e-3
    assert np.median(error) < 2e-6


def test_spheres_behind_and_around() -> None:
    for z in (-1.0001, -2.0, -50.0):
        behind = lights.project_sphere([0.4, 3.0, z], 1.0, np.ones(3), 3)
        assert np.array_equal(behind, np.zeros((9, 3)))
    everywhere = lights.project_environment(np.ones((128, 256, 3)), 3)
    for offset in ([0.0, 0.0, 0.0], [0.3, -0.2, -0.4], [0.0, 1.0, 0.0]):
        around = lights.project_sphere(offset, 1.0, np.ones(3), 3)
        # 8 strips across the kink of the fade: measured .004 of .8
        np.testing.assert_allclose(around, everywhere, atol=8e-3)
    apart = np.array([0, 0, 3.0]) * np.ones((7, 1, 1))
    many = lights.project_sphere(apart, np.ones(2), np.ones(3), 2)
    assert many.shape == (7, 2, 4, 3)


def test_blocks_change_nothing(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    offset, image = rng.normal(size=(20, 3)), rng.uniform(size=(8, 16, 3))
    whole = lights.project_sphere(offset, 0.5, np.ones(3), 4)
    map_whole = lights.project_environment(image, 4)
    monkeypatch.setattr(lights, "BLOCK", 1)
    # Only the order of sums differs
    np.testing.assert_allclose(lights.project_sphere(offset, 0.5, np.ones(3), 4), whole, rtol=1e-12)
    np.testing.assert_allclose(lights.project_environment(image, 4), map_whole, atol=1e-14)


@pytest.mark.parametrize("bands", [1, 2, 5])
def test_mirror_signs_are_those_of_a_mirrored_light(bands: int, rng: np.random.Generator) -> None:
    d = rng.normal(size=(30, 3))
    mirrored = lights.evaluate_direction(d * [-1, 1, 1], bands)
    found = lights.evaluate_direction(d, bands) * lights.mirror_signs(bands)
    np.testing.assert_allclose(found, mirrored, atol=1e-13)
    assert np.abs(found).max() > 0.1


@pytest.mark.parametrize("radius", [0.0, -1.0, np.inf, np.nan])
def test_lights_that_are_none_are_refused(radius: float) -> None:
    with pytest.raises(ValueError, match="radius above 0"):
        lights.project_sphere([0.0, 0.0, 3.0], radius, np.ones(3), 2)
    with pytest.raises(ValueError, match="direction"):
        lights.project_sun([0.0, radius * 0.0, 0.0], np.ones(3), 2)
    with pytest.raises(ValueError, match="environment"):
        lights.project_environment(np.ones((4, 8)), 2)
