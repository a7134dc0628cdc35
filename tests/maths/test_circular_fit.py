"""Fits against closed forms plus alias series, gates against the cases that they are for."""

import numpy as np
import pytest
from numpy.typing import NDArray

from maths.circular_basis import evaluate, reconstruct, rotate
from maths.circular_fit import RIDGE, fit_weights, leave_one_out, noise_gain, predicted_error
from maths.circular_signals import lambert_lobe, tilted_lambert

Array = NDArray[np.float64]

LIGHTS = (5, 6, 7, 8, 12, 16, 33, 64)
AZIMUTHS = (0.0, 0.3, 2.0, -2.5)
EPS = float(np.finfo(np.float64).eps)


def even(count: int) -> Array:
    return 2 * np.pi * np.arange(count) / count


def arc_removed(removed: int) -> Array:
    """Sixteen even lights without `removed` neighbours: gap (removed + 1) * 22.5 degrees."""
    return even(16)[: 16 - removed]


def powers_over_n(q: int, x: float, lights: int) -> complex:
    """Sum of exp(i n x) / n over all integers n = q (mod lights), n != 0, in closed form.

    From sum_j exp(i j theta) / (j + a) = pi exp(i a (pi - theta)) / sin(pi a), 0 < theta < 2 pi,
    and for a = 0 without j = 0: i (pi - theta) (Gradshteyn, Ryzhik 1.445, 1.441).
    """
    theta = np.mod(lights * x, 2 * np.pi)
    if q % lights == 0:
        return 1j * (np.pi - theta) / lights if theta > 0 else 0j
    a = q / lights
    if theta == 0:
        return complex(np.exp(1j * q * x) / lights * np.pi / np.tan(np.pi * a))
    return complex(
        np.exp(1j * q * x) / lights * np.pi * np.exp(1j * a * (np.pi - theta)) / np.sin(np.pi * a)
    )


def folded_sine(k: int, a: int, edge: float, azimuth: float, lights: int) -> complex:
    """Sum over m = k (mod lights) of exp(-i m azimuth) sin((m + a) edge) / (m + a)."""
    q = k + a
    total = powers_over_n(q, edge - azimuth, lights) - powers_over_n(q, -edge - azimuth, lights)
    zero = edge if q % lights == 0 else 0.0
    return complex(np.exp(1j * a * azimuth) * (total / 2j + zero))


def expected(A: float, B: float, step: float, edge: float, azimuth: float, lights: int) -> Array:
    """Closed form plus alias series of (A + B cos(t - azimuth) + step) on |t - azimuth| < edge."""
    Y = np.empty(5)
    for k in range(3):
        z = (A + step) * folded_sine(k, 0, edge, azimuth, lights) + 0.5 * B * (
            folded_sine(k, -1, edge, azimuth, lights) + folded_sine(k, 1, edge, azimuth, lights)
        )
        if k == 0:
            Y[0] = np.sqrt(2 * np.pi) * z.real / np.pi
        else:
            Y[2 * k - 1], Y[2 * k] = (
                -2 / np.sqrt(np.pi) * z.imag,
                2 / np.sqrt(np.pi) * z.real,
            )
    return Y


@pytest.mark.parametrize("azimuth", AZIMUTHS)
@pytest.mark.parametrize("lights", LIGHTS)
def test_lambert_lobe_is_closed_form_plus_alias_series(lights: int, azimuth: float) -> None:
    t = even(lights)
    Y = fit_weights(t, 5).matrix @ np.maximum(0, np.cos(t - azimuth))
    # 1e-12: what is asked for; rounding of 64 terms is 1e-14
    assert np.allclose(Y, expected(0, 1, 0, np.pi / 2, azimuth, lights), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("A", "B"), [(0.3, 0.5), (-0.2, 0.7), (0.49, 0.5), (0.0, 0.2)])
@pytest.mark.parametrize("lights", LIGHTS)
def test_tilted_lambert_is_closed_form_plus_alias_series(lights: int, A: float, B: float) -> None:
    t = even(lights)
    for azimuth in AZIMUTHS:
        Y = fit_weights(t, 5).matrix @ np.maximum(0, A + B * np.cos(t - azimuth))
        truth = expected(A, B, 0, float(np.arccos(-A / B)), azimuth, lights)
        assert np.allclose(Y, truth, rtol=0, atol=1e-12)


def test_unclamped_tilted_lambert_is_exact_in_three_terms() -> None:
    t = even(5)
    Y = fit_weights(t, 5).matrix @ (0.6 + 0.5 * np.cos(t - 1.1))
    assert np.allclose(Y, rotate(tilted_lambert(0.6, 0.5, 5), 1.1), rtol=0, atol=1e-14)


@pytest.mark.parametrize("half_width", [0.39, 0.77, 1.5, 2.3])
@pytest.mark.parametrize("lights", LIGHTS)
def test_shadow_arc_is_closed_form_plus_alias_series(lights: int, half_width: float) -> None:
    t = even(lights)
    for azimuth in AZIMUTHS:
        lit = np.abs(np.mod(t - azimuth + np.pi, 2 * np.pi) - np.pi) < half_width
        Y = fit_weights(t, 5).matrix @ lit
        truth = expected(0, 0, 1, half_width, azimuth, lights)
        assert np.allclose(Y, truth, rtol=0, atol=1e-12)


def test_closed_alias_series_is_the_limit_of_its_terms() -> None:
    # The truth above, summed term by term: 1e5 folds leave c_m ~ 1/m^2, in sum 1 / (pi 16^2 1e5)
    m = 16 * np.arange(-100_000, 100_001) + 2
    z = np.where(m % 2 == 0, np.where(m % 4 == 0, -1.0, 1.0) / (np.pi * (m * m - 1.0)), 0.0)
    folded = np.sum(z * np.exp(-1j * m * 0.3)) * 2 * np.sqrt(np.pi)
    truth = expected(0, 1, 0, np.pi / 2, 0.3, 16)
    assert np.allclose([-folded.imag, folded.real], truth[3:], rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("lights", "error"),
    [(5, 0.073), (6, 0.076), (8, 0.038), (12, 0.0155), (16, 0.0085), (32, 0.0021), (64, 0.0005)],
)
def test_more_lights_fold_less(lights: int, error: float) -> None:
    t, worst = even(lights), 0.0
    scale = np.sqrt(np.pi) * np.array([np.sqrt(2), 1, 1, 1, 1])
    for azimuth in even(720):
        Y = fit_weights(t, 5).matrix @ np.maximum(0, np.cos(t - azimuth))
        worst = max(worst, np.abs((Y - rotate(lambert_lobe(5), azimuth)) / scale).max())
    # The last digit of a table measured over 720 azimuths
    assert abs(worst - error) <= 0.5 * 10 ** -(4 if error < 0.03 else 3)


def test_band_limited_signals_are_exact_from_any_lights(rng: np.random.Generator) -> None:
    for count in (5, 9, 40):
        t = even(count) + rng.uniform(-0.2, 0.2, count)
        fit = fit_weights(t, 5)
        assert fit.method == "least_squares"
        Y = rng.normal(size=(7, 5))
        found = reconstruct(Y, t) @ fit.matrix.T
        assert np.allclose(found, Y, rtol=0, atol=16 * fit.condition * EPS * np.abs(Y).max())


def test_least_squares_and_quadrature_agree_on_even_lights(rng: np.random.Generator) -> None:
    t, X = even(9), rng.uniform(size=9)
    twice = fit_weights(np.repeat(t, 2), 5)
    assert twice.method == "least_squares"
    assert np.allclose(twice.matrix @ np.repeat(X, 2), fit_weights(t, 5).matrix @ X, atol=1e-14)


@pytest.mark.parametrize("value", [0.0, 1.0, 6.5e4, 1e-6, -3.0])
def test_constant_signal_is_exact(value: float) -> None:
    for t, ridge in (
        (even(64), 0.0),
        (even(5), 0.3),
        (arc_removed(6), 0.0),
        (arc_removed(10), 0.0),
    ):
        fit = fit_weights(t, 5, ridge=ridge)
        Y = fit.matrix @ np.full(len(t), value)
        # Rounding of N products, times the condition where there is a solve
        assert abs(Y[0] - value * np.sqrt(2 * np.pi)) <= 8 * fit.condition * EPS * abs(value)
        assert np.all(np.abs(Y[1:]) <= 8 * fit.condition * EPS * abs(value))


@pytest.mark.parametrize(
    ("angles", "terms"),
    [
        ([0.4], 1),
        (even(2), 1),
        (even(3), 3),
        (even(4), 3),
        ([0.0, 0.0, 2.0, 2.0, 4.0, 4.0 + 2 * np.pi], 3),
        (even(5), 5),
    ],
)
def test_few_azimuths_reduce_the_order(angles: Array, terms: int) -> None:
    fit = fit_weights(angles, 5)
    assert fit.terms == terms
    assert bool(fit.warnings) == (terms < 5)
    assert fit.matrix.shape == (5, len(angles))
    assert not fit.matrix[terms:].any()
    assert np.isfinite(fit.matrix).all()


def test_one_light_gives_a_constant() -> None:
    Y = fit_weights([1.0], 5).matrix @ np.array([0.7])
    assert np.allclose(reconstruct(Y, [0.0, 1.0, 2.0]), 0.7, rtol=4 * EPS)


@pytest.mark.parametrize(
    ("removed", "condition"),
    [(2, 2.0), (4, 3.7), (6, 8.8), (8, 27), (9, 56), (10, 133), (11, 422)],
)
def test_condition_of_arcs(removed: int, condition: float) -> None:
    # The table is for 1, cos, sin, ...; the orthonormal basis differs by sqrt 2 in one column
    design = evaluate(arc_removed(removed), 5) * np.sqrt(np.pi) * [np.sqrt(2), 1, 1, 1, 1]
    table = np.linalg.cond(design)
    assert abs(table / condition - 1) < 0.03  # two digits
    ours = np.linalg.cond(evaluate(arc_removed(removed), 5))
    assert 1 / np.sqrt(2) <= ours / table <= np.sqrt(2)


def test_even_lights_have_condition_one() -> None:
    for count in LIGHTS:
        fit = fit_weights(even(count) + 0.1, 5)
        assert fit.method == "quadrature"
        assert abs(fit.condition - 1) < 1e-12
        assert abs(fit.largest_gap - 2 * np.pi / count) < 1e-12


@pytest.mark.parametrize(
    ("removed", "terms", "method"),
    [
        (1, 5, "least_squares"),
        (6, 5, "least_squares"),
        (7, 5, "ridge"),
        (8, 3, "ridge"),
        (11, 1, "ridge"),
    ],
)
def test_gaps_smooth_and_then_drop_order(removed: int, terms: int, method: str) -> None:
    fit = fit_weights(arc_removed(removed), 5)
    if terms == 1:
        method = "least_squares"  # a constant has nothing to smooth
    assert (fit.terms, fit.method) == (terms, method)
    assert bool(fit.warnings) == (removed >= 7)
    assert abs(np.degrees(fit.largest_gap) - (removed + 1) * 22.5) < 1e-9


def test_near_duplicates_drop_order_without_a_gap() -> None:
    t = [0.0, 0.01, 2.0, 2.01, 4.0]
    assert np.linalg.cond(evaluate(t, 5)) > 100
    fit = fit_weights(t, 5)
    assert fit.largest_gap < np.pi
    assert fit.terms == 3
    assert "condition" in " ".join(fit.warnings)


def test_gates_beat_plain_least_squares_where_they_act() -> None:
    for removed in (7, 8, 9, 10, 11):
        t = arc_removed(removed)
        plain = np.linalg.pinv(evaluate(t, 5))
        fit = fit_weights(t, 5)
        errors = []
        for matrix in (fit.matrix, plain):
            square = [
                np.mean(
                    (
                        reconstruct(matrix @ np.maximum(0, np.cos(t - p)), even(360))
                        - np.maximum(0, np.cos(even(360) - p))
                    )
                    ** 2
                )
                for p in np.linspace(0, 2 * np.pi, 61)
            ]
            errors.append(np.sqrt(np.mean(square)))
        assert errors[0] < errors[1]


def test_ridge_shrinks_even_lights_by_the_formula(rng: np.random.Generator) -> None:
    t, X = even(12), rng.uniform(size=12)
    plain = fit_weights(t, 7).matrix @ X
    h = np.array([0, 1, 1, 2, 2, 3, 3])
    for ridge in (1e-4, RIDGE, 0.5):
        fit = fit_weights(t, 7, ridge=ridge)
        assert fit.method == "ridge"
        assert np.allclose(fit.matrix @ X, plain / (1 + 2 * ridge * h * h), rtol=0, atol=1e-13)


def test_weight_zero_is_absence_and_weights_scale_out(rng: np.random.Generator) -> None:
    t, X = even(11) + rng.uniform(-0.1, 0.1, 11), rng.uniform(size=11)
    keep = np.ones(11)
    keep[[2, 7]] = 0
    for factor in (1.0, 1e200, 1e-200):
        fit = fit_weights(t, 5, sample_weights=keep * factor)
        assert np.allclose(
            fit.matrix @ X, fit_weights(t[keep > 0], 5).matrix @ X[keep > 0], atol=1e-13
        )
        assert not fit.matrix[:, [2, 7]].any()


def test_weights_solve_the_weighted_normal_equations(rng: np.random.Generator) -> None:
    t, w, X = even(11), rng.uniform(0.1, 2, 11), rng.uniform(size=11)
    B = evaluate(t, 5)
    slow = np.linalg.solve(B.T @ np.diag(w) @ B, B.T @ (w * X))
    fit = fit_weights(t, 5, sample_weights=w)
    # The normal equations square the condition
    assert np.allclose(fit.matrix @ X, slow, rtol=0, atol=32 * EPS * fit.condition**2)


def test_lights_off_the_ring_fit_their_own_model(rng: np.random.Generator) -> None:
    t, gains, Y = rng.uniform(0, 7, 24), rng.uniform(0.5, 1, 24), rng.normal(size=5)
    gains[3] = 0.0  # on the axis, where the azimuth means nothing
    X = np.sum(evaluate(t, 5) * gains[:, None] ** np.array([0, 1, 1, 2, 2]) * Y, axis=-1)
    fit = fit_weights(t, 5, gains=gains)
    assert np.allclose(fit.matrix @ X, Y, rtol=0, atol=16 * EPS * fit.condition * np.abs(Y).max())
    assert "leave the ring" in fit.warnings[-1]
    t[3] += 1.0
    assert np.array_equal(fit_weights(t, 5, gains=gains).matrix @ X, fit.matrix @ X)


def test_leave_one_out_is_refitting(rng: np.random.Generator) -> None:
    t, X = even(11) + rng.uniform(-0.2, 0.2, 11), rng.uniform(size=(3, 11))
    for weights in (np.ones(11), rng.uniform(0.5, 2, 11)):
        fit = fit_weights(t, 5, sample_weights=weights)
        residual = X - reconstruct(X @ fit.matrix.T, t)
        quick = leave_one_out(residual, fit.hat)
        for n in range(11):
            others = np.arange(11) != n
            without = fit_weights(t[others], 5, sample_weights=weights[others])
            slow = X[:, n] - reconstruct(X[:, others] @ without.matrix.T, t[n : n + 1])[:, 0]
            assert np.allclose(quick[:, n], slow, rtol=0, atol=1e-12)  # condition 2, share > .1


def test_leave_one_out_of_quadrature(rng: np.random.Generator) -> None:
    t, X = even(16), rng.uniform(size=16)
    fit = fit_weights(t, 5)
    assert np.allclose(fit.hat, 5 / 16, rtol=1e-14)
    residual = X - reconstruct(fit.matrix @ X, t)
    without = fit_weights(t[1:], 5)
    slow = X[0] - reconstruct(without.matrix @ X[1:], t[:1])[0]
    assert abs(leave_one_out(residual, fit.hat)[0] - slow) < 1e-13


def test_leave_one_out_of_as_many_terms_as_lights_is_infinite() -> None:
    fit = fit_weights(even(5), 5)
    assert np.all(np.isinf(leave_one_out(np.zeros(5), fit.hat)))


def test_noise_gain_is_the_inverse_of_the_normal_matrix(rng: np.random.Generator) -> None:
    t = even(10) + rng.uniform(-0.2, 0.2, 10)
    B = evaluate(t, 5)
    truth = np.sqrt(np.diag(np.linalg.inv(B.T @ B)))
    assert np.allclose(noise_gain(fit_weights(t, 5)), truth, rtol=1e-12)
    assert np.allclose(noise_gain(fit_weights(even(9), 5)), np.sqrt(2 * np.pi / 9), rtol=1e-14)


@pytest.mark.parametrize("t", [even(8), even(16), arc_removed(4), arc_removed(8), np.array([0.5])])
def test_predicted_error_is_the_mean_over_lobes(t: Array) -> None:
    fit = fit_weights(t, 5)
    dense = even(1024)
    square = [
        np.mean(
            (
                reconstruct(fit.matrix @ np.maximum(0, np.cos(t - p)), dense)
                - np.maximum(0, np.cos(dense - p))
            )
            ** 2
        )
        for p in 2 * np.pi * np.arange(509) / 509
    ]
    # Harmonics over 64 hold 2e-9 of the energy, in an error of 1e-2 or more
    assert abs(predicted_error(fit) / np.sqrt(np.mean(square)) - 1) < 1e-3


def test_predicted_error_sees_a_gap_that_residuals_do_not() -> None:
    errors = [predicted_error(fit_weights(arc_removed(n), 5)) for n in (0, 4, 7, 9, 11)]
    assert np.all(np.diff(errors) > 0)
    t = arc_removed(9)
    X = np.maximum(0, np.cos(t - t[-1] - 1.5))
    fit = fit_weights(t, 5)
    assert np.sqrt(np.mean((X - reconstruct(fit.matrix @ X, t)) ** 2)) < predicted_error(fit) / 2


def test_predicted_error_adds_noise() -> None:
    fit = fit_weights(even(16), 5)
    quiet, loud = predicted_error(fit), predicted_error(fit, noise=0.1)
    assert abs(loud**2 - quiet**2 - 0.1**2 * 5 / 16) < 1e-15


def test_turning_the_lights_turns_the_coefficients(rng: np.random.Generator) -> None:
    for t in (even(9), even(9) + rng.uniform(-0.2, 0.2, 9), arc_removed(7), arc_removed(9)):
        X = rng.uniform(size=len(t))
        still, turned = fit_weights(t, 5), fit_weights(t + 0.7, 5)
        assert np.allclose(
            turned.matrix @ X,
            rotate(still.matrix @ X, 0.7),
            rtol=0,
            atol=64 * EPS * still.condition,
        )


@pytest.mark.parametrize(
    "arguments",
    [
        {"angles": []},
        {"angles": [np.nan, 0.0]},
        {"angles": [[0.0, 1.0]]},
        {"terms": 4},
        {"terms": 0},
        {"ridge": -1.0},
        {"ridge": np.nan},
        {"sample_weights": [0.0] * 6},
        {"sample_weights": [1.0] * 5},
        {"sample_weights": [1.0] * 5 + [-1.0]},
        {"sample_weights": [1.0] * 5 + [np.inf]},
        {"gains": [2.0] * 6},
    ],
)
def test_what_is_no_fit_is_refused(arguments: dict[str, object]) -> None:
    given = {"angles": even(6), "terms": 5, **arguments}
    with pytest.raises(ValueError, match=r"fit|terms"):
        fit_weights(given.pop("angles"), given.pop("terms"), **given)
