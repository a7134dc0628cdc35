"""The alias table gives each index its share, exactly."""

import numpy as np
import pytest

from maths.alias_table import AliasTable

CASES = (
    [1.0],
    [1.0, 3.0],
    [0.0, 2.0, 0.0, 0.5, 0.0],
    [1e-12, 1.0, 1e-12],
    list(np.random.default_rng(0).gamma(0.2, size=1000)),
    [0.1] * 7,
)


@pytest.mark.parametrize("weights", CASES, ids=range(len(CASES)))
def test_bins_add_up_to_the_shares(weights: list[float]) -> None:
    table = AliasTable.of(weights)
    n = len(weights)
    assert np.all((table.stay >= 0) & (table.stay <= 1 + 1e-12))
    mass = np.zeros(n)
    np.add.at(mass, np.arange(n), table.stay / n)
    np.add.at(mass, table.alias, (1 - table.stay) / n)
    # n roundings of numbers about 1
    np.testing.assert_allclose(mass, np.array(weights) / np.sum(weights), rtol=0, atol=n * 4e-16)


@pytest.mark.parametrize("weights", CASES, ids=range(len(CASES)))
def test_what_has_no_weight_is_never_chosen(weights: list[float]) -> None:
    found = AliasTable.of(weights).choose(np.linspace(0, 1, 5000, endpoint=False))
    assert np.all(np.array(weights)[found] > 0)
    assert AliasTable.of(weights).choose(np.nextafter(1.0, 0)) < len(weights)


def test_choices_come_in_their_shares() -> None:
    weights = np.array([5.0, 1.0, 0.0, 2.0, 8.0])
    u = (np.arange(1 << 16) + 0.5) / (1 << 16)
    counts = np.bincount(AliasTable.of(weights).choose(u), minlength=5)
    # Even numbers: each bin is off by one at most at both of its ends
    assert np.all(np.abs(counts - weights / 16 * (1 << 16)) <= 10)


@pytest.mark.parametrize("weights", [[], [0.0, 0.0], [-1.0, 2.0], [np.nan, 1.0], [np.inf], [[1.0]]])
def test_weights_that_are_none_are_refused(weights: list[float]) -> None:
    with pytest.raises(ValueError, match="Weights"):
        AliasTable.of(weights)
