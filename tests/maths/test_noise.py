"""Noise: the lattice is the hash, what lies between is smooth and bounded."""

import numpy as np
import pytest

from maths.hashing import uniform01
from maths.noise import TURN_2D, TURN_3D, fbm, value_noise


def slow_value_noise(p, seed):
    cell, total = np.floor(p).astype(int), 0.0
    f = p - cell
    b = 6 * f**5 - 15 * f**4 + 10 * f**3
    for corner in np.ndindex(*(2,) * len(p)):
        weight = np.prod([b[i] if c else 1 - b[i] for i, c in enumerate(corner)])
        total += weight * float(uniform01(seed, *(int(c) for c in cell + corner)))
    return total


@pytest.mark.parametrize("dimensions", [2, 3])
def test_equals_the_slow_version(dimensions: int, rng: np.random.Generator) -> None:
    p = rng.uniform(-50, 50, (100, dimensions))
    slow = [slow_value_noise(q, 3) for q in p]
    assert np.allclose(value_noise(p, 3), slow, rtol=0, atol=1e-14)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_lattice_is_the_hash_in_every_bit(dimensions: int) -> None:
    cells = np.stack(np.meshgrid(*[np.arange(-4, 4)] * dimensions), -1)
    for kind in (np.float32, np.float64):
        found = value_noise(cells.astype(kind), 11)
        assert found.dtype == kind
        assert np.array_equal(found, uniform01(11, *np.moveaxis(cells, -1, 0)))


def test_float32_follows_float64(rng: np.random.Generator) -> None:
    p = rng.uniform(-100, 100, (1000, 3)).astype(np.float32)
    # Blends of numbers under 1 in float32
    assert np.abs(value_noise(p) - value_noise(p.astype(np.float64))).max() < 1e-6


def test_noise_is_continuous_across_cells() -> None:
    x = np.linspace(-3, 3, 60_001)
    line = value_noise(np.stack([x, 0.3 + 0 * x], -1))
    # Slope of the quintic is at most 15/8
    assert np.abs(np.diff(line)).max() < 1.875 * 1e-4 * 1.001


@pytest.mark.parametrize("dimensions", [2, 3])
def test_octaves_stay_in_range_and_use_it(dimensions: int, rng: np.random.Generator) -> None:
    p = rng.uniform(-100, 100, (20_000, dimensions))
    for octaves in (1, 5):
        noise = fbm(p, octaves, 2)
        assert noise.min() >= 0
        assert noise.max() < 1
        assert abs(noise.mean() - 0.5) < 0.02
        assert noise.std() > 0.1
    assert np.array_equal(fbm(p, 1, 2), value_noise(p, 2))


def test_turns_are_rotations() -> None:
    for turn in (TURN_2D, TURN_3D):
        assert np.allclose(turn @ turn.T, np.eye(len(turn)), rtol=0, atol=1e-15)
        assert np.isclose(np.linalg.det(turn), 1)


def test_points_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="two or three"):
        value_noise([1.0, 2.0, 3.0, 4.0])
    with pytest.raises(ValueError, match="two or three"):
        value_noise(1.0)
    with pytest.raises(ValueError, match="octaves"):
        fbm([1.0, 2.0], 0)
