"""Transfer functions, tone curves and dither."""

import numpy as np
import pytest

from maths.colour import (
    FILMIC_HALF,
    TONEMAPS,
    dither,
    luminance,
    quantise,
    srgb_decode,
    srgb_encode,
    tonemap_filmic,
)


def test_all_codes_survive_the_round_trip() -> None:
    codes = np.arange(256)
    assert np.array_equal(quantise(srgb_encode(srgb_decode(codes / 255))), codes)


def test_transfer_is_monotone_and_meets_at_the_knee() -> None:
    x = np.linspace(0, 1, 10_001)
    assert np.all(np.diff(srgb_encode(x)) > 0)
    assert np.all(np.diff(srgb_decode(x)) > 0)
    # The standard's rounded constants leave a step of 3e-8 at the knee
    step = srgb_encode(0.0031308 * (1 + 1e-12)) - srgb_encode(0.0031308)
    assert abs(step) < 1e-7
    assert np.allclose(srgb_encode([-1.0, 9.0]), [0, 1], rtol=0, atol=2e-16)
    assert np.allclose(srgb_decode(srgb_encode(x)), x, rtol=0, atol=1e-7)


def test_luminance_weighs_channels() -> None:
    assert luminance([[1, 0, 0], [0, 1, 0], [0, 0, 1]]).tolist() == [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize("name", sorted(TONEMAPS))
def test_tonemaps_are_bounded_and_finite(name: str) -> None:
    wild = [[-1.0, 0.0, 1e-300], [1e30, 0.0, 0.0], [np.inf, np.inf, np.inf], [1e4, 1.0, 1e-4]]
    shown = TONEMAPS[name](wild)
    assert np.all((shown >= 0) & (shown <= 1))
    assert TONEMAPS[name](np.zeros(3)).tolist() == [0, 0, 0]


def test_filmic_keeps_grey_neutral_and_monotone() -> None:
    grey = np.geomspace(1e-5, 1e4, 500)[:, None] * np.ones(3)
    shown = tonemap_filmic(grey)
    # Greys mix with themselves: rounding only
    assert np.ptp(shown, axis=1).max() < 1e-14
    assert np.all(np.diff(shown[:, 0]) > 0)
    p = grey[:, 0] ** 1.3
    assert np.allclose(shown[:, 0], p / (p + FILMIC_HALF), rtol=1e-12)
    assert shown[-1, 0] > 0.999


def test_filmic_keeps_the_order_of_channels(rng: np.random.Generator) -> None:
    rgb = np.sort(np.exp(rng.normal(0, 2, (2000, 3))), axis=1)
    assert np.all(np.diff(tonemap_filmic(rgb), axis=1) >= 0)


def test_filmic_turns_bright_colours_pale_and_keeps_deep_ones_deep() -> None:
    lamp = np.array([34.0, 15.0, 4.5]) / 34.0
    saturation = []
    for stop in (-4, 0, 4, 8):
        shown = tonemap_filmic(lamp * 2.0**stop)
        saturation.append(1 - shown.min() / shown.max())
    assert np.all(np.diff(saturation) < 0)
    assert saturation[0] >= 1 - lamp.min()
    assert saturation[-1] < 0.1


def test_filmic_does_not_swing_orange_to_yellow() -> None:
    # An orange lamp over white clamps to yellow (green = red); the curve keeps them apart
    orange = np.array([1.0, 0.35, 0.05]) * 3
    clamped, shown = np.clip(orange, 0, 1), tonemap_filmic(orange)
    assert clamped[1] / clamped[0] == 1
    assert shown[1] / shown[0] < 0.8


def test_dither_spreads_evenly_and_keeps_codes() -> None:
    y, x = np.mgrid[:64, :64]
    offset = dither(x, y, 3)
    assert offset.shape == (64, 64, 3)
    assert np.abs(offset).max() < 0.5
    assert np.array_equal(offset, offset.astype(np.float32))
    # 4096 points of a lattice sequence: mean within 1 / sqrt(12 N) of zero at worst, far less here
    assert np.abs(offset.mean(axis=(0, 1))).max() < 0.0045
    codes = np.arange(256)[:, None, None, None] / 255
    assert np.array_equal(
        quantise(codes, offset[:8, :8]),
        np.broadcast_to(np.arange(256)[:, None, None, None], (256, 8, 8, 3)),
    )


def test_dither_shows_a_shade_between_codes() -> None:
    y, x = np.mgrid[:32, :32]
    for value in (10.25, 99.5, 200.9):
        shown = quantise(value / 255, dither(x, y, 0)).mean()
        assert abs(shown - value) < 0.02  # 3072 offsets, discrepancy of R2 about log N / N


def test_dither_changes_from_frame_to_frame() -> None:
    assert np.abs(dither(5, 6, 0) - dither(5, 6, 1)).min() > 0.01


def test_quantise_clamps() -> None:
    assert quantise([-0.2, 0.499 / 255, 0.5 / 255, 1.7]).tolist() == [0, 0, 1, 255]
