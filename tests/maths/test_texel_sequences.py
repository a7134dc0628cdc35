"""Numbers of texels: evenly spread over passes, complementary between neighbours."""

import numpy as np

from maths import texel_sequences as sequences


def test_steps_and_dithers_are_fractions_of_a_turn():
    steps = np.array([*sequences.PAIR, *sequences.QUAD]) / 2.0**32
    g2, g4 = 1 / steps[0], 1 / steps[2]
    # Roots of g^(d+1) = g + 1, as far as 32 bits tell
    assert abs(g2**3 - g2 - 1) < 1e-8
    assert abs(g4**5 - g4 - 1) < 1e-8
    np.testing.assert_allclose(steps[2:], g4 ** -np.arange(1.0, 5.0), atol=1e-9)
    assert len({turn for row in sequences.DITHER for turn in row}) >= 10


def test_words_wrap_and_units_stay_below_one():
    last = np.uint32(0xFFFFFFFF)
    words = sequences.pair(last)
    np.testing.assert_array_equal(words, -np.array(sequences.PAIR) % 2**32)
    assert sequences.unit(last) == 1 - 2.0**-24
    total = sequences.texel_dither([3, 0, 0]).astype(np.int64)
    np.testing.assert_array_equal(total, 3 * np.array(sequences.DITHER)[:, 0] % 2**32)


def error(numbers, rng):
    """RMS error of the mean over the last axis but one, for discs cut by random lines."""
    radius, phi = np.sqrt(numbers[..., 0]), 2 * np.pi * numbers[..., 1]
    turn, c = (
        rng.uniform(0, 2 * np.pi, (len(numbers), 1)),
        rng.uniform(-0.5, 0.5, (len(numbers), 1)),
    )
    share = (np.arccos(c) - c * np.sqrt(1 - c * c)) / np.pi
    return np.sqrt(np.mean((np.mean(radius * np.cos(phi - turn) > c, axis=1) - share[:, 0]) ** 2))


def test_neighbours_complement_each_other(rng):
    """Means of 4 x 4 texels after one pass, on all three planes, against a hash."""
    spread, independent = [], []
    for axis in range(3):
        y, x = np.divmod(np.arange(16), 4)
        place = np.zeros((400, 16, 3), np.int64)
        place[..., axis], place[..., axis - 1] = x, y
        place += rng.integers(0, 1000, (400, 1, 3))
        offset = rng.integers(0, 2**32, (400, 1, 2), dtype=np.uint32)
        spread.append(error(sequences.unit(sequences.texel_dither(place)[..., :2] + offset), rng))
        independent.append(error(rng.random((400, 16, 2)), rng))
    # Measured: .55; a hash would give 1 +- .03
    assert np.mean(spread) < 0.7 * np.mean(independent)


def test_passes_are_better_than_independent_ones(rng):
    offset = rng.integers(0, 2**32, (400, 1, 2), dtype=np.uint32)
    errors = [
        error(sequences.unit(sequences.pair(np.arange(n)) + offset), rng) for n in (16, 64, 256)
    ]
    slope = np.polyfit(np.log([16, 64, 256]), np.log(errors), 1)[0]
    # Lines in two dimensions: -.75; independent numbers give -.5
    assert slope < -0.62
