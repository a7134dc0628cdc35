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
