"""From N lights on a ring to coefficients: quadrature where they are even, least squares elsewhere.

The fit is one matrix for all pixels, `Y = matrix @ X`. Gates keep it stable: the order falls where
the lights cannot tell harmonics apart, a little smoothness is added where they hardly can, and each
of these leaves a warning.

References
----------
Golub, Van Loan 2013, Matrix Computations, 5.5 (least squares by SVD; numerical rank).
Craven, Wahba 1979, Smoothing Noisy Data with Spline Functions (smoothness penalty, leave-one-out).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.circular_basis import evaluate, harmonic_of
from maths.circular_signals import lambert_lobe

# Measured: Lambert lobes of every azimuth, 16 even lights less an arc, order 2. RMS error over the
# circle # without the arc .034. Gap, condition, error: 135 deg 4.7 .041; 158 7.7 .086; 180 13.5
# .21; 202 26 .38; # 225 54 .67; 247 131 1.27 (the lobe's own RMS is .5). So up to 10 least squares
# is trusted, to 100 # it is helped, and over 100 it adds more than it finds.
CONDITION_RIDGE = 10.0
CONDITION_DROP = 100.0
# From a gap of half the circle on a lobe can hide, and the condition does not say so (202 deg: 26).
GAP_DROP = np.pi
# Best or next to best of (0, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2) from 180 to 270 deg in that measurement:
# .16 .22 .26 .31 .34 for .21 .38 .67 1.27 3.0 without. It shrinks harmonic h of even lights by
# 1 / (1 + 2 ridge h^2): 2.3 % at h = 2.
RIDGE = 3e-3
SAME_ANGLE = 1e-9  # rad; nearer ones are one azimuth. An arc second is 5e-6.
NEGLIGIBLE = 1e-6  # of the mean weight; its root, 1/1000, can fill no gap within CONDITION_DROP
EVEN = 1e-12  # rad; 3 orders above the rounding of 2 pi n / N, and the error of treating it as 0


@dataclass(frozen=True)
class Fit:
    """A linear fit of N samples, and how far to trust it.

    matrix : (K, N), `Y = matrix @ X`; rows of terms that were dropped are 0.  angles, gains : (N,)
        as given.
    terms : K in use, at most the K asked for.  condition : of the weighted basis in use.
    largest_gap : rad between neighbouring azimuths.  hat : (N,) leverage, `diag(B matrix)`.
    method : "quadrature" | "least_squares" | "ridge".
    """

    matrix: NDArray[np.float64]
    angles: NDArray[np.float64]
    gains: NDArray[np.float64]
    terms: int
    condition: float
    largest_gap: float
    hat: NDArray[np.float64]
    warnings: tuple[str, ...]
    method: str


def fit_weights(
    angles: ArrayLike,
    terms: int,
    *,
    sample_weights: ArrayLike | None = None,
    ridge: float = 0.0,
    gains: ArrayLike | None = None,
) -> Fit:
    """Make the matrix that turns samples X(t_n) into coefficients `Y_k = integral X B_k dt`.

    angles : (N,) azimuths of the lights, radians, any order, N >= 1.  terms : K wanted, odd.
    sample_weights : (N,) >= 0, not all 0; a weight of 0 leaves a sample out (clipped, in shadow).
    ridge : smoothness, >= 0: adds `ridge N sum_h h^2 c_h^2` in front of cosines and sines; the
        constant is never penalised, so that a constant signal stays exact.
    gains : (N,) in [0, 1], for lights off the ring: g = min(1, s / s0) of `circular_lights`;
        harmonic h of a light counts g^h, so that one on the axis (g = 0) only tells about the
        constant.
    Raises ValueError for input that is none.

    >>> fit_weights(2 * np.pi * np.arange(8) / 8, 5).method
    'quadrature'
    >>> fit_weights([0.0, 2.0, 4.0], 5).terms  # three lights: a constant and one harmonic
    3
    """
    t, w, g = _checked(angles, sample_weights, ridge, gains)
    harmonics = harmonic_of(terms)
    warnings: list[str] = []
    # Reduce the order to what as many azimuths can tell apart
    gap, azimuths = _largest_gap(t[(w > NEGLIGIBLE) & (g > 0)])
    order = min(int(harmonics[-1]), max(0, (azimuths - 1) // 2))
    if order < harmonics[-1]:
        warnings.append(f"{azimuths} distinct azimuths carry {2 * order + 1} terms, not {terms}")
    design = np.sqrt(w)[:, None] * evaluate(t, terms) * g[:, None] ** harmonics
    # Reduce it further where a gap hides what a harmonic does, or the samples nearly do not
    # determine it
    order, reasons = _gated_order(design, order, gap)
    warnings += reasons
    K = 2 * order + 1
    condition = _condition(design[:, :K])
    strength = ridge
    if order and (condition > CONDITION_RIDGE or gap > GAP_DROP + SAME_ANGLE):
        strength = max(ridge, RIDGE)
        warnings.append(f"condition {condition:.3g}, gap {np.degrees(gap):.0f} deg: smoothed")
    if g.min() < 0.99:
        # Harmonic h of a light off the ring is off by up to 1 - g: judge by what is left over
        warnings.append(f"lights leave the ring (smallest gain {g.min():.2f}): see the residual")
    spread = azimuths == len(t) and gap - 2 * np.pi / azimuths < EVEN
    if spread and strength == 0 and np.all(w == w[0]) and np.all(g == 1):
        method, top = "quadrature", evaluate(t, K).T * (2.0 * np.pi / len(t))
    else:
        method = "ridge" if strength > 0 else "least_squares"
        top = _solve(design[:, :K], harmonics[:K], strength) * np.sqrt(w)
    matrix = np.zeros((terms, len(t)))
    matrix[:K] = top
    hat = np.sum(matrix.T * evaluate(t, terms) * g[:, None] ** harmonics, axis=-1)
    return Fit(matrix, t, g, K, condition, gap, hat, tuple(warnings), method)


def leave_one_out(residuals: ArrayLike, hat: ArrayLike, axis: int = -1) -> NDArray[np.float64]:
    """Error at each sample of the fit made without it, `r_n / (1 - hat_n)`: exact, no refitting.

    For quadrature it is that of least squares too, to which it is equal; where ridge or the gates
    depend on N it holds the ridge and the order fixed. Where a sample alone determines a term (hat
    = 1, as with N = K) nothing can be held out: infinite.

    residuals : X - (values of the fit at the samples), samples on `axis`.  hat : (N,).
    Returns the shape of residuals.

    >>> leave_one_out([0.5, 0.5], [0.5, 1.0]).tolist()
    [1.0, inf]
    """
    left = np.moveaxis(np.asarray(residuals, np.float64), axis, -1)
    share = 1.0 - np.asarray(hat, np.float64)
    # 1e-9: a residual has a rounding of 1e-16, which would fill 7 digits of the quotient
    free = share > 1e-9
    error = np.where(free, left / np.where(free, share, 1.0), np.inf)
    return np.asarray(np.moveaxis(error, -1, axis))


def noise_gain(fit: Fit) -> NDArray[np.float64]:
    """Standard deviation of each coefficient under independent unit noise of the samples.

    Even lights: `sqrt(2 pi / N)` for every term. Returns (K,).

    >>> noise_gain(fit_weights(2 * np.pi * np.arange(8) / 8, 3)).round(6).tolist()
    [0.886227, 0.886227, 0.886227]
    """
    return np.asarray(np.sqrt(np.sum(fit.matrix**2, axis=-1)))


def predicted_error(fit: Fit, noise: float = 0.0, harmonics: int = 64) -> float:
    """RMS error over the circle to expect for a Lambert lobe of unit height and unknown azimuth.

    Aliasing, terms left out, smoothing and gaps all count, which residuals do not see. It is the
    mean over all azimuths of the lobe, so that no direction flatters the fit.

    noise : standard deviation of independent noise of the samples.  harmonics : of the lobe.

    >>> even = fit_weights(2 * np.pi * np.arange(16) / 16, 5)
    >>> round(predicted_error(even), 4)  # 5 terms leave out .0341, the rest is what folds back
    0.0343
    """
    J = 2 * harmonics + 1
    lobe = lambert_lobe(J)
    # A random azimuth spreads the energy of a harmonic evenly over its sine and cosine
    energy = lobe**2
    energy[1::2] = energy[2::2] = 0.5 * (energy[1::2] + energy[2::2])
    error = -np.eye(J)
    error[: len(fit.matrix)] += fit.matrix @ (
        evaluate(fit.angles, J) * fit.gains[:, None] ** harmonic_of(J)
    )
    variance = float(np.sum(error**2 @ energy)) + noise**2 * float(np.sum(fit.matrix**2))
    return float(np.sqrt(variance / (2.0 * np.pi)))


def _checked(
    angles: ArrayLike, sample_weights: ArrayLike | None, ridge: float, gains: ArrayLike | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    t = np.asarray(angles, np.float64)
    if t.ndim != 1 or len(t) == 0 or not np.all(np.isfinite(t)):
        raise ValueError("A fit needs a list of one or more finite azimuths.")
    w = np.ones(len(t)) if sample_weights is None else np.asarray(sample_weights, np.float64)
    if w.shape != t.shape or not np.all((w >= 0) & np.isfinite(w)) or not np.any(w > 0):
        raise ValueError("Weights of a fit are one finite number >= 0 a light, not all 0.")
    g = np.ones(len(t)) if gains is None else np.asarray(gains, np.float64)
    if g.shape != t.shape or not np.all((g >= 0) & (g <= 1)):
        raise ValueError("Gains of a fit are one number from 0 to 1 a light.")
    if not (0 <= ridge < np.inf):
        raise ValueError("The ridge of a fit is a finite number >= 0.")
    # Mean weight 1, so that a ridge means the same for all weights; by the largest first, for 1e300
    w = w / w.max()
    return t, w / np.mean(w), g


def _largest_gap(t: NDArray[np.float64]) -> tuple[float, int]:
    """Largest angle between neighbours, and the number of distinct azimuths."""
    if len(t) == 0:
        return 2.0 * np.pi, 0
    around = np.sort(np.mod(t, 2.0 * np.pi))
    gaps = np.diff(around, append=around[0] + 2.0 * np.pi)
    return float(gaps.max()), max(1, int(np.sum(gaps > SAME_ANGLE)))


def _condition(design: NDArray[np.float64]) -> float:
    """Ratio of the singular values; infinite where the rank is not full (Golub, Van Loan 5.5)."""
    s = np.linalg.svd(design, compute_uv=False)
    if len(s) < design.shape[1] or s[-1] <= max(design.shape) * np.finfo(np.float64).eps * s[0]:
        return float(np.inf)
    return float(s[0] / s[-1])


def _gated_order(design: NDArray[np.float64], order: int, gap: float) -> tuple[int, list[str]]:
    reasons = []
    if gap > GAP_DROP + SAME_ANGLE and order > 0:
        order -= 1
        while order > 0 and _condition(design[:, : 2 * order + 1]) > CONDITION_RIDGE:
            order -= 1
        reasons.append(f"a gap of {np.degrees(gap):.0f} deg leaves {2 * order + 1} terms")
    while order > 0 and (condition := _condition(design[:, : 2 * order + 1])) > CONDITION_DROP:
        order -= 1
        reasons.append(f"condition {condition:.3g} leaves {2 * order + 1} terms")
    return order, reasons


def _solve(
    design: NDArray[np.float64], harmonics: NDArray[np.int64], ridge: float
) -> NDArray[np.float64]:
    """Pseudo-inverse (K, N) of the design with the smoothness penalty as extra rows, by SVD."""
    penalty = np.sqrt(ridge * len(design) / np.pi) * harmonics
    rows = np.vstack([design, np.diag(penalty)[penalty > 0]])
    return np.asarray(np.linalg.pinv(rows, rcond=1e-15)[:, : len(design)])
