"""A turned map is the map that a turned world sees."""

import numpy as np
import pytest

from maths.latlong import joined, turned
from maths.spherical_lights import project_environment
from maths.spherical_rotation import rotate
from maths.transforms import rotation


@pytest.mark.parametrize("columns", [0, 1, 7, -3, 40, 33])
def test_turns_by_whole_columns_are_turns_of_the_harmonics(columns):
    radiance = np.random.default_rng(1).random((16, 32, 3))
    yaw = columns / 32 * 2 * np.pi
    found = project_environment(turned(radiance, yaw), 4)
    np.testing.assert_allclose(
        found, rotate(project_environment(radiance, 4), rotation("y", yaw)), atol=1e-12
    )


def test_every_row_keeps_its_sum():
    radiance = np.random.default_rng(2).random((8, 16, 3))
    np.testing.assert_allclose(
        turned(radiance, 0.123).sum(axis=1), radiance.sum(axis=1), rtol=1e-14
    )


def test_joined_maps_keep_each_others_texels(rng: np.random.Generator) -> None:
    """A map three times as high has each texel of a small one nine times."""
    large, small = rng.random((6, 12, 3)), rng.random((2, 4, 3))
    expected = large + small.repeat(3, axis=0).repeat(3, axis=1)
    np.testing.assert_array_equal(joined([large, small]), expected)
    np.testing.assert_array_equal(joined([small, large]), expected)
    # Sizes of which neither divides the other: the nearest texel
    odd = joined([np.zeros((3, 6, 1)), np.arange(8.0).reshape(2, 4, 1)])[..., 0]
    assert odd.tolist() == [[0, 1, 1, 2, 3, 3], [4, 5, 5, 6, 7, 7], [4, 5, 5, 6, 7, 7]]


def test_no_map_is_refused() -> None:
    with pytest.raises(ValueError, match="no map"):
        joined([])
