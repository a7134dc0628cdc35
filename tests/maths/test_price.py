"""The law of errors finds what it was made from; its intervals cover."""

from __future__ import annotations

import numpy as np
import pytest

from maths import price


def test_law_is_found_again() -> None:
    law = price.Law(0.03, 0.8, 0.75)
    counts = [16, 64, 1024]
    found = price.fitted(counts, [law.error(n) for n in counts], 0.75)
    # Two unknowns, exact data: what is left is rounding in squares of 1e-3
    np.testing.assert_allclose((found.floor, found.scale), (0.03, 0.8), rtol=1e-6)


def test_no_part_of_a_law_is_negative() -> None:
    # Errors that fall faster than the power would want a negative square of a floor
    falling = price.fitted([16, 256], [0.1, 1e-4], 0.5)
    assert falling.floor == 0
    assert falling.scale > 0
    rising = price.fitted([16, 256], [0.1, 0.2], 0.5)
    assert rising.scale == 0
    assert 0.1 < rising.floor < 0.2


def test_law_needs_counts() -> None:
    with pytest.raises(ValueError, match="positive count"):
        price.fitted([0, 4], [1, 1], 0.5)


def test_seconds_of_each_kind_of_work_are_told_apart() -> None:
    work = np.array([[1.0, 1e4, 1e6], [1.0, 4e4, 1e6], [1.0, 1e4, 8e6]])
    unit = price.seconds_fitted(work, work @ [0.2, 1e-5, 1e-7])
    np.testing.assert_allclose(unit, [0.2, 1e-5, 1e-7], rtol=1e-6)


def test_relative_rms_is_the_ratio_of_sums() -> None:
    found = price.relative_rms([1.0, 3.0], [10.0, 90.0])
    assert found.value == pytest.approx(0.2)
    assert found.low < 0.2 < found.high
    assert price.relative_rms([0.0, 0.0], [0.0, 0.0]) == price.Estimate(0.0, 0.0, 0.0)


def test_interval_covers_the_truth() -> None:
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(400):
        # Errors grow with what they are errors of: squares a quarter of wholes, in the mean
        wholes = rng.gamma(4.0, 1.0, 40)
        squares = 0.25 * wholes * rng.gamma(4.0, 0.25, 40)
        found = price.relative_rms(squares, wholes)
        inside += found.low <= 0.5 <= found.high
    # 95 % of 400 with a binomial's standard error of 1.1 %: three of them below, and for the
    # logarithm's skew one point more
    assert 0.907 <= inside / 400 <= 0.985
