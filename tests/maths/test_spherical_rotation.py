"""Rotation of spherical harmonics: rows S10 to S14 of hard cases."""

import numpy as np
import pytest

from maths.sampling import random_rotation
from maths.spherical_harmonics import evaluate
from maths.spherical_projection import clamped_cosine, quadrature
from maths.spherical_rotation import rotate, rotation_matrices
from maths.transforms import normalise, rotation

SPECIAL = [np.eye(3)] + [rotation(a, q * np.pi / 2) for a in "xyz" for q in (1, 2, 3)]


def test_bands_are_orthogonal_and_turn_the_basis(rng: np.random.Generator) -> None:
    R = np.concatenate([random_rotation(np.arange(20), 7), SPECIAL])
    d = normalise(rng.normal(size=(40, 3)))
    bands = rotation_matrices(R, 20)
    for band, D in enumerate(bands):
        assert np.abs(D @ np.swapaxes(D, -1, -2) - np.eye(2 * band + 1)).max() < 1e-14
        own = slice(band * band, (band + 1) ** 2)
        turned = evaluate(np.einsum("rij,nj->rni", R, d), band)[..., own]
        expected = np.einsum("rij,nj->rni", D, evaluate(d, band)[:, own])
        # Directions round at 1e-16 and the slope is l |Y|: measured 6e-14 at l = 20
        np.testing.assert_allclose(turned, expected, rtol=0, atol=3e-13)


def test_bands_are_the_integrals_of_their_definition() -> None:
    R = random_rotation(3, 1)
    d, area = quadrature(6)
    whole = evaluate(d @ R.T, 6).T @ (evaluate(d, 6) * area[:, None])
    for band, D in enumerate(rotation_matrices(R, 6)):
        own = slice(band * band, (band + 1) ** 2)
        np.testing.assert_allclose(D, whole[own, own], rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (1.01 * np.eye(3), "scales"),
        (np.eye(3) + 0.01 * np.eye(3, k=1), "shears"),
        (np.diag([1.0, 1.0, -1.0]), "mirrors"),
        (np.full((3, 3), np.nan), "rotation"),
        (np.zeros((3, 3)), "scales"),
        (np.eye(4), "rotation"),
    ],
)
def test_what_is_no_rotation_is_refused(matrix: np.ndarray, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        rotation_matrices(matrix, 2)


def test_a_rotation_in_single_precision_is_made_a_rotation() -> None:
    D = rotation_matrices(random_rotation(5, 5).astype(np.float32), 10)[10]
    assert np.abs(D @ D.T - np.eye(21)).max() < 1e-14


def test_turning_keeps_energy_and_comes_back(rng: np.random.Generator) -> None:
    c, R = rng.normal(size=(25, 3)), random_rotation(9, 2)
    turned = rotate(c, R)
    np.testing.assert_allclose(np.sum(turned**2, 0), np.sum(c**2, 0), rtol=1e-13)
    np.testing.assert_array_equal(turned[0], c[0])
    np.testing.assert_allclose(rotate(turned, R.T), c, rtol=0, atol=1e-13)
    np.testing.assert_allclose(rotate(c.T, R), turned.T, rtol=0, atol=1e-15)
    np.testing.assert_allclose(rotate(c, R, axis=0), turned, rtol=0, atol=1e-15)
    with pytest.raises(ValueError, match="axis"):
        rotate(c[:, :1], R)


def test_a_turned_light_is_a_normal_turned_back(rng: np.random.Generator) -> None:
    c, R = rng.normal(size=25), random_rotation(11, 3)
    n = normalise(rng.normal(size=(20, 3)))
    left = clamped_cosine(n, 4) @ rotate(c, R)
    np.testing.assert_allclose(left, clamped_cosine(n @ R, 4) @ c, rtol=0, atol=1e-13)


def test_a_degree_at_a_time_drifts_no_further_than_rounding(rng: np.random.Generator) -> None:
    c, R = rng.normal(size=25), rotation("y", np.pi / 180)
    D = np.zeros((25, 25))
    for band, part in enumerate(rotation_matrices(R, 4)):
        D[band**2 : (band + 1) ** 2, band**2 : (band + 1) ** 2] = part
    turned = c
    for _ in range(3600):
        turned = D @ turned
    # Each turn's rounding adds up: measured 1.6e-12
    np.testing.assert_allclose(turned, c, rtol=0, atol=1e-11)
    # Turned from the original there is none of it
    whole = rotate(c, rotation("y", 3600 * np.pi / 180))
    np.testing.assert_allclose(whole, c, rtol=0, atol=1e-13)
