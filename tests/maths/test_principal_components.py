"""Principal components against the Eckart-Young optimum, scikit-learn, and hostile records."""

import numpy as np
import pytest

from maths import principal_components as module
from maths.principal_components import principal_components


def falling(rng: np.random.Generator, n: int, p: int, fall: float) -> np.ndarray:
    """Records whose k-th singular value is about fall^k."""
    Q = np.linalg.qr(rng.normal(size=(p, p)))[0]
    return rng.normal(size=(n, p)) * fall ** np.arange(p) @ Q


@pytest.mark.parametrize("fall", [0.8, 0.1])  # condition 1e-2 (Gram) and 1e-19 (QR)
def test_residual_is_the_optimum(rng: np.random.Generator, fall: float) -> None:
    x = falling(rng, 9000, 20, fall)
    found = principal_components(x, 5)
    s = np.linalg.svd(x, compute_uv=False)
    optimum = np.sqrt(np.sum(s[5:] ** 2) / x.size)
    # Rounding of 1e-16 of the largest entries, 4, against a residual of 1e-5 or more
    assert found.residual == pytest.approx(optimum, rel=1e-9)
    assert found.optimum == pytest.approx(optimum, rel=1e-9)
    np.testing.assert_allclose(found.singular, s[:5], rtol=1e-9)
    left = x - (x @ found.vectors.T) @ found.vectors
    assert np.sqrt(np.mean(left**2)) == pytest.approx(optimum, rel=1e-9)
    np.testing.assert_allclose(found.vectors @ found.vectors.T, np.eye(5), atol=1e-14)
    assert found.warnings == ()


@pytest.mark.parametrize("fall", [1e-2, 1e-3, 1e-6])  # smallest of three: 1e-4, 1e-6, 1e-12
def test_small_singular_values_keep_their_digits(rng: np.random.Generator, fall: float) -> None:
    U = np.linalg.qr(rng.normal(size=(2000, 3)))[0]
    V = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    truth = fall ** np.arange(3)
    found = principal_components(U * truth @ V, 3)
    # A trusted Gram matrix squares a condition of up to 1e5: 1e-16 * 1e10 / 2. QR: 1e-16 * 1e12
    np.testing.assert_allclose(found.singular, truth, rtol=1e-3 if fall < 1e-4 else 1e-6)


def test_scikit_learn_agrees(rng: np.random.Generator) -> None:
    decomposition = pytest.importorskip("sklearn.decomposition")
    x = falling(rng, 500, 12, 0.6)
    theirs = decomposition.TruncatedSVD(4, algorithm="arpack", random_state=0).fit(x).components_
    ours = principal_components(x, 4).vectors
    # Directions are told apart by ratios of .6: ARPACK stops at machine precision
    np.testing.assert_allclose(np.abs(np.sum(ours * theirs, axis=1)), 1, atol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1.0, 1e4, 1e6])
def test_a_huge_offset_is_kept_at_the_optimum(rng: np.random.Generator, offset: float) -> None:
    x = rng.normal(size=(600, 8)) * 0.5 ** np.arange(8) + offset
    found = principal_components(x, 4)
    s = np.linalg.svd(x, compute_uv=False)
    # 1e6 leaves 10 digits: 1e-4 of a residual of .05 would be seen
    assert found.residual <= np.sqrt(np.sum(s[4:] ** 2) / x.size) * (1 + 1e-5)


def test_rank_below_the_count_is_filled_with_zeros(rng: np.random.Generator) -> None:
    x = rng.normal(size=(300, 3)) @ rng.normal(size=(3, 10))
    found = principal_components(x, 6)
    assert found.rank == 3
    assert np.all(found.vectors[3:] == 0)
    assert np.all(found.singular[3:] == 0)
    assert "3 components hold everything: 3 are zero" in found.warnings[0]
    np.testing.assert_allclose((x @ found.vectors.T) @ found.vectors, x, atol=1e-12)
    assert principal_components(x[:1], 2).rank == 1  # a single record
    assert principal_components(x.T[:2], 4).rank == 2  # fewer records than columns


def test_constant_and_zero_records() -> None:
    # (P3) the rounding of a constant is no second component
    found = principal_components(np.full((4097, 7), 0.3), 3)
    assert found.rank == 1
    np.testing.assert_allclose(found.vectors[0], np.full(7, 7**-0.5), rtol=1e-12)
    zero = principal_components(np.zeros((5, 3)), 2)
    assert (zero.rank, zero.residual, np.abs(zero.vectors).max()) == (0, 0.0, 0.0)
    assert zero.warnings == ("all zero",)


@pytest.mark.parametrize("size", [1e-160, 1e160])
def test_records_of_any_size(rng: np.random.Generator, size: float) -> None:
    # Squares of these would vanish or overflow
    x = rng.normal(size=(50, 4)) * [4, 3, 2, 1]
    plain, scaled = principal_components(x, 2), principal_components(x * size, 2)
    np.testing.assert_allclose(scaled.vectors, plain.vectors, atol=1e-12)
    assert scaled.residual == pytest.approx(plain.residual * size, rel=1e-12)


def test_signs_do_not_depend_on_the_records_signs(rng: np.random.Generator) -> None:
    x = falling(rng, 200, 6, 0.7)
    found = principal_components(x, 6)
    turned = principal_components(-x[::-1], 6)
    np.testing.assert_allclose(turned.vectors, found.vectors, atol=1e-12)
    top = np.argmax(np.abs(found.vectors), axis=1)
    assert np.all(found.vectors[np.arange(6), top] > 0)


def test_the_first_of_equal_loadings_is_positive() -> None:
    found = principal_components(np.array([[-1.0, 1.0], [1.0, -1.0]]), 1)
    np.testing.assert_allclose(found.vectors, [[0.5**0.5, -(0.5**0.5)]], rtol=1e-14)


def test_degenerate_directions_span_the_right_plane(rng: np.random.Generator) -> None:
    Q = np.linalg.qr(rng.normal(size=(40, 5)))[0]
    W = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    x = (Q * [2, 2, 1, 0.5, 0.1]) @ W.T
    V = principal_components(x, 2).vectors
    np.testing.assert_allclose(V.T @ V, W[:, :2] @ W[:, :2].T, atol=1e-12)


def test_both_ways_give_one_answer(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    x = falling(rng, 20000, 10, 0.7)
    by_gram = principal_components(x, 4)
    monkeypatch.setattr(module, "TRUSTED", 0.0)
    by_qr = principal_components(x, 4)
    # A Gram matrix has half the digits of the ratio .7^9 = .04, squared: still 1e-13
    np.testing.assert_allclose(by_qr.vectors, by_gram.vectors, atol=1e-11)
    assert not np.array_equal(by_qr.vectors, by_gram.vectors)


def test_a_bad_decomposition_is_caught(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    x = falling(rng, 100, 6, 0.5)
    s = np.linalg.svd(x, compute_uv=False)
    monkeypatch.setattr(module, "_by_gram", lambda blocks, p: (s, np.eye(6)))
    with pytest.raises(ArithmeticError, match="is possible"):
        principal_components(x, 2)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(bad: float) -> None:
    x = np.ones((20000, 2))
    x[-1, 1] = bad
    with pytest.raises(ValueError, match="finite"):
        principal_components(x, 1)


def test_misuse_is_refused() -> None:
    for x, count in ((np.ones(4), 1), (np.ones((0, 3)), 1), (np.ones((2, 2)), 0)):
        with pytest.raises(ValueError, match="matrix"):
            principal_components(x, count)


def test_directions_of_equal_singular_values_do_not_depend_on_rounding(
    rng: np.random.Generator,
) -> None:
    """A span of three equal values, of which two are kept, turned before by chance."""
    V = np.linalg.qr(rng.normal(size=(9, 9)))[0]
    U = np.linalg.qr(rng.normal(size=(400, 9)))[0]
    s = np.array([5, 3, 3, 3, 1, 0.5, 0.5, 0.1, 0.01])
    first = principal_components(U * s @ V, 3)
    for _ in range(4):
        turn = np.eye(9)
        turn[1:4, 1:4] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        again = principal_components(U * s @ (turn @ V), 3)
        # Rounding of 1e-16 against gaps of a third
        np.testing.assert_allclose(again.vectors, first.vectors, atol=1e-13)
    np.testing.assert_allclose(first.vectors @ first.vectors.T, np.eye(3), atol=1e-14)
    assert first.residual == pytest.approx(first.optimum, rel=1e-9)


def test_nearly_equal_singular_values_keep_their_order_and_the_optimum(
    rng: np.random.Generator,
) -> None:
    V, U = (np.linalg.qr(rng.normal(size=(n, 6)))[0] for n in (6, 300))
    s = np.array([2, 1 + 1e-4, 1, 1 - 1e-4, 0.1, 0.05])
    found = principal_components(U * s @ V.T, 2)
    # Gaps of ten times TIED are told apart, here to 1e-16 over 1e-4
    np.testing.assert_allclose(np.abs(np.sum(found.vectors * V.T[:2], axis=1)), 1, atol=1e-11)
