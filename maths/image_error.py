"""How far two pictures are apart: RMSE, PSNR, SSIM.

References
----------
Wang, Bovik, Sheikh, Simoncelli 2004, Image Quality Assessment: From Error Visibility to Structural
Similarity.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def rmse(image: ArrayLike, truth: ArrayLike, weights: ArrayLike | None = None) -> float:
    """Root of the mean square difference over all elements.

    image, truth : one shape, not empty, finite.  weights : broadcast against them, >= 0, not all 0.
    Raises ValueError otherwise.

    >>> rmse([0.0, 0.0], [3.0, 4.0]) == (12.5 ** 0.5)
    True
    """
    a, b = _pair(image, truth)
    square = np.square(a - b)
    if weights is None:
        return float(np.sqrt(np.mean(square)))
    w = np.broadcast_to(np.asarray(weights, np.float64), square.shape)
    if not (np.all(w >= 0) and np.any(w > 0)):
        raise ValueError("Weights of an error are 0 or more, and not all 0.")
    return float(np.sqrt(np.sum(w * square) / np.sum(w)))


def psnr(
    image: ArrayLike, truth: ArrayLike, peak: float = 1.0, weights: ArrayLike | None = None
) -> float:
    """Peak signal to noise ratio, decibels: `20 log10(peak / rmse)`; infinite for equal pictures.

    Arguments and errors as `rmse`; peak > 0 is the largest value a picture can have.

    >>> round(psnr([0.1], [0.0]), 9)
    20.0
    """
    if not peak > 0:
        raise ValueError("The peak of a picture is above 0.")
    error = rmse(image, truth, weights)
    return math.inf if error == 0 else 20.0 * math.log10(peak / error)


def ssim(image: ArrayLike, truth: ArrayLike, peak: float = 1.0) -> float:
    """Mean structural similarity, at most 1, with the Gaussian window of Wang et al. 2004.

    image, truth : (h, w) or (h, w, c), at least 11 x 11, finite. Raises ValueError otherwise.
    """
    from skimage import metrics

    a, b = _pair(image, truth)
    if a.ndim not in (2, 3) or min(a.shape[:2]) < 11:
        raise ValueError("Similarity needs pictures of at least 11 x 11 pixels.")
    return float(
        metrics.structural_similarity(  # type: ignore[no-untyped-call, unused-ignore]
            a,
            b,
            data_range=peak,
            channel_axis=2 if a.ndim == 3 else None,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
        )
    )


def _pair(image: ArrayLike, truth: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    a, b = np.asarray(image, np.float64), np.asarray(truth, np.float64)
    if a.shape != b.shape or a.size == 0:
        raise ValueError(f"Pictures to compare have one shape, not {a.shape} and {b.shape}.")
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))):
        raise ValueError("Pictures to compare are finite.")
    return a, b
