"""Radial blur against the mean of the picture along each streak, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from maths import colour
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = (128, 72)


@pytest.fixture
def blurred(kit, write_scene, ctx):
    """Return blurred(table, picture) -> what the pass makes of radiance (h, w, 3), row 0 on top."""
    count = iter(range(100))

    def blur(table, picture):
        h, w, _ = picture.shape
        raw = kit.scene_dict(billboards=None, picture={"radial_blur": table})
        folder = write_scene(raw, {}, name=f"s{next(count)}")
        with Player(folder, size=(w, h), context=ctx) as player:
            player.draw(0.0, finished=False)
            full = np.ones((h, w, 4), np.float16)
            full[..., :3] = picture[::-1]
            target = player.targets.texture("colour")
            target.write(full.tobytes(), alignment=1)
            player.passes["radial_blur"].draw(0.0)
            found = np.frombuffer(target.read(alignment=1), np.float16).reshape(h, w, 4)
        return found[::-1, :, :3].astype(np.float64)

    return blur


def streaks(table, size=SIZE):
    """Streaks (h, w, 2) in pixels, x to the right and y down, and pixel centres (h, w, 2)."""
    centre = np.array(table.get("centre", [0.5, 0.5])) * size
    y, x = np.mgrid[: size[1], : size[0]] + 0.5
    places = np.stack([x, y], axis=-1)
    return table["strength"] * (centre - places), places


def grey(values):
    return np.repeat(values[..., None], 3, axis=-1)


def counts(streak, samples):
    return np.clip(np.ceil(np.hypot(*np.moveaxis(streak, -1, 0))), 1, samples)


def test_a_constant_picture_stays_as_it_is(blurred):
    even = np.broadcast_to(np.float16([0.3, 1.0, 7.3]).astype(float), (72, 128, 3))
    found = blurred({"strength": 0.5, "samples": 13}, even)
    # A sum of 13 numbers over 13 in single precision, rounded to the half float it was
    np.testing.assert_array_equal(found, even)


@pytest.mark.parametrize("centre", [[0.5, 0.5], [0.2, 0.9], [0.0, 1.0]])
def test_around_the_centre_not_a_bit_changes(blurred, rng, centre):
    picture = rng.uniform(0, 4, (72, 128, 3)).astype(np.float16).astype(float)
    table = {"strength": 0.1, "centre": centre}
    found = blurred(table, picture)
    near = np.hypot(*np.moveaxis(streaks(table)[0], -1, 0)) < 0.5
    # A disc of 5 pixels, or as much of one as lies in the picture
    assert near.sum() > 15
    np.testing.assert_array_equal(found[near], picture[near])
    changed = (found != picture).any(axis=-1)
    assert changed[~near].mean() > 0.99


@pytest.mark.parametrize("samples", [2, 5, 32])
def test_a_ramp_moves_by_half_a_streak(blurred, samples):
    table = {"strength": 0.4, "centre": [0.3, 0.6], "samples": samples}
    streak, places = streaks(table)
    found = blurred(table, grey(places[..., 0] / 128))[..., 0]
    # Bilinear between pixel centres a ramp is itself but outside the outermost centres
    inside = (places[..., 0] > 2) & (places[..., 0] < 126)
    expected = (places[..., 0] + 0.5 * streak[..., 0]) / 128
    error = (found - expected)[inside]
    step = (np.abs(streak[..., 0]) / counts(streak, samples))[inside] / 128
    # Steps start up to half a step beside their middle; below 1 a half float rounds by 2^-12 as the
    # ramp is written, and is cut off by 2^-11 as a driver may write the result
    assert (np.abs(error) <= 0.5 * step + 3 * 2.0**-12 + 1e-5).all()
    # Over the picture the starts even out, and what is left is what the driver cuts off
    signed = error * np.sign(streak[..., 0])[inside]
    assert abs(signed.mean()) < 0.01 * step.mean() + 2.0**-12


@pytest.mark.parametrize("samples", [4, 64])
def test_a_step_is_smeared_over_the_streaks_that_cross_it(blurred, samples):
    table = {"strength": 0.5, "samples": samples}
    streak, places = streaks(table)
    edge = 96.0
    found = blurred(table, grey((places[..., 0] > edge).astype(float)))[..., 0]
    start, along = places[..., 0], streak[..., 0]
    # Share of the way that lies beyond the edge, which only streaks from the right cross
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip((start - edge) / -along, 0.0, 1.0)
    expected = np.where(start > edge, np.where(start + along > edge, 1.0, share), 0.0)
    # One sample more or less, and the bilinear edge is a pixel wide: half a sample over it
    pitch = np.abs(along) / counts(streak, samples)
    most = 1.0 / counts(streak, samples) + 1.0 / np.maximum(np.abs(along), 1.0)
    assert (np.abs(found - expected) <= most + 2.0**-11).all()
    # Dithered, few samples give the mean of many: over blocks of 8 x 8 the error shrinks
    error = np.abs((found - expected).reshape(9, 8, 16, 8).mean(axis=(1, 3)))
    assert error.max() < 0.35 / samples + 0.02
    assert pitch.max() > 1.0 or samples == 64


def test_the_starts_of_neighbours_differ_so_that_nothing_bands():
    """The same starts in all pixels would show the steps: 4 samples make 4 steps of a quarter."""
    y, x = np.mgrid[:72, :128]
    start = 0.5 + colour.dither(x, y)[..., 0]
    blocks = start.reshape(9, 8, 16, 8).mean(axis=(1, 3))
    # R2: blocks of 64 starts have a mean within 2 % of a half, where chance would have 4 %
    assert np.abs(blocks - 0.5).max() < 0.03
    assert start.std() == pytest.approx(1 / np.sqrt(12), rel=0.01)


def test_strength_nought_makes_nothing(kit, write_scene, ctx):
    strength = {"times": [0.0, 1.0], "values": [0.0, 0.5]}
    raw = kit.scene_dict(billboards=None, picture={"radial_blur": {"strength": strength}})
    with Player(write_scene(raw, {}), size=SIZE, context=ctx) as player:
        player.draw(0.0)
        before = player.profile
        player.draw(1.0)
        after = player.profile
    assert before["by_pass"]["radial_blur"]["draw_calls"] == 0
    assert after["by_pass"]["radial_blur"]["draw_calls"] == 1
    assert after["by_pass"]["radial_blur"]["programs"] == 1
    assert after["textures"] - before["textures"] == 1
    assert after["bytes"] - before["bytes"] == 8 * SIZE[0] * SIZE[1]
