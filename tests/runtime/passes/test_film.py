"""The film against its numpy twin, code by code."""

from __future__ import annotations

import numpy as np
import pytest

from maths import colour
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = (64, 48)
SKY = {"zenith": [0.02, 0.2, 2.0], "horizon": [1.5, 0.3, 0.01]}
CAMERA = {"position": [0, 1, 0], "target": [0, 2, -2], "focal_length_mm": 15}


def develop(linear, film, frame_number):
    """Slow truth of film.frag on linear radiance (h, w, 3), row 0 on top: uint8."""
    h, w, _ = linear.shape
    y, x = np.mgrid[0:h, 0:w]
    off = (
        (np.stack([x + 0.5, y + 0.5], axis=-1) * 2 / [w, h] - 1) * np.array([w, h]) / np.hypot(w, h)
    )
    cosine2 = 1 / (1 + np.sum(off**2, axis=-1, keepdims=True))
    vignette = film.get("vignette", 0.0)
    radiance = linear * 2 ** film.get("exposure", 0.0) * (1 + (cosine2**2 - 1) * vignette)
    shown = colour.TONEMAPS[film.get("tonemap", "filmic")](radiance)
    # The card counts rows from the bottom
    return colour.quantise(colour.srgb_encode(shown), colour.dither(x, h - 1 - y, frame_number))


@pytest.mark.parametrize(
    "film",
    [
        {"tonemap": "linear"},
        {"tonemap": "filmic", "exposure": -1.5},
        {"vignette": 0.7, "exposure": 1.0},
    ],
)
def test_the_film_is_its_twin(kit, write_scene, ctx, film):
    raw = kit.scene_dict(
        billboards=None,
        camera=CAMERA,
        picture={"sky": SKY, "film": film},
        time={"frame_rate": 10.0},
    )
    with Player(write_scene(raw, {}), size=SIZE, context=ctx) as player:
        picture = player.frame(0.7)
        expected = develop(player.linear(0.7)[..., :3].astype(float), film, 7)
    assert (picture[..., 3] == 255).all()
    difference = np.abs(picture[..., :3].astype(int) - expected)
    # The driver's pow may move a value over the edge between two codes, here and there
    assert difference.max() <= 1
    assert np.count_nonzero(difference) < 0.005 * difference.size


def test_the_dither_moves_with_the_frame_and_not_with_the_run(kit, write_scene, ctx):
    raw = kit.scene_dict(
        billboards=None,
        camera=CAMERA,
        picture={"sky": SKY},
        time={"duration": 2.0, "frame_rate": 10.0},
    )
    with Player(write_scene(raw, {}), size=SIZE, context=ctx) as player:
        first, next_one, again = player.frame(0.0), player.frame(0.1), player.frame(0.0)
    np.testing.assert_array_equal(first, again)
    assert (first != next_one).any()
    assert np.abs(first.astype(int) - next_one).max() <= 1


# grain

GREY = {"zenith": [0.2] * 3, "horizon": [0.2] * 3}
FRAMES = 12


def grainy(kit, write_scene, ctx, radiance=None, **film):
    """Codes (frames, h, w, 3) of a plain sky, without and with grain."""
    sky = GREY if radiance is None else {"zenith": [radiance] * 3, "horizon": [radiance] * 3}
    found = []
    for grain in (0.0, film.get("grain", 6.0)):
        raw = kit.scene_dict(
            billboards=None,
            camera=CAMERA,
            picture={"sky": sky, "film": {"tonemap": "linear", "grain": grain}},
            time={"duration": 2.0, "frame_rate": 10.0},
        )
        folder = write_scene(raw, {}, name=f"grain{grain:g}")
        with Player(folder, size=SIZE, context=ctx) as player:
            frames = [player.frame(0.1 * n)[..., :3].astype(float) for n in range(FRAMES)]
        found.append(np.array(frames))
    return found


# Mid grey, and near both ends, where clipping would move the mean
@pytest.mark.parametrize("radiance", [0.212, 0.0003, 0.99])
def test_grain_leaves_the_mean_of_the_codes(kit, write_scene, ctx, radiance):
    without, noisy = grainy(kit, write_scene, ctx, radiance, grain=16.0)
    encoded = colour.srgb_encode(radiance)
    # Half floats and single precision move the code itself: it is that of the picture without
    code = without.mean()
    assert code == pytest.approx(255 * encoded, abs=0.06)
    # The dither's rounding has the variance of 1/4 at most
    deviation = np.hypot(16.0 * 4 * encoded * (1 - encoded), 0.5)
    # Noise is the same in all channels: as many independent numbers as pixels
    n = noisy[..., 0].size
    assert abs(noisy.mean() - code) < 4.5 * deviation / np.sqrt(n) + 0.5 / np.sqrt(n)
    grain = np.sqrt(max(noisy[..., 0].var() - without[..., 0].var(), 0.0))
    assert grain == pytest.approx(16.0 * 4 * encoded * (1 - encoded), abs=0.3)


def test_grain_has_no_pattern_in_space_or_time(kit, write_scene, ctx):
    _, noisy = grainy(kit, write_scene, ctx)
    noise = noisy[..., 0] - noisy[..., 0].mean()
    n = noise.size
    spectrum = np.abs(np.fft.rfftn(noise)) ** 2
    correlation = np.fft.irfftn(spectrum, s=noise.shape, axes=(0, 1, 2)) / (n * noise.var())
    near = correlation[:4, :8, :8].ravel()[1:] * np.sqrt(n)
    # The dither's own pattern has 1/12 of 36: its correlations count for so little
    assert np.abs(near).max() < 4.5
    assert abs((near**2).mean() - 1.0) < 4.5 * np.sqrt(2 / near.size)


@pytest.mark.parametrize("strength", [3.0, 16.0])
def test_grain_is_its_twin(kit, write_scene, ctx, strength):
    from maths import grain

    film = {"tonemap": "linear", "grain": strength}
    raw = kit.scene_dict(
        billboards=None,
        camera=CAMERA,
        picture={"sky": SKY, "film": film},
        time={"frame_rate": 10.0},
    )
    with Player(write_scene(raw, {}), size=SIZE, context=ctx) as player:
        picture = player.frame(0.7)[..., :3].astype(int)
        linear = player.linear(0.7)[..., :3].astype(float)
    h, w, _ = linear.shape
    y, x = np.mgrid[0:h, 0:w]
    encoded = colour.srgb_encode(np.clip(linear, 0, 1))
    noise = strength * grain.grain(x, h - 1 - y, 7)[..., None] * grain.strength(encoded)
    expected = colour.quantise(encoded, colour.dither(x, h - 1 - y, 7) + noise)
    difference = np.abs(picture - expected)
    # As above
    assert difference.max() <= 1
    assert np.count_nonzero(difference) < 0.005 * difference.size


def test_without_grain_nothing_of_it_is_compiled():
    from pathlib import Path

    from runtime.passes import film
    from runtime.shader import compose

    path = Path(film.__file__).with_name("film.frag")
    with_grain = compose(path, {"FILMIC": 0, "GRAIN": 1}).text
    without = compose(path, {"FILMIC": 0, "GRAIN": 0}).text
    assert without == with_grain.replace("#define GRAIN 1", "#define GRAIN 0")
    # All of it stands within its switch
    kept, depth = [], 0
    for line in without.splitlines():
        if line.startswith("#if"):
            depth += depth > 0 or line == "#if GRAIN"
        elif line.startswith("#endif"):
            depth -= depth > 0
        elif depth == 0:
            kept.append(line)
    assert "dither" in "".join(kept)
    assert "pcg" not in "".join(kept)
    assert "grain" not in "".join(line.partition("//")[0] for line in kept)
