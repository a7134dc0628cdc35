"""Linear lookups in volumes against scipy's, and where they must not go."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from maths.trilinear import corners, looked_up


@pytest.mark.parametrize("size", [(3, 4, 5), (1, 6, 2), (1, 1, 1)])
def test_lookups_are_those_of_scipy(size: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(0)
    volume = rng.normal(size=(*size[::-1], 2)).astype(np.float32)
    places = rng.uniform(-0.3, 1.3, (200, 3))
    at = (places * size - 0.5)[:, ::-1].T
    expected = [map_coordinates(volume[..., c], at, order=1, mode="nearest") for c in range(2)]
    # float32 weights
    np.testing.assert_allclose(looked_up(volume, places), np.stack(expected, axis=1), atol=2e-6)


def test_middles_of_texels_are_read_alone() -> None:
    places = np.array([[0.5 / 3, 2.5 / 4, 1.5 / 2]])
    indices, weights = corners(places, (3, 4, 2))
    assert indices[0, weights[0] > 1e-6].tolist() == [(1 * 4 + 2) * 3 + 0]
    assert weights.max() == pytest.approx(1, abs=1e-6)


def test_weights_sum_to_one_and_stay_in_the_volume() -> None:
    places = np.random.default_rng(1).uniform(-2, 3, (500, 3))
    indices, weights = corners(places, (5, 2, 3))
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    assert weights.min() >= 0
    assert indices.min() >= 0
    assert indices.max() < 30
