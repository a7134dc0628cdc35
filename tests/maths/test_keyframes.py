"""Keys: exact at their times, never beyond their values, smooth where it is asked for."""

import numpy as np
import pytest

from maths.keyframes import INTERPOLATIONS, sample


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("loop", [False, True])
def test_keys_are_hit_and_never_exceeded(
    interpolation: str, loop: bool, rng: np.random.Generator
) -> None:
    for _ in range(20):
        times = np.cumsum(rng.uniform(0.01, 3, 6))
        values = rng.normal(size=(6, 3)) * 10.0 ** rng.integers(-3, 4)
        at_keys = sample(times, values, times[:-1], interpolation, loop)
        assert np.array_equal(at_keys, values[:-1])
        dense = sample(times, values, np.linspace(times[0], times[-1], 501), interpolation, loop)
        assert dense.shape == (501, 3)
        assert np.all(dense >= values.min(axis=0))
        assert np.all(dense <= values.max(axis=0))


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_ends_hold(interpolation: str) -> None:
    assert sample([1, 2, 3], [5, 6, 9], [-1e9, 1, 3, 1e9], interpolation).tolist() == [5, 5, 9, 9]


def test_step_holds_until_the_next_key() -> None:
    at = [0, 0.999, 1, 1.999, 2]
    assert sample([0, 1, 2], [10, 20, 30], at, "step").tolist() == [10, 10, 20, 20, 30]


def test_two_smooth_keys_are_smoothstep() -> None:
    x = np.linspace(0, 1, 11)
    assert np.allclose(
        sample([2, 4], [1, 3], 2 + 2 * x, "smooth"), 1 + 2 * x * x * (3 - 2 * x), atol=1e-15
    )


def test_smooth_keys_on_a_line_do_not_stop_between() -> None:
    eps = 1e-6
    before, after = (sample([0, 1, 2], [0, 1, 2], t, "smooth") for t in (1 - eps, 1 + eps))
    assert abs(float(after - before) / (2 * eps) - 1) < 1e-5


@pytest.mark.parametrize("loop", [False, True])
def test_smooth_has_one_slope_on_both_sides_of_a_key(loop: bool, rng: np.random.Generator) -> None:
    times, values = np.cumsum(rng.uniform(0.5, 2, 7)), rng.normal(size=7)
    values[-1] = values[0]
    eps = 1e-6
    knots = times if loop else times[1:-1]
    left = (
        sample(times, values, knots, "smooth", loop)
        - sample(times, values, knots - eps, "smooth", loop)
    ) / eps
    right = (
        sample(times, values, knots + eps, "smooth", loop)
        - sample(times, values, knots, "smooth", loop)
    ) / eps
    # Differences see curvature times eps: under 100 * 1e-6
    assert np.allclose(left, right, rtol=0, atol=1e-4)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_loop_repeats(interpolation: str) -> None:
    times, values, t = [1, 2, 5], [0, 3, 0], np.array([1.25, 2.5, 4.75])
    once = sample(times, values, t, interpolation, loop=True)
    for turns in (-3, 1, 250):
        assert np.array_equal(sample(times, values, t + 4 * turns, interpolation, loop=True), once)


def test_one_key_is_a_constant() -> None:
    assert sample([3], [[1, 2]], [0, 9], "smooth", loop=True).tolist() == [[1, 2], [1, 2]]
    assert sample([3], [7], 5.0).shape == ()


@pytest.mark.parametrize(
    ("times", "values", "t", "interpolation"),
    [
        ([], [], 0, "linear"),
        ([0, 0], [1, 2], 0, "linear"),
        ([1, 0], [1, 2], 0, "linear"),
        ([0, 1e-320], [1, 2], 0, "smooth"),
        ([0, 1], [1], 0, "linear"),
        ([0, 1], [1, np.nan], 0, "linear"),
        ([0, np.inf], [1, 2], 0, "linear"),
        ([0, 1], [1, 2], np.nan, "linear"),
        ([0, 1], [1, 2], 0, "cubic"),
    ],
)
def test_keys_that_are_none_are_refused(times, values, t, interpolation) -> None:
    with pytest.raises(ValueError, match=r"[Kk]eys|Interpolation"):
        sample(times, values, t, interpolation)
