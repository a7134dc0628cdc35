"""Grain has mean 0, deviation 1, no pattern in space or time, and clips nothing."""

import numpy as np
import pytest

from maths import colour, grain

WIDTH, HEIGHT, FRAMES = 128, 96, 24
MOST = 4.5  # standard errors: chance passes it once in 150,000


@pytest.fixture(scope="module")
def noise() -> np.ndarray:
    frame, y, x = np.mgrid[:FRAMES, :HEIGHT, :WIDTH]
    return grain.grain(x, y, frame)


def test_mean_and_moments_are_those_of_a_sum_of_four_bytes(noise: np.ndarray) -> None:
    n = noise.size
    assert abs(noise.mean()) < MOST / np.sqrt(n)
    # Four uniform numbers have the excess kurtosis -6/5 / 4 (of bytes the same to 1e-5)
    kurtosis = 3.0 - 0.3
    assert abs((noise**2).mean() - 1.0) < MOST * np.sqrt((kurtosis - 1.0) / n)
    assert abs((noise**3).mean()) < MOST * np.sqrt((noise**6).mean() / n)
    assert (noise**4).mean() == pytest.approx(kurtosis, abs=MOST * np.sqrt((noise**8).mean() / n))
    assert np.abs(noise).max() <= 510.0 / grain.DEVIATION


def test_each_frame_has_its_own_mean_within_its_error(noise: np.ndarray) -> None:
    means = noise.mean(axis=(1, 2)) * np.sqrt(WIDTH * HEIGHT)
    assert np.abs(means).max() < MOST
    # Their spread is that of means of independent numbers: chi^2 of 24
    assert abs((means**2).sum() - FRAMES) < MOST * np.sqrt(2.0 * FRAMES)


def test_there_is_no_pattern_in_space_or_time(noise: np.ndarray) -> None:
    """Every correlation over a few pixels and frames lies within its error, as do all together."""
    spectrum = np.fft.rfftn(noise)
    correlation = np.fft.irfftn(np.abs(spectrum) ** 2, s=noise.shape, axes=(0, 1, 2)) / noise.size
    near = correlation[:9, :12, :12].ravel()[1:] * np.sqrt(noise.size)
    assert np.abs(near).max() < MOST
    assert abs((near**2).mean() - 1.0) < MOST * np.sqrt(2.0 / near.size)
    # No frequency stands out either: powers are spread as those of noise, exponentially
    power = np.abs(spectrum[:, 1:, 1:-1]).ravel() ** 2 / noise.size
    assert power.max() < np.log(power.size) + 12.0
    assert power.mean() == pytest.approx(1.0, abs=MOST / np.sqrt(power.size))


def test_it_has_nothing_to_do_with_the_dither(noise: np.ndarray) -> None:
    frame, y, x = np.mgrid[:FRAMES, :HEIGHT, :WIDTH]
    dither = colour.dither(x, y, frame) * np.sqrt(12.0)
    assert np.abs((noise[..., None] * dither).mean(axis=(0, 1, 2))).max() < MOST / np.sqrt(
        noise.size
    )


def test_no_code_is_clipped_even_at_the_strongest() -> None:
    encoded = np.linspace(0.0, 1.0, 4097)
    reach = 16.0 * grain.strength(encoded) * 510.0 / grain.DEVIATION
    assert (255.0 * encoded - reach >= 0.0).all()
    assert (255.0 * encoded + reach <= 255.0).all()
