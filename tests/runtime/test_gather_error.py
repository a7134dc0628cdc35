"""The told error of gathered light: closed forms of its parts, and whether intervals hold."""

import numpy as np
import pytest

from bake import voxel_faces
from runtime import gather_error
from runtime.gather_error import Sums
from tests.runtime.cube_worlds import room


def sums(**more):
    t = 100
    base = {
        "light": np.full(t, 2.0),
        "indirect": np.full(t, 1.0),
        "albedo": np.full(t, 0.5),
        "apart": np.full(t, 0.1),
        "older": np.ones(t),
    }
    return Sums(**(base | more))


def test_what_is_handed_on_is_off_as_a_whole():
    """100 like texels: their sum is off by a tenth of what one is, and half of it goes on."""
    found = sums()
    own = 0.1 / 2.0 / np.sqrt(100)
    assert found.handed_on() == pytest.approx(np.sqrt(3) * own / (1 - 0.5))
    expected = np.sqrt(0.1**2 + found.handed_on() ** 2) / 2.0
    assert found.relative_error() == pytest.approx(expected)
    # Without bounces, each texel's own error is all
    assert sums(indirect=np.zeros(100)).relative_error() == pytest.approx(0.05)
    # What was forgotten makes it larger
    forgotten = sums(indirect=np.zeros(100), older=np.full(100, 4.0))
    assert forgotten.relative_error() == pytest.approx(0.1)
    dark = np.zeros(100)
    assert sums(light=dark, indirect=dark, apart=dark).relative_error() == 0
    # All is handed on: bounded all the same
    assert np.isfinite(sums(indirect=np.full(100, 2.0), albedo=np.ones(100)).relative_error())


def test_renewed_means_are_three_times_as_wide(rng):
    """Shares 1/2, 1/4, ... of means over the first 1/2, 1/4, ... of 256 values."""
    running = np.cumsum(rng.normal(size=(6_000, 256)), axis=1)
    mean = sum(running[:, n - 1] / n * n / 255 for n in (128 >> k for k in range(8)))
    # A chi-square of 6,000 has a standard error of 2 %; 255 for 256 and the last mean bring 2 %
    assert np.var(mean) * 256 == pytest.approx(gather_error.RENEWED, rel=0.1)


def test_pooled_is_the_mean_over_neighbours_of_the_same_rectangle(rng):
    faces = voxel_faces.layout(room().cells, texels=2)
    used = faces.cell() >= 0
    used &= rng.random(used.shape) < 0.9
    values = rng.random(int(used.sum()))
    mean, count = gather_error.pooled(values, used, faces)
    rows, _, _, x, y = faces.interior
    kept = used[y, x]
    rows, x, y = rows[kept], x[kept], y[kept]
    image = np.zeros(used.shape)
    image[used] = values
    own = image[y, x]
    found, counts = np.zeros((2, *used.shape))
    found[used], counts[used] = mean, count
    for k in rng.permutation(len(rows))[:200]:
        near = (rows == rows[k]) & (np.abs(x - x[k]) <= 1) & (np.abs(y - y[k]) <= 1)
        assert counts[y[k], x[k]] == near.sum()
        assert found[y[k], x[k]] == pytest.approx(own[near].mean())
