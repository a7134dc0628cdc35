"""Hemispherical harmonics: a basis for what a pixel sends to the viewer under lights of a dome.

The zonal argument of spherical harmonics is shifted, so that band l spends all its lobes on the
half-space in front: `P_l^m(2 cos theta - 1)`. Real, orthonormal over the hemisphere about +z, no
Condon-Shortley phase, index `l (l + 1) + m`; `bands` counts l = 0 .. bands - 1.

At the horizon all but the m = 0 functions vanish: a light there has no azimuth left.

References
----------
Gautron, Krivanek, Pattanaik, Bouatouch 2004, A Novel Hemispherical Basis for Accurate and Efficient
Rendering, eq. 6 to 9.
Craven, Wahba 1979, Smoothing Noisy Data with Spline Functions (smoothness penalty, leave-one-out).
"""

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MAX_BANDS = 16
"""Most bands: factorials to 30! and their quotients are exact to rounding."""


@dataclass(frozen=True)
class Fit:
    """A linear, penalised fit of N samples.

    matrix : (K, N), coefficients = matrix @ samples.  hat : (N,) leverage, `diag(basis @ matrix)`.
    condition : of the weighted basis with the penalty's rows.
    """

    matrix: Array
    hat: Array
    condition: float


def evaluate(directions: ArrayLike, bands: int) -> Array:
    """Basis functions at unit directions; those under the horizon count as on it.

    directions : (..., 3), z towards the viewer.  bands : 1 to 16. Returns (..., bands^2). Raises
    ValueError for other shapes and bands.

    >>> (evaluate([0.0, 0.0, 1.0], 2) * np.sqrt(2 * np.pi)).round(6).tolist()
    [1.0, 0.0, 1.732051, 0.0]
    """
    d = np.asarray(directions, np.float64)
    if d.ndim < 1 or d.shape[-1] != 3 or not 1 <= bands <= MAX_BANDS:
        raise ValueError(f"Directions are (..., 3) and bands 1 to {MAX_BANDS}.")
    z = np.clip(d[..., 2], 0.0, 1.0)
    azimuth = np.arctan2(d[..., 1], d[..., 0])
    legendre = _associated_legendre(z, bands)
    basis = np.empty((*d.shape[:-1], bands * bands))
    for (band, m), P in legendre.items():
        ratio = factorial(band - m) / factorial(band + m)
        scaled = np.sqrt((2 * band + 1) * ratio / (2.0 * np.pi) * (1 if m == 0 else 2)) * P
        centre = band * (band + 1)
        basis[..., centre + m] = scaled * np.cos(m * azimuth)
        if m:
            basis[..., centre - m] = scaled * np.sin(m * azimuth)
    return basis


def band_of(bands: int) -> NDArray[np.int64]:
    """Band l of each function: 0, 1, 1, 1, 2, ... Returns (bands^2,).

    >>> band_of(2).tolist()
    [0, 1, 1, 1]
    """
    return np.repeat(np.arange(bands), 2 * np.arange(bands) + 1)


def penalties(bands: int) -> Array:
    """Smoothness penalty of each function: `(l (l + 1))^2`, 1 at the highest band. (bands^2,).

    It is the squared Laplacian of spherical harmonics; the constant is free.

    >>> penalties(3).round(6).tolist()
    [0.0, 0.111111, 0.111111, 0.111111, 1.0, 1.0, 1.0, 1.0, 1.0]
    """
    band = band_of(bands).astype(np.float64)
    top = max(1.0, float(bands * (bands - 1)) ** 2)
    return np.asarray(np.square(band * (band + 1)) / top)


def fit_weights(
    directions: ArrayLike, bands: int, penalty: float, *, sample_weights: ArrayLike | None = None
) -> Fit:
    """Make the matrix that turns samples under N lights into coefficients, by one SVD.

    It minimises `sum_n w_n (x_n - sum_k c_k H_k(d_n))^2 + penalty N sum_k p_k c_k^2`, with p of
    `penalties` and the weights scaled to a mean of 1. Where the lights do not determine a function,
    and penalty = 0, the solution of least norm.

    directions : (N, 3) unit.  penalty : >= 0, a fraction of the light count.  sample_weights : (N,)
    >= 0, not all 0; a weight of 0 leaves a sample out. Raises ValueError otherwise.
    """
    basis, w = _checked(directions, bands, penalty, sample_weights)
    root = np.sqrt(w)
    smooth = np.sqrt(penalty * len(basis) * penalties(bands))
    rows = np.vstack([root[:, None] * basis, np.diag(smooth)[smooth > 0]])
    U, s, Vt = np.linalg.svd(rows, full_matrices=False)
    # Numerical rank: Golub, Van Loan 2013, Matrix Computations, 5.5
    kept = s > max(rows.shape) * np.finfo(np.float64).eps * s[0]
    inverse = (Vt[kept].T / s[kept]) @ U[: len(basis), kept].T
    matrix = inverse * root
    full = bool(kept.all()) and len(s) == bands * bands
    condition = float(s[0] / s[-1]) if full else float(np.inf)
    return Fit(matrix, np.einsum("nk,kn->n", basis, matrix), condition)


def fit_each(
    samples: ArrayLike,
    directions: ArrayLike,
    bands: int,
    penalty: float,
    sample_weights: ArrayLike,
) -> Array:
    """Fit records that each have weights of their own: coefficients (R, K, C).

    The problem of `fit_weights` by its normal equations, all records at once. They square the
    condition, so the penalty must be above 0.

    samples : (R, N, C).  sample_weights : (R, N) > 0. Raises ValueError otherwise.
    """
    x = np.asarray(samples, np.float64)
    basis, w, normal = _normal_equations(directions, bands, penalty, sample_weights)
    if x.ndim != 3 or x.shape[:2] != w.shape:
        raise ValueError("Samples are (R, N, C), as many as there are weights.")
    return np.asarray(np.linalg.solve(normal, np.matmul(basis.T, w[..., None] * x)), np.float64)


def hats_each(
    directions: ArrayLike, bands: int, penalty: float, sample_weights: ArrayLike
) -> Array:
    """Leverages (R, N) of the fits of `fit_each`: the share of a sample in its own fitted value.

    A fit made without sample n would miss it by `residual / (1 - hat_n)`: no refitting.
    """
    basis, w, normal = _normal_equations(directions, bands, penalty, sample_weights)
    share = np.matmul(basis, np.linalg.inv(normal))
    return np.asarray(w * np.einsum("rnk,nk->rn", share, basis))


def _normal_equations(
    directions: ArrayLike, bands: int, penalty: float, sample_weights: ArrayLike
) -> tuple[Array, Array, Array]:
    """Basis (N, K), weights (R, N) of mean 1 and normal matrices (R, K, K)."""
    basis, _ = _checked(directions, bands, penalty, None)
    w = np.asarray(sample_weights, np.float64)
    if not penalty > 0:
        raise ValueError("Records with weights of their own need a penalty above 0.")
    if w.ndim != 2 or w.shape[1] != len(basis) or not np.all((w > 0) & np.isfinite(w)):
        raise ValueError("Weights of records are (R, N), finite and above 0, N one a light.")
    w = w / np.mean(w, axis=1, keepdims=True)
    K = bands * bands
    # The products of all pairs of functions make all normal matrices one product
    pairs = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), K * K)
    normal = (w @ pairs).reshape(-1, K, K)
    normal += np.diag(penalty * len(basis) * penalties(bands))
    return basis, w, normal


def _associated_legendre(z: Array, bands: int) -> dict[tuple[int, int], Array]:
    """P_l^m(2 z - 1) for 0 <= m <= l < bands, without the phase (-1)^m."""
    t, sine = 2.0 * z - 1.0, 2.0 * np.sqrt(z * (1.0 - z))
    P: dict[tuple[int, int], Array] = {(0, 0): np.ones_like(t)}
    for m in range(bands):
        if m:
            P[m, m] = (2 * m - 1) * sine * P[m - 1, m - 1]
        if m + 1 < bands:
            P[m + 1, m] = (2 * m + 1) * t * P[m, m]
        for band in range(m + 2, bands):
            upper, lower = (2 * band - 1) * t * P[band - 1, m], (band + m - 1) * P[band - 2, m]
            P[band, m] = (upper - lower) / (band - m)
    return P


def _checked(
    directions: ArrayLike, bands: int, penalty: float, sample_weights: ArrayLike | None
) -> tuple[Array, Array]:
    d = np.asarray(directions, np.float64)
    if d.ndim != 2 or not len(d) or not np.all(np.isfinite(d)):
        raise ValueError("A fit needs a list of one or more finite directions.")
    w = np.ones(len(d)) if sample_weights is None else np.asarray(sample_weights, np.float64)
    if w.shape != d.shape[:1] or not np.all((w >= 0) & np.isfinite(w)) or not np.any(w > 0):
        raise ValueError("Weights of a fit are one finite number >= 0 a light, not all 0.")
    if not 0 <= penalty < np.inf:
        raise ValueError("The penalty of a fit is a finite number >= 0.")
    return evaluate(d, bands), w / np.mean(w)
