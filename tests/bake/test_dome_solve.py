"""Small systems solved together are those solved one by one in double precision."""

import numpy as np
import pytest

from bake.dome_solve import LEAST, solved


@pytest.mark.parametrize("count", [1, 2, 16])
def test_systems_are_those_of_numpy(count: int) -> None:
    rng = np.random.default_rng(count)
    factors = rng.normal(size=(50, 3 * count, count))
    normal = np.einsum("pni,pnj->pij", factors, factors) + np.eye(count)
    normal = normal.astype(np.float32)
    right = rng.normal(size=(50, count)).astype(np.float32)
    truth = np.linalg.solve(normal.astype(np.float64), right.astype(np.float64)[..., None])[..., 0]
    found = solved(normal.transpose(1, 2, 0).copy(), right.T.copy()).T
    # Conditions up to 60, times roundings of 6e-8 in 16 steps
    np.testing.assert_allclose(found, truth, rtol=0, atol=6e-5 * np.abs(truth).max())
    # The upper triangles have no say
    spoilt = normal.transpose(1, 2, 0) + np.triu(np.full((count, count), 7.0), 1)[..., None]
    again = solved(spoilt.astype(np.float32), right.T.copy()).T
    np.testing.assert_array_equal(again, found)


def test_what_equations_leave_open_stays_bounded() -> None:
    """Two unknowns of which only the sum is known: each within rounding of what the sum allows."""
    normal = np.ones((2, 2, 3), np.float32)
    found = solved(normal, np.full((2, 3), 2, np.float32))
    np.testing.assert_allclose(found.sum(axis=0), 2, rtol=1e-6)
    # A right side that contradicts itself by d gives at most d / LEAST
    other = solved(np.ones((2, 2, 1), np.float32), np.array([[1], [1.001]], np.float32))
    assert np.all(np.isfinite(other))
    assert np.abs(other).max() <= 0.0011 / LEAST
