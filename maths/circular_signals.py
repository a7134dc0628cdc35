"""Signals on the circle whose coefficients are known in closed form, and how sampling folds them.

They are the truth of tests and studies, and the prior of `circular_fit.predicted_error`. Each was
checked against adaptive quadrature. Coefficients are those of the basis of `circular_basis`.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.circular_basis import harmonic_of


def lambert_lobe(terms: int) -> NDArray[np.float64]:
    """Coefficients of `max(0, cos t)`; odd harmonics above 1 are 0. Returns (K,).

    `c0 = 1/pi, c1 = 1/2, c_2h = 2 (-1)^(h+1) / (pi (4 h^2 - 1))` in front of cosines.

    >>> (lambert_lobe(5)[[2, 4]] / np.sqrt(np.pi)).round(6).tolist()
    [0.5, 0.212207]
    """
    h = np.arange(len(harmonic_of(terms)) // 2 + 1)
    even = 2.0 * np.where(h % 4 == 0, -1.0, 1.0) / (np.pi * (h * h - 1.0 + 2.0 * (h == 1)))
    cosines = np.where(h % 2 == 0, even, 0.0)
    cosines[0] = 1.0 / np.pi
    cosines[1:2] = 0.5
    return _from_cosines(cosines)


def tilted_lambert(A: float, B: float, terms: int) -> NDArray[np.float64]:
    """Coefficients of `max(0, A + B cos t)`: a normal n under a ring at elevation e.

    A = n_z sin e, B = sqrt(1 - n_z^2) cos e >= 0, n_z the normal's cosine from the axis. Returns
    (K,).
    Raises ValueError for B < 0.

    >>> (tilted_lambert(2.0, 1.0, 3) / np.sqrt(np.pi)).round(6).tolist()  # never clamped
    [2.828427, 0.0, 1.0]
    """
    if not B >= 0:
        raise ValueError("The amplitude of a tilted Lambert lobe is 0 or more.")
    h = np.arange(len(harmonic_of(terms)) // 2 + 1)
    if A <= -B:
        return np.zeros(terms)
    edge = np.pi if A >= B else np.arccos(-A / B)
    cosines = (2.0 / np.pi) * (
        A * _sine_over(h, edge) + 0.5 * B * (_sine_over(h - 1, edge) + _sine_over(h + 1, edge))
    )
    cosines[0] /= 2.0
    return _from_cosines(cosines)


def shadow_arc(half_width: float, terms: int) -> NDArray[np.float64]:
    """Coefficients of the step that is 1 for |t| < half_width, else 0. Returns (K,).

    half_width : radians in [0, pi].

    >>> (shadow_arc(np.pi / 2, 3) / np.sqrt(np.pi)).round(6).tolist()
    [0.707107, 0.0, 0.63662]
    """
    h = np.arange(len(harmonic_of(terms)) // 2 + 1)
    cosines = 2.0 * _sine_over(h, half_width) / np.pi
    cosines[0] /= 2.0
    return _from_cosines(cosines)


def alias_series(Y: ArrayLike, lights: int, terms: int, start: float = 0.0) -> NDArray[np.float64]:
    """What evenly spaced lights measure: harmonic m lands on k where m = k or -k modulo N.

    Y : (J,) true coefficients, J odd and as many as matter.  lights : N, at `start + 2 pi n / N`.
    terms : K of the answer. Returns (K,), equal to Y[:K] iff the signal has no harmonic >= N - H.

    >>> Y = np.zeros(9); Y[8] = 1.0  # cos 4t seen by five lights is cos t
    >>> (alias_series(Y, 5, 3).round(12) + 0.0).tolist()
    [0.0, 0.0, 1.0]
    """
    true = np.asarray(Y, np.float64)
    # X = sum over all integers m of z_m exp(i m t)
    top = len(true) // 2
    half = (true[2::2] - 1j * true[1::2]) / (2.0 * np.sqrt(np.pi))
    z = np.concatenate([half[::-1].conj(), [true[0] / np.sqrt(2.0 * np.pi)], half])
    m = np.arange(-top, top + 1)
    # Fold each harmonic on to the ones that it cannot be told from
    order = len(harmonic_of(terms)) // 2
    folded = np.array(
        [
            np.sum((z * np.exp(1j * (m - k) * start))[(m - k) % lights == 0])
            for k in range(order + 1)
        ]
    )
    answer = np.empty(terms)
    answer[0] = np.sqrt(2.0 * np.pi) * folded[0].real
    answer[1::2] = -2.0 * np.sqrt(np.pi) * folded[1:].imag
    answer[2::2] = 2.0 * np.sqrt(np.pi) * folded[1:].real
    return answer


def _sine_over(j: NDArray[np.int64], edge: float) -> NDArray[np.float64]:
    """Return sin(j edge) / j, and its limit `edge` for j = 0."""
    return np.where(j == 0, edge, np.sin(j * edge) / np.where(j == 0, 1, j))


def _from_cosines(cosines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of `sum_h c_h cos(h t)` in the orthonormal basis."""
    Y = np.zeros(2 * len(cosines) - 1)
    Y[0] = np.sqrt(2.0 * np.pi) * cosines[0]
    Y[2::2] = np.sqrt(np.pi) * cosines[1:]
    return Y
