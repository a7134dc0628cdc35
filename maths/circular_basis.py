"""The circular basis: evaluation, rotation, energy and the sum that relights."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def harmonic_of(terms: int) -> NDArray[np.int64]:
    """Harmonic h of each term: 0, 1, 1, 2, 2, ...

    terms : K = 2H + 1, odd. Returns (K,). Raises ValueError for K that is even or under 1.

    >>> harmonic_of(5).tolist()
    [0, 1, 1, 2, 2]
    """
    if terms < 1 or terms % 2 == 0:
        raise ValueError(
            f"Circular harmonics come in odd numbers of terms, 1 or more, not {terms}."
        )
    return np.asarray((np.arange(terms) + 1) // 2, np.int64)


def evaluate(t: ArrayLike, terms: int) -> NDArray[np.float64]:
    """Basis functions `1/sqrt(2 pi), sin t/sqrt(pi), cos t/sqrt(pi), sin 2t/sqrt(pi), ...` at t.

    t : (...) radians.  terms : K, odd. Returns (..., K). Raises ValueError for bad K.

    >>> (evaluate(0.0, 3) * np.sqrt(np.pi)).round(6).tolist()
    [0.707107, 0.0, 1.0]
    """
    harmonics = harmonic_of(terms)[1::2]
    angles = np.asarray(t, np.float64)[..., None] * harmonics
    basis = np.empty((*angles.shape[:-1], terms))
    basis[..., 0] = 1.0 / np.sqrt(2.0 * np.pi)
    basis[..., 1::2] = np.sin(angles) / np.sqrt(np.pi)
    basis[..., 2::2] = np.cos(angles) / np.sqrt(np.pi)
    return basis


def reconstruct(Y: ArrayLike, t: ArrayLike) -> NDArray[np.float64]:
    """Sum of the series at angles, not clamped: `X(t) = sum_k Y_k B_k(t)`.

    Y : (..., K).  t : (M,) radians. Returns (..., M).

    >>> reconstruct([np.sqrt(2 * np.pi), 0.0, 0.0], [0.0, 1.0]).round(12).tolist()
    [1.0, 1.0]
    """
    coefficients = np.asarray(Y, np.float64)
    return np.asarray(coefficients @ evaluate(t, coefficients.shape[-1]).T)


def relight(Y: ArrayLike, L: ArrayLike, axis: int = -2) -> NDArray[np.float64]:
    """Radiance under lights, `max(0, sum_k Y_k L_k)` a channel; the clamp comes after the sum.

    Y : (..., K, C) transfer of each pixel, or with its terms on another `axis` (C always last).
    L : (..., K, C) coefficients of the lights, broadcast against Y. Returns (..., C).

    >>> relight([[1.0], [0.5], [0.0]], [[2.0], [-1.0], [9.0]]).tolist()
    [1.5]
    """
    transfer = np.moveaxis(np.asarray(Y, np.float64), axis, -2)
    total = np.einsum("...kc,...kc->...c", transfer, np.asarray(L, np.float64))
    return np.asarray(np.maximum(0.0, total))


def rotate(Y: ArrayLike, delta: float, axis: int = -1) -> NDArray[np.float64]:
    """Coefficients of `X(t - delta)`: the signal turned by delta, counter-clockwise in t. Exact.

    Y : (..., K, ...) with its terms on `axis`.  delta : radians. Returns the shape of Y.

    >>> rotate([0.0, 0.0, 1.0], np.pi / 2).round(12).tolist()  # cos t -> cos(t - pi/2) = sin t
    [0.0, 1.0, 0.0]
    """
    source = np.moveaxis(np.asarray(Y, np.float64), axis, -1)
    angles = harmonic_of(source.shape[-1])[1::2] * delta
    c, s = np.cos(angles), np.sin(angles)
    turned = source.copy()
    turned[..., 1::2] = c * source[..., 1::2] + s * source[..., 2::2]
    turned[..., 2::2] = c * source[..., 2::2] - s * source[..., 1::2]
    return np.asarray(np.moveaxis(turned, -1, axis))


def truncation_rms(mean_square: ArrayLike, Y: ArrayLike, axis: int = -1) -> NDArray[np.float64]:
    """RMS over the circle of what K terms leave out (Parseval): `sqrt(mean X^2 - sum Y^2 / 2 pi)`.

    mean_square : (...) mean of X^2 over the circle.  Y : true coefficients, terms on `axis`.
    Returns (...), 0 where rounding makes the difference negative.

    >>> float(truncation_rms(0.5, [0.0, 0.0, 0.0]).round(6))
    0.707107
    """
    kept = np.sum(np.square(np.asarray(Y, np.float64)), axis=axis) / (2.0 * np.pi)
    return np.asarray(np.sqrt(np.maximum(0.0, np.asarray(mean_square, np.float64) - kept)))
