"""Intervals hold the truth as often as they say: exact quantiles, and sums of estimates."""

import numpy as np
import pytest

from maths import intervals


def test_factors_are_the_quantiles_of_tables() -> None:
    # Student 1908 and any table since
    for degrees, factor in ((1, 12.706), (3, 3.182), (7, 2.365), (30, 2.042), (np.inf, 1.960)):
        assert intervals.coverage_factor(degrees) == pytest.approx(factor, abs=5e-4)
    # Between whole numbers, and towards the normal one
    assert intervals.coverage_factor(1e9) == pytest.approx(intervals.coverage_factor(), rel=1e-8)
    assert intervals.coverage_factor(7) > intervals.coverage_factor(7.5)


@pytest.mark.parametrize("degrees", [0, -1, float("nan")])
def test_no_degrees_are_refused(degrees: float) -> None:
    with pytest.raises(ValueError, match="degrees of freedom"):
        intervals.coverage_factor(degrees)


def test_a_sum_of_unlike_estimates_holds(rng: np.random.Generator) -> None:
    """Means of 4 and of 8 values, one part five times as wide as the other, and added up."""
    runs, parts = 4_000, ((4, 5.0), (8, 1.0))
    total, variances = np.zeros(runs), []
    for count, width in parts:
        values = width * rng.normal(size=(runs, count))
        total += values.mean(axis=1)
        variances.append(values.var(axis=1, ddof=1) / count)
    held = 0
    for off, *own in zip(total, *variances, strict=True):
        degrees = intervals.effective_degrees(own, [count - 1 for count, _ in parts])
        held += abs(off) <= intervals.coverage_factor(degrees) * np.sqrt(sum(own))
    # 95 % within 4 standard deviations of the count, .0034; the rule itself is off by .003 here
    assert abs(held / runs - 0.95) < 4 * 0.0034 + 0.004
