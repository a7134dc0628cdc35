"""Pictures out of focus: coarse levels look round, and nothing of their light is lost."""

from __future__ import annotations

import numpy as np
import pytest

from formats.picture import Picture
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE, FRAME = 64, 128


def dot(texels):
    """A bell of this width at 1/e, in texels of level 0, as it is on each level."""
    levels = []
    for n in range(5):
        size = SIZE >> n
        away = np.arange(size) + 0.5 - size / 2
        bell = np.exp(-((away * 2.0**n / texels) ** 2))
        light = np.where(np.abs(away) < size / 2 - 1, bell, 0.0)
        rgba = np.repeat(np.outer(light, light)[..., None], 4, axis=-1)
        levels.append(rgba[None].astype(np.float16))
    return Picture(
        levels=tuple(levels),
        metres_per_texel=1 / SIZE,
        pivot=(SIZE / 2, float(SIZE)),
        height=1.0,
        max_lod=4.0,
        lens_scale=0.43,
    )


@pytest.fixture
def blurred(kit, write_scene, ctx):
    """Return blurred(level) -> (FRAME, FRAME), two pixels a texel; without a lens under 0."""

    def show(level, texels=10.0):
        # A circle of 2^level / .43 texels: A |focus - d| / (focus - f) metres, A the aperture
        away, f = 50 / 24, 0.2
        aperture = 2.0**level / 0.43 / SIZE * (2 * away - f) / away
        lens = {"f_number": f / aperture, "focus_distance": 2 * away}
        camera = {"position": [0, 0.5, away], "target": [0, 0.5, 0], "focal_length_mm": 1e3 * f}
        camera |= {"sensor_height_mm": 96.0} | ({"lens": lens} if level >= 0 else {})
        one = {"name": "dot", "source": "pictures/dot.png", "height": 1.0}
        one |= {"facing": "camera", "positions": [[0, 0.5, 0]]}
        raw = kit.scene_dict(camera=camera, billboards=[one], lights=[])
        folder = write_scene(raw, {"dot": dot(texels)}, name=f"scene{round(100 * level)}")
        with Player(folder, size=(FRAME, FRAME), context=ctx) as player:
            return player.linear(0.0)[..., 0].astype(np.float64)

    return show


def around(picture, radius):
    """Values on a circle about the middle, bilinear: 0, 45, 90 ... degrees."""
    turn = np.arange(8) * np.pi / 4
    x, y = (FRAME / 2 - 0.5 + radius * f(turn) for f in (np.cos, np.sin))
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    u, v = y - i, x - j
    rows = [(1 - v) * picture[i + k, j] + v * picture[i + k, j + 1] for k in (0, 1)]
    return (1 - u) * rows[0] + u * rows[1]


@pytest.mark.parametrize("level", [2.5, 3.0, 3.5])
def test_a_dot_is_round(blurred, level):
    found = blurred(level)
    for radius in (8, 16, 24):
        ring = around(found, radius)
        # Measured 0.2 to 1.5 % of the middle; with tents 4 to 8 % at half of these radii
        assert np.ptp(ring) < 0.025 * found.max(), (radius, ring)


def test_blur_keeps_the_light(blurred):
    sums = [blurred(level).sum() for level in (-1, 2.0, 2.7, 3.0)]
    # Weights sum to one; the levels themselves differ by their samples of the bell, under 1 %
    np.testing.assert_allclose(sums, sums[0], rtol=0.01)


def test_it_comes_in_with_the_blur(blurred):
    """Next to focus a texel is as sharp as ever: at once, the kernel would take a fifth of it."""
    sharp, softer = blurred(-1, texels=0.6), blurred(0.05, texels=0.6)
    assert sharp.max() > 0.2
    # A twentieth of the way to level 1, where next to nothing is left, and to the kernel
    assert 0.9 * sharp.max() < softer.max() < sharp.max()
