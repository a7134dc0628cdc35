"""Tables by running sums give each item the share of its weight, exactly."""

import numpy as np
import pytest

from maths.alias_sweep import sweep


def shares(table):
    """What a table gives each item, bin by bin."""
    n = len(table.stay)
    found = np.bincount(table.alias, 1 - table.stay, n)
    return (found + table.stay) / n


@pytest.mark.parametrize("n", [1, 2, 3, 10, 1000])
def test_shares_are_those_of_the_weights(rng, n):
    for power in (0.0, 1.0, 6.0):
        weights = rng.random(n) ** power
        weights[rng.random(n) < 0.3] = 0
        weights[rng.integers(n)] = 1
        table = sweep(weights)
        expected = weights / weights.sum()
        np.testing.assert_allclose(table.share, expected, rtol=1e-12)
        # Running sums of n numbers in float64
        np.testing.assert_allclose(shares(table), expected, atol=1e-14 * n)
        assert table.stay.min() >= 0
        assert table.stay.max() <= 1
        # What has no weight is never chosen
        chosen = table.choose((np.arange(20 * n) + 0.5) / (20 * n))
        assert np.all(weights[chosen] > 0)


def test_even_weights_need_no_alias():
    np.testing.assert_array_equal(sweep(np.full(7, 3.0)).choose((np.arange(7) + 0.5) / 7), range(7))


@pytest.mark.parametrize("weights", [[], [0.0, 0.0], [1.0, -1.0], [1.0, np.inf], [[1.0]]])
def test_refusals(weights):
    with pytest.raises(ValueError, match="Weights"):
        sweep(weights)
