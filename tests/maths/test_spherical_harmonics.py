"""Spherical harmonics: the definition, the poles, and rows S1 to S4 of hard cases."""

from math import factorial

import numpy as np
import pytest
from numpy.polynomial.legendre import Legendre

from maths.spherical_harmonics import band_of, evaluate, l_max_of, turn_zonal
from maths.transforms import normalise


def slow(d: np.ndarray, l_max: int) -> np.ndarray:
    """The definition: derivatives of Legendre polynomials, angles, factorials."""
    x, y, z = d.T
    phi, sine = np.arctan2(y, x), np.hypot(x, y)
    rows = []
    for band in range(l_max + 1):
        for m in range(-band, band + 1):
            n = abs(m)
            P = sine**n * Legendre.basis(band).deriv(n)(z) if n else Legendre.basis(band)(z)
            norm = (2 * band + 1) / (4 * np.pi) * factorial(band - n) / factorial(band + n)
            wave = np.sqrt(2) * (np.sin(n * phi) if m < 0 else np.cos(n * phi)) if m else 1.0
            rows.append(np.sqrt(norm) * P * wave)
    return np.stack(rows, axis=-1)


def hard_directions(rng: np.random.Generator) -> np.ndarray:
    d = rng.normal(size=(600, 3))
    for i, away in enumerate((0.0, 1e-8, 1e-4, 1e-2)):
        d[100 * i : 100 * i + 100, :2] *= away
    return normalise(d)


def test_it_is_the_definition_at_the_poles_too(rng: np.random.Generator) -> None:
    d = hard_directions(rng)
    # The slow version's Clenshaw sums lose 1e-14 at l = 10
    np.testing.assert_allclose(evaluate(d, 10), slow(d, 10), rtol=0, atol=1e-12)


def test_single_precision_is_rounded_double(rng: np.random.Generator) -> None:
    d = hard_directions(rng).astype(np.float32)
    for l_max in (3, 5, 20):
        found = evaluate(d, l_max)
        assert found.dtype == np.float32
        # Half a unit of values under 2 is 6e-8; 1e-6 is what is asked for
        truth = evaluate(d.astype(np.float64), l_max)
        np.testing.assert_allclose(found, truth, rtol=0, atol=1.3e-7)
    assert evaluate(d.astype(np.float16), 2).dtype == np.float16
    assert evaluate([0, 0, 1], 2).dtype == np.float64


def test_squares_of_a_band_add_up(rng: np.random.Generator) -> None:
    band = band_of(100)
    squares = np.square(evaluate(hard_directions(rng), 100))
    for value in (0, 1, 5, 20, 100):
        total = squares[:, band == value].sum(axis=-1) * 4 * np.pi / (2 * value + 1)
        # Unsoeld's theorem; measured 8e-14 at l = 100, 1.8e-12 at 1e-8 from the poles
        np.testing.assert_allclose(total, 1, rtol=0, atol=4e-12)


def test_lengths_do_not_matter(rng: np.random.Generator) -> None:
    d = normalise(rng.normal(size=(50, 3)))
    for length in (1e-300, 1e-200, 0.999, 1.001, 1e200, 1e300):
        np.testing.assert_allclose(evaluate(d * length, 5), evaluate(d, 5), rtol=0, atol=1e-14)


@pytest.mark.parametrize("bad", [[0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 0], [1.0, 2.0]])
def test_what_is_no_direction_is_refused(bad: list[float]) -> None:
    with pytest.raises(ValueError, match="irection"):
        evaluate(bad, 2)


def test_other_bands_and_counts_are_refused() -> None:
    for l_max in (-1, 501):
        with pytest.raises(ValueError, match="l_max"):
            evaluate([0, 0, 1], l_max)
    assert [l_max_of(k) for k in (1, 4, 9, 16, 25)] == [0, 1, 2, 3, 4]
    for count in (0, 2, 3, 24, -4):
        with pytest.raises(ValueError, match="numbers"):
            l_max_of(count)
    assert evaluate(np.zeros((0, 3)) + 1, 3).shape == (0, 16)


def test_zonal_functions_turn(rng: np.random.Generator) -> None:
    axis, d = normalise(rng.normal(size=(2, 30, 3)))
    z = rng.normal(size=6)
    found = np.sum(turn_zonal(z, axis) * evaluate(d, 5), axis=-1)
    cosine = np.sum(axis * d, axis=-1)
    norms = np.sqrt((2 * np.arange(6) + 1) / (4 * np.pi))
    np.testing.assert_allclose(found, Legendre(z * norms)(cosine), rtol=0, atol=1e-13)
