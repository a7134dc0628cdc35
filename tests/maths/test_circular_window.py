"""Windows: positive, smallest, and only where a pixel rings."""

import numpy as np
import pytest

from maths.circular_basis import evaluate, reconstruct, rotate
from maths.circular_signals import lambert_lobe, shadow_arc
from maths.circular_window import BLOCK, minimum, smallest_window, window

DENSE = 2 * np.pi * np.arange(8192) / 8192


@pytest.mark.parametrize(
    ("degrees", "lowest"), [(22.5, -0.133), (45, -0.148), (90, -0.137), (135, -0.018)]
)
def test_minimum_of_arcs(degrees: float, lowest: float) -> None:
    Y = shadow_arc(np.radians(degrees), 5)
    assert abs(float(minimum(Y)) - lowest) < 5e-4


def test_minimum_of_the_lambert_lobe() -> None:
    assert abs(float(minimum(lambert_lobe(5))) + 0.0412) < 5e-5


@pytest.mark.parametrize("terms", [1, 3, 5, 9, 17])
def test_minimum_is_that_of_dense_samples(terms: int, rng: np.random.Generator) -> None:
    Y = rng.normal(size=(200, terms))
    dense = reconstruct(Y, DENSE).min(axis=-1)
    found = minimum(Y)
    # Samples miss a bottom by at most curvature / 8 * spacing^2
    scale = np.abs(Y).sum(axis=-1) / np.sqrt(np.pi)
    miss = scale * ((terms // 2) * 2 * np.pi / 8192) ** 2 / 8
    assert np.all(found <= dense + 1e-13 * scale)
    assert np.all(found >= dense - miss - 1e-13 * scale)


def test_minimum_in_blocks_and_on_axes(rng: np.random.Generator) -> None:
    Y = rng.normal(size=(3, BLOCK + 5))
    assert np.array_equal(minimum(Y, axis=0)[-7:], minimum(Y[:, -7:].T))


def test_window_kernel_is_positive() -> None:
    for amount in (0.05, 0.3, 0.7, 1.0):
        # A long series shows the kernel itself: 801 terms leave (1 - amount)^400, 1e-9 at .05
        impulse = evaluate(0.0, 801) * window(801, amount)
        assert reconstruct(impulse, DENSE[::16]).min() > -1e-8


def test_window_ends() -> None:
    assert np.array_equal(window(5, 0.0), np.ones(5))
    assert np.array_equal(window(5, 1.0), [1, 0, 0, 0, 0])
    for wrong in (-0.1, 1.1, np.nan):
        with pytest.raises(ValueError, match="from 0 to 1"):
            window(5, wrong)


def test_smallest_window_is_enough_and_smallest() -> None:
    Y = np.stack([shadow_arc(w, 5) for w in np.linspace(0.1, 3.0, 30)])
    amount = smallest_window(Y)
    after = minimum(Y * window(5, amount))
    assert np.all(after >= -1e-15)
    rang = minimum(Y) < 0
    assert rang.any()
    assert np.all(amount[~rang] == 0)
    # A hundredth less is not enough
    less = minimum(Y * window(5, np.maximum(0, amount - 0.01)))
    assert np.all(less[rang] < 0)


def test_positive_pixels_keep_every_bit() -> None:
    Y = np.array([[3.0, 0.5, 0.5, 0.1, 0.2]])
    assert np.array_equal(Y * window(5, smallest_window(Y)), Y)


def test_mean_stays_and_turning_changes_nothing() -> None:
    Y = shadow_arc(0.8, 5)
    assert (Y * window(5, smallest_window(Y)))[0] == Y[0]
    # 2^-20 of bisection, and minima that differ by rounding
    assert abs(smallest_window(Y) - smallest_window(rotate(Y, 1.234))) < 4e-6


def test_floor_allows_a_little() -> None:
    Y = shadow_arc(0.8, 5)
    amount = smallest_window(Y, floor=0.05)
    assert 0 < amount < smallest_window(Y)
    assert abs(float(minimum(Y * window(5, amount))) + 0.05) < 1e-5
    assert smallest_window(Y, floor=0.2) == 0


def test_negative_signals_are_left_alone() -> None:
    assert smallest_window([-1.0, 0.2, 0.3]) == 0


def test_window_costs_the_lobe_less_than_fixed_windows() -> None:
    # RMS of the Lambert lobe under Hann .147, Lanczos .113, Fejer .158; without .034
    Y = lambert_lobe(5)
    after = reconstruct(Y * window(5, smallest_window(Y)), DENSE)
    rms = np.sqrt(np.mean((after - np.maximum(0, np.cos(DENSE))) ** 2))
    assert 0.034 < rms < 0.113
