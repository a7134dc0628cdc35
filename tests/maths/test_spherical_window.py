"""The least window against ringing: row S9 of hard cases, minima against dense samples."""

import numpy as np
import pytest
from numpy.polynomial.legendre import legval

from maths.sampling import fibonacci_sphere
from maths.spherical_harmonics import evaluate, turn_zonal
from maths.spherical_projection import cap
from maths.spherical_window import minimum, smallest_window, window
from maths.transforms import normalise

COSINES = np.cos(np.linspace(0, np.pi, 100_001))


def along_meridian(zonal: np.ndarray) -> np.ndarray:
    """Values of a zonal function (..., l_max + 1) from pole to pole, (..., 100001)."""
    norms = np.sqrt((2 * np.arange(zonal.shape[-1]) + 1) / (4 * np.pi))
    return legval(COSINES, np.moveaxis(zonal * norms, -1, 0))


def zonal_window(zonal: np.ndarray, amount: float) -> np.ndarray:
    return zonal * (1 - amount) ** np.arange(zonal.shape[-1])


@pytest.mark.parametrize("l_max", [1, 2, 3, 4, 8])
@pytest.mark.parametrize("degrees", [5, 30, 45, 60, 90, 150])
def test_caps_stop_ringing_and_no_smaller_window_does(
    l_max: int, degrees: float, rng: np.random.Generator
) -> None:
    z = cap(np.radians(degrees), l_max)
    values = along_meridian(z)
    c = turn_zonal(z, normalise([[0.3, 0.5, 0.8], [0, 0, 1], [0, -1, 0], rng.normal(size=3)]))
    largest = np.abs(values).max()
    # Truth is samples 3e-5 apart, with a bend of at most l (l + 1) of the largest value
    assert np.all(minimum(c) <= values.min() + 1e-9 * largest)
    assert np.all(minimum(c) >= values.min() - 0.5 * l_max * (l_max + 1) * 1.6e-5**2 * largest)
    amounts = smallest_window(c)
    if values.min() >= 0:
        assert not amounts.any()
        return
    np.testing.assert_allclose(amounts, amounts[0], rtol=0, atol=1e-5)
    amount = float(amounts[0])
    assert along_meridian(zonal_window(z, amount)).min() > -1e-8 * largest
    # 20 bisections end within 1e-6; a thousandth less is too little
    assert along_meridian(zonal_window(z, 0.999 * amount)).min() < -1e-7 * largest


def test_ringing_of_a_cap_is_that_of_the_closed_form() -> None:
    # The published figure for 30 degrees and l_max = 3, of a disc of radiance 1
    assert along_meridian(cap(np.radians(30), 3)).min() == pytest.approx(-0.151, abs=5e-4)
    # Windowed, the middle is dimmer: .826 becomes .28 where the last negative goes
    z = cap(np.radians(30), 3)
    amount = float(smallest_window(turn_zonal(z, [0, 0, 1])))
    assert along_meridian(z)[0] == pytest.approx(0.826, abs=5e-4)
    assert along_meridian(zonal_window(z, amount))[0] == pytest.approx(0.282, abs=1e-3)


@pytest.mark.parametrize("l_max", [1, 3, 5])
def test_minima_of_any_functions_are_those_of_dense_samples(
    l_max: int, rng: np.random.Generator
) -> None:
    c = rng.normal(size=(200, (l_max + 1) ** 2))
    points = fibonacci_sphere(40_000)
    values = c @ evaluate(points, l_max).T
    found, dense = minimum(c), values.min(axis=1)
    largest = np.abs(values).max(axis=1)
    assert np.all(found <= dense + 1e-9 * largest)
    # Half a step of .018 away a bend of l (l + 1) of the largest value makes this
    assert np.all(found >= dense - 0.5 * l_max * (l_max + 1) * 0.009**2 * largest)


def test_any_function_is_lifted_and_not_too_far(rng: np.random.Generator) -> None:
    c = rng.normal(size=(60, 25))
    c[:, 0] = np.abs(c[:, 0])
    floor = 0.05
    amounts = smallest_window(c, floor)
    basis = evaluate(fibonacci_sphere(20_000), 4)
    after = (c * window(4, amounts)) @ basis.T
    assert np.all(after.min(axis=1) >= -floor - 1e-8)
    some = amounts > 0
    assert some.any()
    less = (c[some] * window(4, 0.98 * amounts[some])) @ basis.T
    # Samples .025 apart miss less of a minimum than 2 % of the window brings
    assert np.all(less.min(axis=1) < -floor)


def test_no_window_is_asked_for_where_none_helps(rng: np.random.Generator) -> None:
    c = rng.normal(size=(3, 9))
    c[:, 0] = -1
    np.testing.assert_array_equal(smallest_window(c), 0)
    flat = np.zeros((2, 16))
    flat[0, 0] = 1
    np.testing.assert_array_equal(smallest_window(flat), 0)
    np.testing.assert_array_equal(minimum(flat), [flat[0, 0] / np.sqrt(4 * np.pi), 0])
    assert smallest_window(np.zeros((0, 16))).shape == (0,)
    assert minimum(np.zeros((2, 0, 4))).shape == (2, 0)


def test_gains_are_one_to_a_constant() -> None:
    np.testing.assert_array_equal(window(3, 0.0), 1)
    np.testing.assert_array_equal(window(3, 1.0), [1] + [0] * 15)
    np.testing.assert_allclose(window(2, [0.5])[0], [1] + [0.5] * 3 + [0.25] * 5)
    for bad in (-0.1, 1.1, np.nan):
        with pytest.raises(ValueError, match="amount"):
            window(2, bad)
