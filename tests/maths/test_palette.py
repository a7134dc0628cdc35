"""Few colours for many: errors under bounds, mixtures whose mean is the colour, still dither."""

import numpy as np

from maths import palette


def test_no_more_colours_than_there_are() -> None:
    samples = np.array([[0, 0, 0], [255, 10, 3], [0, 0, 0]], np.uint8)
    assert palette.choose(samples, 255).tolist() == [[0, 0, 0], [255, 10, 3]]


def test_a_ramp_is_cut_into_even_steps() -> None:
    ramp = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    chosen = palette.choose(ramp, 16)
    # Sixteen codes each: their middles are 16 apart, and Lloyd's rounds move none by more than one
    assert np.all(np.abs(np.diff(chosen[:, 0].astype(int)) - 16) <= 2)
    assert len(chosen) == 16


def test_colours_that_are_rare_but_far_are_kept(rng: np.random.Generator) -> None:
    night = rng.integers(0, 40, (20000, 3), np.uint8)
    lamp = np.tile(np.array([250, 220, 90], np.uint8), (60, 1))
    chosen = palette.choose(np.concatenate([night, lamp]), 64).astype(int)
    # One of 64 colours stands for the lamp alone
    assert np.abs(chosen - lamp[0]).sum(axis=1).min() == 0


def test_thresholds_are_every_64th_once_and_spread() -> None:
    limits = palette.thresholds()
    assert np.array_equal(np.sort(limits.ravel()), (np.arange(64) + 0.5) / 64)
    # Any 4 x 4 of the 8 x 8 has one of each sixteenth: shares are even over small areas
    quarters = limits.reshape(2, 4, 2, 4).swapaxes(1, 2).reshape(4, 16)
    assert np.array_equal(
        np.sort(np.floor(quarters * 16), axis=1), np.tile(np.arange(16.0), (4, 1))
    )


def test_the_mean_of_a_dithered_colour_is_the_colour(rng: np.random.Generator) -> None:
    colours = np.array([[0, 0, 0], [200, 100, 50], [255, 255, 255]], np.uint8)
    table = palette.pairs(colours)
    for share in (0.1, 0.35, 0.8):
        wanted = np.rint(share * colours[1]).astype(np.uint8)
        flat = np.broadcast_to(wanted, (64, 64, 3))
        shown = colours[palette.dither(flat, colours, table)].mean(axis=(0, 1))
        # Shares come in 64ths of the 200 codes between the two, and the colour was rounded
        assert np.abs(shown - wanted).max() <= 200 / 64 / 2 + 0.5


def test_a_colour_of_the_palette_stays_itself(rng: np.random.Generator) -> None:
    colours = rng.integers(0, 256, (32, 3), np.uint8)
    index = palette.dither(colours[None], colours, palette.pairs(colours))
    assert np.abs(colours[index[0]].astype(int) - colours).max() <= 2 ** (8 - palette.BITS)


def test_what_stands_still_keeps_its_dots(rng: np.random.Generator) -> None:
    colours = palette.choose(rng.integers(0, 256, (4000, 3), np.uint8), 32)
    table = palette.pairs(colours)
    first = rng.integers(0, 256, (24, 40, 3), np.uint8)
    second = first.copy()
    second[:, 20:] = 7
    shown = [palette.dither(frame, colours, table)[:, :20] for frame in (first, second)]
    assert np.array_equal(*shown)
