"""Bloom neither adds nor loses light, is as wide as said, and does not flicker."""

import numpy as np
import pytest
from numpy.typing import NDArray

from maths import bloom

Array = NDArray[np.float64]
SIDE = 256


def point(column: int, row: int) -> Array:
    picture = np.zeros((SIDE, SIDE))
    picture[row, column] = 1.0
    return picture


def alone(level: int) -> Array:
    return np.append(np.zeros(level - 1), 1.0)


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (64, 36), (33, 70)])
@pytest.mark.parametrize("radius", [0.1, 3.0, 40.0])
def test_a_constant_picture_stays_as_it_is(size: tuple[int, int], radius: float) -> None:
    even = np.full((*size, 3), [0.3, 1.0, 7.0])
    # A few roundings of double precision
    np.testing.assert_allclose(bloom.bloom(even, 0.8, 0.0, radius), even, rtol=1e-14)
    np.testing.assert_allclose(bloom.bloom(even, 0.8, 0.5, radius), even, rtol=1e-14)


@pytest.mark.parametrize("threshold", [0.0, 2.0])
def test_light_is_neither_added_nor_lost(threshold: float, rng: np.random.Generator) -> None:
    picture = np.zeros((SIDE, SIDE, 3))
    # The widest level of this radius, 31 texels along an axis, does not reach the border
    picture[124:132, 124:132] = rng.uniform(0.0, 9.0, (8, 8, 3))
    spread = bloom.bloom(picture, 0.7, threshold, np.sqrt(4.0**3 - 1))
    np.testing.assert_allclose(spread.sum(axis=(0, 1)), picture.sum(axis=(0, 1)), rtol=1e-13)
    assert spread.max() < 0.9 * picture.max()
    assert spread.min() >= 0.0


@pytest.mark.parametrize("level", [1, 2, 3, 4])
def test_a_level_has_its_variance_wherever_the_light_lies(
    level: int, rng: np.random.Generator
) -> None:
    places = np.arange(SIDE)
    for column, row in rng.integers(100, 156, (6, 2)):
        found = bloom.spread(point(column, row), alone(level))
        assert found.sum() == pytest.approx(1.0, rel=1e-13)
        for axis, at in ((0, column), (1, row)):
            along = found.sum(axis=axis)
            # Sums of 256 products of numbers up to 256^2
            assert along @ (places - at) == pytest.approx(0.0, abs=1e-9)
            assert along @ (places - at) ** 2 == pytest.approx(4.0**level - 1.0, rel=1e-9)


@pytest.mark.parametrize(("level", "most"), [(1, 0.06), (2, 0.018), (3, 0.013), (4, 0.012)])
def test_moving_light_does_not_flicker(level: int, most: float, rng: np.random.Generator) -> None:
    """Where among the texels of a coarse level a light lies is not seen.

    most : measured 0.057, 0.018, 0.012, 0.011 of the peak from the mean of all places.
    """
    pictures = []
    for column, row in rng.integers(0, 2**level, (24, 2)):
        found = bloom.spread(point(120 + column, 120 + row), alone(level))
        pictures.append(np.roll(found, (-row, -column), (0, 1)))
    mean = np.mean(pictures, axis=0)
    assert np.abs(np.array(pictures) - mean).max() < most * mean.max()


def test_a_light_that_slides_between_pixels_keeps_its_glow(rng: np.random.Generator) -> None:
    """All octaves together, of lights that two or four pixels share by where they lie."""
    share, glows = bloom.weights(20.0), []
    for x, y in rng.uniform(0.0, 32.0, (24, 2)):
        (column, dx), (row, dy) = divmod(x, 1.0), divmod(y, 1.0)
        picture = np.zeros((SIDE, SIDE))
        corner = slice(112 + int(row), 114 + int(row)), slice(112 + int(column), 114 + int(column))
        picture[corner] = np.outer([1 - dy, dy], [1 - dx, dx])
        found = bloom.spread(picture, share)
        assert found.sum() == pytest.approx(1.0, rel=1e-13)
        # Smooth rings: which pixels they hold does not jump
        far = np.hypot(*(np.mgrid[:SIDE, :SIDE] - np.array([112 + y, 112 + x])[:, None, None]))
        glows.append([(found * np.exp(-(((far - r) / 3) ** 2))).sum() for r in (10.0, 20.0, 40.0)])
    # Measured 0.0066, 0.0097 and, where a hundredth of the light is left, 0.035 from least to most
    assert (np.ptp(glows, axis=0) < np.array([0.007, 0.011, 0.04]) * np.mean(glows, axis=0)).all()


def test_weights_sum_to_one_and_never_jump() -> None:
    radii = np.geomspace(0.5, 600.0, 4000)
    found = np.zeros((len(radii), 12))
    for i, radius in enumerate(radii):
        share = bloom.weights(radius)
        found[i, : len(share)] = share
        assert share.sum() == pytest.approx(1.0, rel=1e-14)
    assert (found >= 0.0).all()
    # A step of these is 0.26 % of an octave of radius, over which a weight changes by less than 1
    assert np.abs(np.diff(found, axis=0)).max() < 0.0026
    assert len(bloom.weights(np.sqrt(4.0**5 - 1))) == 5
    assert bloom.weights(0.0).tolist() == [1.0]


def test_mixtures_make_the_weights() -> None:
    share = bloom.weights(50.0)
    left, found = 1.0, []
    for mixture in bloom.mixtures(share):
        found.append(left * (1.0 - mixture))
        left *= mixture
    np.testing.assert_allclose(found, share, rtol=1e-14)


def test_only_what_is_over_the_threshold_is_spread() -> None:
    picture = np.zeros((64, 64, 3))
    picture[32, 32] = [3.0, 1.5, 0.0]
    picture[10, 10] = 0.9
    found = bloom.bloom(picture, 0.5, 1.0, 4.0)
    # Two thirds of it lie over; half of that leaves, and some comes back
    left = found[32, 32] / picture[32, 32, :].clip(1e-9)
    assert 1 - 0.5 * 2 / 3 < left[0] < 1.0
    assert left[0] == pytest.approx(left[1], rel=1e-12)
    assert found[10, 10].max() == pytest.approx(0.9, abs=1e-3)
    dim = np.full((8, 8, 3), 0.9)
    np.testing.assert_array_equal(bloom.bloom(dim, 0.5, 1.0, 4.0), dim)


def test_more_lines_show_the_same_picture() -> None:
    """The light within a radius, of a picture of 128 and of 256 lines."""
    found = []
    for side in (128, 256):
        picture = np.zeros((side, side))
        picture[side // 2 - side // 64 : side // 2, side // 2 - side // 64 : side // 2] = 1.0
        spread = bloom.spread(picture, bloom.weights(0.08 * side))
        y, x = (np.mgrid[:side, :side] + 0.5) / side - (0.5 - 1 / 128)
        far = np.hypot(x, y)
        found.append([spread[far < r].sum() / picture.sum() for r in (0.03, 0.06, 0.12, 0.24)])
    # Measured 0.050: what the coarser picture cannot keep within its finest octave
    np.testing.assert_allclose(found[0], found[1], atol=0.06)
