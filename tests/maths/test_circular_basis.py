"""The basis: orthonormal, turned exactly, its energy that of the signal."""

import numpy as np
import pytest

from maths.circular_basis import (
    evaluate,
    harmonic_of,
    reconstruct,
    relight,
    rotate,
    truncation_rms,
)
from maths.circular_signals import lambert_lobe


def test_basis_is_orthonormal() -> None:
    # 32 even points integrate products of harmonics up to 7 exactly
    B = evaluate(2 * np.pi * np.arange(32) / 32, 15)
    assert np.allclose(B.T @ B * (2 * np.pi / 32), np.eye(15), rtol=0, atol=1e-14)


def test_order_of_terms_is_constant_sine_cosine() -> None:
    t = 0.7
    truth = [np.sqrt(0.5), np.sin(t), np.cos(t), np.sin(2 * t), np.cos(2 * t)]
    assert np.allclose(evaluate(t, 5) * np.sqrt(np.pi), truth, rtol=1e-15)
    assert harmonic_of(7).tolist() == [0, 1, 1, 2, 2, 3, 3]


@pytest.mark.parametrize("terms", [0, -1, 2, 4])
def test_even_numbers_of_terms_are_refused(terms: int) -> None:
    with pytest.raises(ValueError, match="odd"):
        evaluate(0.0, terms)


def test_rotation_moves_the_signal(rng: np.random.Generator) -> None:
    Y, t = rng.normal(size=(4, 7)), rng.uniform(-9, 9, 20)
    for delta in (0.0, 0.3, -2.0, 40.0):
        # 1e-13: angles up to 150 rad have a rounding of 3e-14
        assert np.allclose(reconstruct(rotate(Y, delta), t), reconstruct(Y, t - delta), atol=1e-13)


def test_rotation_keeps_energy_and_closes(rng: np.random.Generator) -> None:
    Y = rng.normal(size=9)
    assert np.isclose(np.sum(rotate(Y, 1.3) ** 2), np.sum(Y**2), rtol=1e-14)
    assert np.allclose(rotate(rotate(Y, 1.3), -1.3), Y, rtol=0, atol=1e-15 * 9)


def test_rotation_along_another_axis(rng: np.random.Generator) -> None:
    Y = rng.normal(size=(5, 3, 2))
    turned = rotate(Y, 0.4, axis=0)
    assert np.array_equal(turned[:, 1, 1], rotate(Y[:, 1, 1], 0.4))


@pytest.mark.parametrize(("order", "rms"), [(2, 0.0341), (3, 0.0341), (4, 0.0162), (8, 0.0068)])
def test_truncation_of_the_lambert_lobe(order: int, rms: float) -> None:
    Y = lambert_lobe(2 * order + 1)
    by_parseval = float(truncation_rms(0.25, Y))  # mean of max(0, cos)^2 is 1/4
    t = 2 * np.pi * np.arange(4096) / 4096
    brute = np.sqrt(np.mean((reconstruct(Y, t) - np.maximum(0, np.cos(t))) ** 2))
    assert abs(by_parseval - brute) < 1e-6  # midpoint rule over two corners, (2 pi / 4096)^2
    assert abs(by_parseval - rms) < 5e-5


def test_truncation_never_takes_the_root_of_rounding() -> None:
    assert truncation_rms(1.0, [np.sqrt(2 * np.pi) * (1 + 1e-15), 0.0, 0.0]) == 0.0


def test_relight_clamps_after_the_sum(rng: np.random.Generator) -> None:
    Y, L = rng.normal(size=(6, 5, 3)), rng.normal(size=(5, 3))
    slow = np.array(
        [
            [max(0.0, sum(Y[p, k, c] * L[k, c] for k in range(5))) for c in range(3)]
            for p in range(6)
        ]
    )
    assert np.allclose(relight(Y, L), slow, rtol=0, atol=1e-14)
    assert np.array_equal(relight(np.moveaxis(Y, 1, 0), L, axis=0), relight(Y, L))
    assert (slow == 0).any()


def test_relight_broadcasts_lights(rng: np.random.Generator) -> None:
    Y, L = rng.normal(size=(4, 5, 3)), rng.normal(size=(4, 5, 3))
    assert np.array_equal(relight(Y, L)[2], relight(Y[2], L[2]))
