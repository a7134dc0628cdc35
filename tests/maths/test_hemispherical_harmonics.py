"""Hemispherical harmonics against closed forms, quadrature, normal equations and real refits."""

import numpy as np
import pytest
from numpy.typing import NDArray

from maths import hemispherical_harmonics as harmonics

Array = NDArray[np.float64]


def dome(count: int) -> Array:
    """Directions (count, 3) of a golden spiral over the hemisphere."""
    z = 1 - (np.arange(count) + 0.5) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)


def test_basis_is_orthonormal_over_the_hemisphere() -> None:
    bands = 8
    # Products are polynomials of degree 14 in z and 14 harmonics of the azimuth: both rules exact
    nodes, weights = np.polynomial.legendre.leggauss(16)
    z, azimuth = (nodes + 1) / 2, 2 * np.pi * np.arange(32) / 32
    r = np.sqrt(1 - z * z)[:, None]
    around = np.stack([r * np.cos(azimuth), r * np.sin(azimuth)], axis=-1)
    d = np.concatenate([around, np.broadcast_to(z[:, None, None], (16, 32, 1))], axis=-1)
    basis = harmonics.evaluate(d, bands)
    gram = np.einsum("ijk,ijl,i->kl", basis, basis, weights / 2 * 2 * np.pi / 32)
    # 512 products of functions up to 12: rounding of some 1e-14
    np.testing.assert_allclose(gram, np.eye(bands**2), atol=2e-13)


def test_low_bands_are_those_of_the_paper() -> None:
    d = dome(50)
    x, y, z = d.T
    azimuth = np.arctan2(y, x)
    sine = 2 * np.sqrt(z * (1 - z))  # of the shifted angle, whose cosine is 2 z - 1
    root = np.sqrt(1 / (2 * np.pi))
    expected = np.stack(
        [
            np.full_like(x, root),
            np.sqrt(3) * root * sine * np.sin(azimuth),
            np.sqrt(3) * root * (2 * z - 1),
            np.sqrt(3) * root * sine * np.cos(azimuth),
            np.sqrt(15 / 4) * root * sine**2 * np.sin(2 * azimuth),
            np.sqrt(15) * root * sine * (2 * z - 1) * np.sin(azimuth),
            np.sqrt(5) * root * (3 * (2 * z - 1) ** 2 - 1) / 2,
            np.sqrt(15) * root * sine * (2 * z - 1) * np.cos(azimuth),
            np.sqrt(15 / 4) * root * sine**2 * np.cos(2 * azimuth),
        ],
        axis=-1,
    )
    # A handful of roundings of values up to 1
    np.testing.assert_allclose(harmonics.evaluate(d, 3), expected, atol=2e-15)


def test_azimuth_vanishes_at_the_horizon_and_below_it() -> None:
    low = harmonics.evaluate([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.799, -0.04]], 4)
    assert np.array_equal(low[0], low[1])
    assert np.array_equal(low[0], low[2])
    constant = [band * (band + 1) for band in range(4)]
    assert np.count_nonzero(low[0]) == 4
    assert np.all(low[0][constant] != 0)


def test_a_series_comes_back_without_penalty(rng: np.random.Generator) -> None:
    d, C = dome(40), rng.normal(size=(16, 3))
    fit = harmonics.fit_weights(d, 4, 0.0)
    # Rounding times the condition, 5: under 1e-13 of coefficients of 1
    assert fit.condition < 10
    np.testing.assert_allclose(fit.matrix @ (harmonics.evaluate(d, 4) @ C), C, atol=1e-13)


def test_fit_solves_the_penalised_weighted_problem(rng: np.random.Generator) -> None:
    d, w, x = dome(30), rng.random(30), rng.random((30, 3))
    w[4] = 0
    fit = harmonics.fit_weights(d, 5, 0.1, sample_weights=w)
    B, w = harmonics.evaluate(d, 5), w / w.mean()
    band = np.sqrt(np.arange(25)).astype(int)
    rows = np.sqrt(0.1 * 30 * (band * (band + 1) / 20.0) ** 2)
    stacked = np.vstack([np.sqrt(w)[:, None] * B, np.diag(rows)])
    target = np.vstack([np.sqrt(w)[:, None] * x, np.zeros((25, 3))])
    slow = np.linalg.lstsq(stacked, target, rcond=None)[0]
    # Two ways of double precision on a condition of 15
    np.testing.assert_allclose(fit.matrix @ x, slow, atol=1e-12)
    np.testing.assert_allclose(fit.hat, np.diag(B @ fit.matrix), atol=1e-14)
    assert np.all(fit.matrix[:, 4] == 0)


def test_penalty_spares_the_constant_and_takes_the_rest(rng: np.random.Generator) -> None:
    d = dome(20)
    fit = harmonics.fit_weights(d, 5, 0.3)
    flat = fit.matrix @ np.full(20, 0.7)
    # The constant is free, so a constant signal is fitted without error
    np.testing.assert_allclose(flat[0], 0.7 * np.sqrt(2 * np.pi), rtol=1e-13)
    np.testing.assert_allclose(flat[1:], 0, atol=1e-14)
    x = rng.random(20)
    bent = [np.sum((harmonics.fit_weights(d, 5, q).matrix @ x)[1:] ** 2) for q in (0.01, 0.1, 1.0)]
    assert bent[0] > bent[1] > bent[2] > 0
    # At 1e9 all bands but the first are gone: the mean is left
    stiff = harmonics.fit_weights(d, 5, 1e9).matrix @ x
    np.testing.assert_allclose(stiff[0], x.mean() * np.sqrt(2 * np.pi), rtol=1e-6)


def test_few_and_repeated_lights_stay_bounded(rng: np.random.Generator) -> None:
    d = np.concatenate([np.repeat([[0.0, 0.0, 1.0]], 9, axis=0), [[0.6, 0.0, 0.8]]])
    x = rng.random(10)
    free = harmonics.fit_weights(d, 3, 0.0)
    assert np.isinf(free.condition)
    # Least norm: both directions are met, the repeated one at the mean of its samples
    values = harmonics.evaluate(d, 3) @ (free.matrix @ x)
    np.testing.assert_allclose(values, [*[x[:9].mean()] * 9, x[9]], rtol=1e-12)
    smooth = harmonics.evaluate(dome(200), 3) @ (harmonics.fit_weights(d, 3, 0.1).matrix @ x)
    assert np.abs(smooth).max() < 2


def test_records_of_their_own_weights_agree_with_single_fits(rng: np.random.Generator) -> None:
    d, x, w = dome(24), rng.random((5, 24, 3)), rng.random((5, 24)) + 0.1
    C = harmonics.fit_each(x, d, 4, 0.05, w)
    hats = harmonics.hats_each(d, 4, 0.05, w)
    for n in range(5):
        one = harmonics.fit_weights(d, 4, 0.05, sample_weights=w[n])
        # Normal equations square a condition of 10: 1e-14 of solutions of 1
        np.testing.assert_allclose(C[n], one.matrix @ x[n], atol=1e-12)
        np.testing.assert_allclose(hats[n], one.hat, atol=1e-12)


def test_hats_predict_refits_without_a_light(rng: np.random.Generator) -> None:
    d, x, w = dome(24), rng.random((1, 24, 1)), rng.random((1, 24)) + 0.1
    w /= w.mean()
    basis, hats = harmonics.evaluate(d, 4), harmonics.hats_each(d, 4, 0.05, w)
    residual = x[0, :, 0] - basis @ harmonics.fit_each(x, d, 4, 0.05, w)[0, :, 0]
    for n in (0, 7, 23):
        # Leave it out by hand, the weights and the penalty as they were
        rows = np.sqrt(0.05 * 24 * harmonics.penalties(4))
        root = np.sqrt(w[0]) * (np.arange(24) != n)
        stacked = np.vstack([root[:, None] * basis, np.diag(rows)])
        target = np.concatenate([root * x[0, :, 0], np.zeros(16)])
        without = basis[n] @ np.linalg.lstsq(stacked, target, rcond=None)[0]
        assert x[0, n, 0] - without == pytest.approx(residual[n] / (1 - hats[0, n]), abs=1e-11)


def test_misuse_is_refused() -> None:
    d = dome(8)
    for bad in (np.zeros((0, 3)), np.zeros(3), np.full((4, 3), np.nan)):
        with pytest.raises(ValueError, match="directions"):
            harmonics.fit_weights(bad, 2, 0.1)
    with pytest.raises(ValueError, match="bands"):
        harmonics.evaluate(d, 17)
    with pytest.raises(ValueError, match="penalty"):
        harmonics.fit_weights(d, 2, -0.1)
    with pytest.raises(ValueError, match="Weights"):
        harmonics.fit_weights(d, 2, 0.1, sample_weights=np.zeros(8))
    with pytest.raises(ValueError, match="penalty above 0"):
        harmonics.fit_each(np.ones((1, 8, 3)), d, 2, 0.0, np.ones((1, 8)))
    with pytest.raises(ValueError, match="above 0"):
        harmonics.hats_each(d, 2, 0.1, np.zeros((1, 8)))
    with pytest.raises(ValueError, match="as many"):
        harmonics.fit_each(np.ones((2, 8, 3)), d, 2, 0.1, np.ones((1, 8)))
