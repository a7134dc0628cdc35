"""Knobs of a dome, and sets of lights that leave much open: each bounded, or refused."""

import numpy as np
import pytest

from bake import dome, dome_knobs, dome_report
from bake.photographs import Photographs, Space
from formats.errors import InputError
from maths import hemispherical_harmonics as harmonics
from maths.image_error import psnr
from pipelines.studies.glossy_ball import ball, lights


def test_leave_one_out_is_that_of_real_refits() -> None:
    photographs = Photographs(ball(lights(16), 6), lights(16), "linear")
    x = photographs.pictures.reshape(16, -1, 3).transpose(1, 0, 2).astype(np.float64)
    d = photographs.directions
    predicted = dome_knobs.left_out_psnr(x, d, "stored", 3, 0.1, 0.0)
    errors = []
    for n in range(16):
        keep = np.arange(16) != n
        # The penalty is a fraction of 16 lights, with a light less as well
        matrix = harmonics.fit_weights(d[keep], 3, 0.1 * 16 / 15).matrix
        value = harmonics.evaluate(d[n], 3) @ np.tensordot(matrix, x[:, keep], (1, 1)).swapaxes(
            0, 1
        )
        errors.append(psnr(np.clip(value, 0, 1), x[:, n]))
    assert predicted == pytest.approx(np.mean(errors), abs=1e-9)


def test_the_best_of_the_grid_is_chosen() -> None:
    photographs = Photographs(ball(lights(40), 20), lights(40), "linear")
    samples = dome.sample_of(photographs.pictures, np.arange(40))
    knobs = dome_knobs.choose(samples, photographs.directions, "linear")
    for penalty in dome_knobs.PENALTIES:
        rest = (knobs.bands, penalty, knobs.exponent)
        assert knobs.predicted >= dome_knobs.left_out_psnr(
            samples, photographs.directions, "linear", *rest
        )
    given = dome_knobs.choose(samples, photographs.directions, "stored", 5, 0.02)
    assert (given.bands, given.penalty, given.exponent) == (5, 0.02, 0.0)


def test_dark_values_of_glossy_things_are_saved_by_weights() -> None:
    normal = lights(50, 0.8)
    half = lights(40) + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    gloss = 0.9 * np.maximum(normal @ half.T, 0) ** 60
    value = 0.03 * np.maximum(normal @ lights(40).T, 0) + gloss
    samples = np.repeat(value[..., None], 3, axis=-1)
    knobs = dome_knobs.choose(samples, lights(40), "linear")
    plain = max(
        dome_knobs.left_out_psnr(samples, lights(40), "linear", b, q, 0.0)
        for b in dome_knobs.BANDS
        for q in dome_knobs.PENALTIES
    )
    assert knobs.exponent > 0
    # Measured: 21.41 dB against 21.01
    assert knobs.predicted > plain + 0.2


def test_amplification_is_the_worst_that_samples_can_do() -> None:
    d = lights(20)
    bound = dome_knobs.amplification_of(d, 4, 0.03)
    matrix = harmonics.fit_weights(d, 4, 0.03).matrix
    rows = harmonics.evaluate(dome_knobs.spiral(256, 0.0), 4) @ matrix
    worst = rows[np.argmax(np.abs(rows).sum(axis=1))]
    # Samples of the weights' own signs reach it, random ones do not
    assert worst @ np.sign(worst) == pytest.approx(bound, rel=1e-12)
    x = np.random.default_rng(4).uniform(-1, 1, (20, 1000))
    assert np.abs(rows @ x).max() < bound
    # A constant is all that one band can give
    assert dome_knobs.amplification_of(d, 1, 0.03) == pytest.approx(1.0)


def ring(elevation: float, count: int) -> np.ndarray:
    t = 2 * np.pi * np.arange(count) / count
    flat = np.cos(elevation)
    height = np.full(count, np.sin(elevation))
    return np.stack([flat * np.cos(t), flat * np.sin(t), height], axis=-1)


def bright(pictures: np.ndarray) -> np.ndarray:
    pictures[::3] = 1.0
    return pictures


def black(pictures: np.ndarray) -> np.ndarray:
    pictures[::3] = 0.0
    return pictures


# Lights, what is done to the pictures, the notes' word on where nothing was seen (None: no gap),
# and the largest gap in degrees. Values were measured within .35 below and above the photographs'
# 0..1 at all 64 lights of the hemisphere; without the bound of amplification they reached 6.3.
HARD = {
    "six": (lambda: lights(6), None, "elevation 5", 54),
    "one of six 20 times": (
        lambda: np.repeat(lights(6), [20, 1, 1, 1, 1, 1], axis=0), None, "elevation 5", 54),
    "all near the zenith": (lambda: lights(20, 0.995), None, "elevation 5", 80),
    "all near the horizon": (lambda: lights(2000, 0.001)[-20:], None, "elevation 89", 88),
    "one ring": (lambda: ring(0.6435, 12), None, "elevation 89", 52),
    "a gap of 200 degrees": (lambda: lights(60)[lights(60)[:, 0] > 0.2], None, "azimuth 17", 100),
    "a third overexposed": (lambda: lights(49), bright, None, 24),
    "a third black": (lambda: lights(49), black, None, 24),
}  # fmt: skip


@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize("space", ["linear", "stored"])
def test_hard_sets_stay_bounded_and_say_what_was_not_seen(name: str, space: Space) -> None:
    make, spoil, region, gap = HARD[name]
    d = make()
    pictures = ball(d, 8)
    pictures = spoil(pictures) if spoil else pictures
    asset = dome.fit(Photographs(pictures, d, space), params=dome.Params())
    basis = harmonics.evaluate(dome_knobs.spiral(100, 0.0), asset.quality["bands"])
    everywhere = asset.decoded() @ asset.constants(
        np.repeat(basis[..., None], 3, axis=-1)
    ).transpose(1, 0, 2).reshape(asset.channels, -1)
    # FARTHEST: from there on a note would be due, and there is none
    assert everywhere.max() - 1 < dome_report.FARTHEST - 1
    assert -everywhere.min() < dome_report.FARTHEST - 1
    assert asset.quality["amplification"] <= dome_knobs.AMPLIFICATION
    assert asset.quality["largest_gap_degrees"] == pytest.approx(gap, abs=1)
    notes = " ".join(asset.quality["notes"])
    assert ("a guess" in notes) == (region is not None)
    assert (region or "") in notes


def test_what_the_lights_leave_open_is_smoothed_away() -> None:
    """Lights on an arc say nothing across it: bands fall until answers are bounded, with a note."""
    d = ring(1.2, 400)[:8]
    samples = np.random.default_rng(3).random((20, 8, 3))
    knobs = dome_knobs.choose(samples, d, "stored")
    assert knobs.amplification <= dome_knobs.AMPLIFICATION
    given = dome_knobs.choose(samples, d, "stored", 6, 1e-9)
    assert given.amplification > 100
    assert "the lights leave much open: 6 bands" in given.notes[0]


def test_values_far_outside_are_told() -> None:
    d = ring(1.2, 400)[:8]
    pictures = np.random.default_rng(3).random((8, 4, 4, 3)).astype(np.float32)
    asset = dome.fit(Photographs(pictures, d, "linear"), params=dome.Params(bands=6, penalty=1e-9))
    assert any("gives values from" in note for note in asset.quality["notes"])


@pytest.mark.parametrize(
    "d",
    [lights(4), np.repeat(lights(5), 4, axis=0), np.repeat([[0.0, 0.0, 1.0]], 30, axis=0)],
    ids=["four", "five places", "one place"],
)
def test_too_few_lights_are_refused(d: np.ndarray) -> None:
    with pytest.raises(InputError, match="needs 6 or more"):
        dome.fit(Photographs(ball(d, 4), d, "linear"), params=dome.Params())


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_sets_that_are_black_or_white_stay_so(value: float) -> None:
    d = lights(12)
    flat = Photographs(np.full((12, 3, 3, 3), value, np.float32), d, "stored")
    asset = dome.fit(flat, params=dome.Params())
    assert asset.quality["minimum"] == pytest.approx(value, abs=1e-5)
    assert asset.quality["maximum"] == pytest.approx(value, abs=1e-5)
