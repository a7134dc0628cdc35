"""Measures of error, by hand."""

import math

import numpy as np
import pytest

from maths.image_error import psnr, rmse, ssim


def test_rmse_by_hand() -> None:
    assert rmse([[1.0, 2.0], [3.0, 4.0]], [[1.0, 2.0], [3.0, 8.0]]) == 2.0
    assert rmse([1.0, 5.0], [0.0, 0.0], weights=[1.0, 0.0]) == 1.0
    assert math.isclose(rmse([1.0, 5.0], [0.0, 0.0], weights=[3.0, 1.0]), math.sqrt(7.0))


def test_rmse_of_bytes_does_not_wrap() -> None:
    assert rmse(np.uint8([0]), np.uint8([255])) == 255.0


def test_psnr_by_hand() -> None:
    assert math.isclose(psnr([0.5], [0.4]), 20.0, rel_tol=1e-14)
    assert math.isclose(psnr([255.0], [0.0], peak=255.0), 0.0, abs_tol=1e-14)
    assert psnr([0.5], [0.5]) == math.inf


def test_ssim_is_one_for_equal_pictures_and_falls(rng: np.random.Generator) -> None:
    truth = rng.uniform(size=(32, 40, 3))
    assert ssim(truth, truth) == 1.0
    little = ssim(np.clip(truth + 0.02, 0, 1), truth)
    much = ssim(rng.permutation(truth), truth)
    assert 1 > little > 0.9 > much
    assert ssim(truth[..., 0], truth[..., 0]) == 1.0


@pytest.mark.parametrize(
    ("a", "b"), [([1.0], [1.0, 2.0]), ([], []), ([np.nan], [1.0]), ([1.0], [np.inf])]
)
def test_pictures_that_do_not_compare_are_refused(a: list[float], b: list[float]) -> None:
    for measure in (rmse, psnr, ssim):
        with pytest.raises(ValueError, match="compare"):
            measure(a, b)


def test_other_bad_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="peak"):
        psnr([1.0], [0.0], peak=0.0)
    with pytest.raises(ValueError, match="Weights"):
        rmse([1.0], [0.0], weights=[0.0])
    with pytest.raises(ValueError, match="11 x 11"):
        ssim(np.zeros((8, 30)), np.zeros((8, 30)))
