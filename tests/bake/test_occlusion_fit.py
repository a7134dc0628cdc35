"""Volumes fitted to traced voxels: what a lookup gives, and how bytes are spent."""

import numpy as np
import pytest

from bake import occlusion_fit
from bake.occlusion_fit import fit, sizes, split
from formats.occlusion import Box
from maths.occlusion_shadow import occlusion_warp
from maths.trilinear import corners, looked_up

CUBE = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
LONG = Box((0.0, 0.0, 0.0), (1.0, 4.0, 2.0))


def middles(n: int) -> np.ndarray:
    at = (np.arange(n) + 0.5) / n
    z, y, x = np.meshgrid(at, at, at, indexing="ij")
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


@pytest.fixture
def traced() -> tuple[np.ndarray, np.ndarray]:
    """Smooth values (9, 9, 9, 3), a ball of them inside."""
    p = 2 * middles(9) - 1
    r = np.linalg.norm(p, axis=1)
    terms = np.stack([np.exp(-2 * r), p[:, 0] / (0.3 + r), np.ones(9**3)], axis=-1)
    return terms.reshape(9, 9, 9, 3).astype(np.float32), (r < 0.4).reshape(9, 9, 9)


@pytest.mark.parametrize("size", [(5, 4, 6), (9, 9, 9), (12, 7, 9)])
@pytest.mark.parametrize("warp", [0.0, 0.5])
def test_no_volume_fits_better(
    traced: tuple[np.ndarray, np.ndarray], size: tuple[int, int, int], warp: float
) -> None:
    terms, inside = traced
    found = fit(terms, inside, size, warp)
    outside = ~inside.ravel()
    places = occlusion_warp(middles(9)[outside], warp)
    wanted = terms.reshape(-1, 3)[outside]
    error = np.sum(np.square(looked_up(found, places) - wanted), axis=0)
    # All unknowns at once, by the slow and obvious solver
    indices, weights = corners(places, size)
    A = np.zeros((len(places), np.prod(size)))
    np.add.at(A, (np.arange(len(places))[:, None], indices), weights)
    best = np.linalg.lstsq(A, wanted, rcond=1e-6)[0]
    least = np.sum(np.square(A @ best - wanted), axis=0)
    # What holds undecided texels costs a little: measured 1 % and 2e-4 of the sum of squares
    assert np.all(error <= 1.05 * least + 1e-3 * np.sum(np.square(wanted), axis=0))
    assert np.all(error >= least * 0.999 - 1e-6)


def test_a_constant_stays_one_everywhere(traced: tuple[np.ndarray, np.ndarray]) -> None:
    terms, inside = traced
    found = fit(terms, inside, (6, 5, 4), 0.5)
    # Weights sum to one in float32, and texels deep inside keep the first guess
    np.testing.assert_allclose(found[..., 2], 1, atol=1e-5)


def test_nothing_stays_nothing(traced: tuple[np.ndarray, np.ndarray]) -> None:
    terms, inside = traced
    assert np.all(fit(np.zeros_like(terms), inside, (4, 4, 4), 0.5) == 0)


def test_the_inside_has_no_say_where_something_is_known(
    traced: tuple[np.ndarray, np.ndarray],
) -> None:
    terms, inside = traced
    spoilt = np.where(inside[..., None], np.float32(50), terms)
    places = occlusion_warp(middles(9)[~inside.ravel()], 0.5)
    one, two = (looked_up(fit(each, inside, (5, 5, 5), 0.5), places) for each in (terms, spoilt))
    # A thousandth of a voxel's weight, of values a hundred times as large
    assert np.abs(one - two).max() < 0.5


@pytest.mark.parametrize("box", [CUBE, LONG])
@pytest.mark.parametrize(("K", "kib"), [(64, 512), (36, 128), (25, 64), (81, 700), (16, 16)])
def test_grids_take_what_they_may_and_no_more(box: Box, K: int, kib: int) -> None:
    fine, coarse = sizes(box, K, 1024 * kib)
    first, second = (4 * -(-n // 4) for n in split(K))
    taken = first * np.prod(fine) + second * np.prod(coarse)
    assert 0.88 * 1024 * kib < taken <= 1024 * kib
    # Grids of at least ten texels an axis, in whole ones
    assert np.cbrt(np.prod(coarse) / np.prod(fine)) == pytest.approx(0.75, abs=0.1)
    # Longer axes get more, but not in proportion
    long = np.array(fine) / np.array(fine).max()
    half = np.array(box.half_extent) / max(box.half_extent)
    np.testing.assert_allclose(long, half**occlusion_fit.ROUND, atol=0.09)


def test_the_least_grid_is_what_a_lookup_needs() -> None:
    assert sizes(CUBE, 64, 1) == ((2, 2, 2), (2, 2, 2))
    assert split(1) == (1, 0)
    assert all(a % 4 == 0 for a, b in map(split, range(1, 122)) if b)
