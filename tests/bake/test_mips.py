"""Mip chains: energy, borders, the slow convolution; packed sprites and their losses."""

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bake import billboard, mips, sources
from bake.mips import FILTERS, Params, decoded, kernel_of, mip_chain, pack
from formats.errors import InputError
from maths import sprite_packing
from tests.bake import small_meshes, stage_battery


def content(rng, size=64, inner=24, layers=2):
    """Random positive values in the middle of an empty picture (layers, size, size, 4)."""
    image = np.zeros((layers, size, size, 4), np.float32)
    start = (size - inner) // 2
    stop = start + inner
    image[:, start:stop, start:stop] = rng.random((layers, inner, inner, 4))
    return image


@pytest.mark.parametrize("filter", FILTERS)
@pytest.mark.parametrize("ratio", [2, 4])
def test_kernels_are_symmetric_and_sum_to_one(filter, ratio):
    kernel = kernel_of(filter, ratio).astype(np.float64)
    assert kernel.sum() == pytest.approx(1, abs=kernel.size * 2.0**-24 / 4)
    np.testing.assert_array_equal(kernel, kernel.T)
    np.testing.assert_array_equal(kernel, kernel[::-1])
    np.testing.assert_array_equal(kernel, kernel[:, ::-1])
    # Wide enough for the filter, and no wider than a whole texel around it
    reach = len(kernel) / 2 / ratio
    assert FILTERS[filter].half_width <= reach < FILTERS[filter].half_width + 1 / ratio


def test_kernels_have_the_variance_of_their_filters():
    """Second moment along one axis, in texels of the level that the kernel makes."""

    def variance(filter):
        kernel = kernel_of(filter, 32).astype(np.float64)
        x = (np.arange(len(kernel)) + 0.5 - len(kernel) / 2) / 32
        return float(kernel.sum(axis=0) @ x**2)

    # Weights stand at the centres of 32 texels a side: 1 / 32^2 of the variance at the rim
    assert variance("box") == pytest.approx(1 / 12, rel=2e-3)
    # Discs overlap: sharing texels out evenly takes 8 % (measured) of what lies under two of them
    assert variance("disc") == pytest.approx(0.922 * FILTERS["disc"].half_width ** 2 / 4, rel=5e-3)
    # Cut off at 2.5 deviations in two dimensions
    sigma = FILTERS["gaussian"].half_width / 2.5
    kept = 1 - 2.5**2 / 2 * np.exp(-(2.5**2) / 2) / (1 - np.exp(-(2.5**2) / 2))
    assert variance("gaussian") == pytest.approx(sigma**2 * kept, rel=2e-3)


def phases(filter, ratio):
    """What each fine texel gives to all coarse ones together, 1 where energy is conserved."""
    kernel = kernel_of(filter, ratio).astype(np.float64)
    parts = [kernel[i::ratio, j::ratio].sum() for i in range(ratio) for j in range(ratio)]
    return np.array(parts) * ratio**2


@pytest.mark.parametrize("filter", FILTERS)
@pytest.mark.parametrize("ratio", [2, 4])
def test_fine_texels_are_weighed_evenly(filter, ratio):
    """A partition of unity, to the rounding of up to 16 float32 weights."""
    np.testing.assert_allclose(phases(filter, ratio), 1, atol=1e-6)


@pytest.mark.parametrize("filter", FILTERS)
def test_energy_is_conserved_at_every_level(filter, rng):
    """The sum of premultiplied values, whatever the picture."""
    image = content(rng, 128, 24)
    total = image.sum(axis=(1, 2), dtype=np.float64)
    for level, coarse in enumerate(mip_chain(image, 4, filter)):
        energy = coarse.sum(axis=(1, 2), dtype=np.float64) * 4.0**level
        # Sums of up to 144 float32 products
        np.testing.assert_allclose(energy, total, rtol=2e-5)


@pytest.mark.parametrize("filter", FILTERS)
def test_borders_are_zero_at_every_level(filter, rng):
    image = rng.random((2, 64, 96, 4)).astype(np.float32)
    levels = mip_chain(image, 5, filter)
    assert [lv.shape[1:3] for lv in levels] == [(64 >> i, 96 >> i) for i in range(5)]
    for level in levels:
        for edge in (level[:, 0], level[:, -1], level[:, :, 0], level[:, :, -1]):
            np.testing.assert_array_equal(edge, 0)
        assert (level[:, 1:-1, 1:-1] > 0).all()


def test_the_chain_leaves_its_input_alone(rng):
    image = rng.random((1, 16, 16, 4)).astype(np.float32)
    before = image.copy()
    mip_chain(image, 3, "gaussian")
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("filter", FILTERS)
def test_a_constant_stays_constant_inside(filter):
    image = np.full((1, 128, 128, 4), 0.7, np.float32)
    for level, coarse in enumerate(mip_chain(image, 5, filter)):
        # Farther from the edge than the kernel reaches, and than the border
        margin = int(np.ceil(FILTERS[filter].half_width)) + 1
        inner = coarse[:, margin:-margin, margin:-margin]
        assert inner.size or level == 4
        np.testing.assert_allclose(inner, 0.7, rtol=2e-6)  # sums of up to 144 float32 products


def slow_level(image, filter, level):
    """Average level 0 over the filter about each coarse texel: the obvious way, by a kernel
    2^level times as wide, of 8 x 8 points a fine texel."""
    ratio, half = 2**level, FILTERS[filter].half_width
    fine = int(np.ceil(half * ratio))
    points = ((np.arange(2 * fine * 8) + 0.5) / 8 - fine) / ratio
    y, x = np.meshgrid(points, points, indexing="ij")
    if filter == "box":
        weight = (np.abs(x) < half) & (np.abs(y) < half)
    elif filter == "disc":
        weight = x * x + y * y < half * half
    elif filter == "gaussian":
        r = (x * x + y * y) / half**2
        weight = np.where(r < 1, np.exp(-0.5 * 2.5**2 * r), 0)
    else:
        weight = mips._kaiser(x, half) * mips._kaiser(y, half)
    weight = weight.reshape(2 * fine, 8, 2 * fine, 8).sum(axis=(1, 3), dtype=np.float64)
    # What a fine texel gives to all the coarse ones that see it is the whole of it
    for row, column in np.ndindex(ratio, ratio):
        place = np.s_[row::ratio, column::ratio]
        weight[place] = weight[place] / weight[place].sum() / ratio**2
    size = image.shape[1] // ratio
    wide = np.pad(image[0, :, :, 0].astype(np.float64), fine)
    coarse = np.zeros((size, size))
    for row, column in np.ndindex(coarse.shape):
        top, left = (int((i + 0.5) * ratio) for i in (row, column))
        coarse[row, column] = np.sum(weight * wide[top : top + 2 * fine, left : left + 2 * fine])
    return coarse


# Level 1 is filtered from level 0, and so is level 2: float32 sums are left. Level 3 is filtered
# from means of 2x2 texels, which resolve the kernel half as finely. RMS in the interior of a random
# picture over that of the picture at this level, measured: 6e-8, .014, .0054, .0044
SLOW = {"box": 1e-6, "disc": 0.02, "gaussian": 0.01, "kaiser": 0.02}


@pytest.mark.parametrize("filter", FILTERS)
def test_against_the_slow_convolution(filter, rng):
    image = content(rng, 128, 96, 1)
    levels = mip_chain(image, 4, filter)
    for level in (1, 2, 3):
        expected = slow_level(image, filter, level)[2:-2, 2:-2]
        error = levels[level][0, 2:-2, 2:-2, 0] - expected
        if level < 3:
            assert np.abs(error).max() < 2e-6
        else:
            assert np.sqrt(np.mean(error**2)) < SLOW[filter] * np.sqrt(np.mean(expected**2))


@pytest.mark.parametrize("filter", FILTERS)
@pytest.mark.parametrize("max_lod", [0.0, 1.0, 2.5, 4.0])
def test_blurred_content_never_meets_the_border(filter, max_lod, rng):
    """T-row of the border: with content right up to the border, the outermost texels of every level
    up to max_lod are zero before anything sets them to zero."""
    params = Params(filter=filter, max_lod=max_lod)
    border = mips.border_of(params)
    assert border >= 2 ** np.ceil(max_lod)
    count = int(np.ceil(max_lod)) + 1
    step = 1 << (count - 1)
    # The worst case: nothing is added to round the size up to whole coarse texels
    inner = 4 * step - 2 * border % step
    image = np.zeros((1, inner + 2 * border, inner + 2 * border, 4), np.float32)
    image[:, border:-border, border:-border] = 1 + rng.random((1, inner, inner, 4))
    average, averages = image, [image]
    for _ in range(1, count):
        average = sum(average[:, i::2, j::2] for i in (0, 1) for j in (0, 1)) / 4
        averages.append(average)
    for level in range(1, count):
        ratio = 2 if level == 1 else 4
        coarse = mips._filtered(averages[max(0, level - 2)], kernel_of(filter, ratio), ratio)
        for edge in (coarse[:, 0], coarse[:, -1], coarse[:, :, 0], coarse[:, :, -1]):
            np.testing.assert_array_equal(edge, 0)
        assert coarse[:, 1:-1].max() > 0.5


@cache
def master(terms=5, views=1, held_out=8):
    """A sphere of many colours on a slab."""
    rng = np.random.default_rng(5)
    ball = small_meshes.sphere(24, 48)
    ball = replace(ball, colours=rng.uniform(0.05, 0.9, (len(ball.vertices), 3)).astype(np.float32))
    slab = small_meshes.box((1.4, 0.1, 1.2), (0, -1.1, 0))
    return billboard.trace(
        small_meshes.joined(ball, slab),
        params=billboard.Params(resolution=64, terms=terms, views=views, held_out=held_out),
    )


@pytest.mark.parametrize("depth", ["8", "16"])
@pytest.mark.parametrize("packing", ["full", "twelve"])
@pytest.mark.parametrize("terms", [3, 5, 9])
def test_level_0_holds_the_coefficients(depth, packing, terms):
    sprite = master(terms=terms, held_out=0)
    board = pack(sprite, params=Params(packing=packing, depth=depth))
    border = board.quality["border"]
    height, width = sprite.alpha.shape[1:]
    rows, columns = slice(border, border + height), slice(border, border + width)
    expected = sprite_packing.pack(sprite.terms[0], sprite.alpha[0], packing)
    found = decoded(board)[:, rows, columns]
    if depth == "8":
        steps = (
            board.scales[:, None, None]
            / np.where(np.arange(len(expected)) == 0, 510, 254)[:, None, None, None]
        )
        assert (np.abs(found - expected) <= steps * (1 + 1e-5) + 1e-7).all()
    else:
        # Half floats: 2^-11 of the value, 2^-25 under the normal ones
        np.testing.assert_allclose(found, expected, rtol=2.0**-11, atol=2.0**-25)
    outside = decoded(board)
    outside[:, rows, columns] = 0
    np.testing.assert_array_equal(outside, 0)
    assert board.quality["clipped_values"] == 0 or depth == "8"


def test_layout_of_a_packed_sprite():
    sprite = master(views=3)
    board = pack(sprite, params=Params(max_lod=3.0))
    border = board.quality["border"]
    assert board.views == 3
    assert board.planes == 3
    assert len(board.levels) == board.quality["levels"]
    assert board.pivot == (sprite.pivot[0] + border, sprite.pivot[1] + border)
    assert board.metres_per_texel == sprite.metres_per_texel
    assert board.max_lod == 3.0
    for level, codes in enumerate(board.levels):
        assert codes.dtype == np.uint8
        assert codes.shape == (9, board.size[1] >> level, board.size[0] >> level, 4)
        assert min(codes.shape[1:3]) >= 4
    # Layer = view * planes + plane
    rows, columns = (slice(border, border + n) for n in sprite.alpha.shape[1:])
    for view in range(3):
        coverage = board.levels[0][view * 3, rows, columns, 3] / 255
        np.testing.assert_allclose(coverage, sprite.alpha[view], atol=0.5 / 255 + 1e-7)


def test_packed_terms_of_two_views_are_filtered_apart():
    both = pack(master(views=2), params=Params())
    alone = pack(
        replace(
            master(views=2),
            terms=master(views=2).terms[1:],
            alpha=master(views=2).alpha[1:],
            held_out=np.zeros((8, 0, 3), np.float32),
            held_out_texels=np.zeros(0, np.int64),
        ),
        params=Params(depth="16"),
    )
    halves = pack(master(views=2), params=Params(depth="16"))
    for level, codes in enumerate(alone.levels):
        np.testing.assert_array_equal(codes, halves.levels[level][alone.planes :])
    assert both.levels[0].shape == halves.levels[0].shape


def test_borders_of_the_codes_are_zero():
    board = pack(master(), params=Params())
    zero = np.full((board.planes, 4), 128)
    zero[0] = 0
    for codes in board.levels:
        layers = codes.reshape(board.planes, *codes.shape[1:])
        for edge in (layers[:, 0], layers[:, -1], layers[:, :, 0], layers[:, :, -1]):
            np.testing.assert_array_equal(edge, np.broadcast_to(zero[:, None], edge.shape))


def test_what_packing_and_codes_cost():
    """At most .4 dB for twelve numbers and .1 dB for their 8 bits, against renders of a coloured
    mesh with shadows that neither saw (measured -.001 and .004)."""
    quality = pack(master(), params=Params()).quality
    assert 20 < quality["psnr_full"] < 60
    assert quality["loss_packing_db"] <= 0.4
    assert quality["loss_bits_db"] <= 0.1
    # Renders of lights between those of the ring, of which 5 terms of a shadow keep this much
    assert quality["psnr_full"] == pytest.approx(master().quality["held_out_psnr"], abs=1e-6)


@pytest.mark.skipif(
    "BAKELIGHT_DATA" not in os.environ, reason="BAKELIGHT_DATA is not set: real coloured meshes"
)
@pytest.mark.parametrize("name", ["fuze.obj", "Duck.glb", "reference.ply"])
def test_what_packing_and_codes_cost_on_real_meshes(name):
    """Measured at most .002 and .06 dB (fuze, whose 43 dB leave the codes the least room)."""
    path = Path(os.environ["BAKELIGHT_DATA"]) / "meshes" / "trimesh" / "models" / name
    sprite = billboard.trace(sources.load(path), params=billboard.Params(resolution=64))
    quality = pack(sprite, params=Params()).quality
    assert quality["loss_packing_db"] <= 0.4
    assert quality["loss_bits_db"] <= 0.1


def test_losses_of_full_packing_are_those_of_the_bits_alone():
    quality = pack(master(), params=Params(packing="full")).quality
    assert quality["loss_packing_db"] == 0
    halves = pack(master(), params=Params(packing="full", depth="16")).quality
    assert abs(halves["loss_bits_db"]) < 1e-3


def test_white_lumas_cost_more_than_coloured_ones_on_a_coloured_mesh():
    chroma, talk = (pack(master(), params=Params(unpack=u)).quality for u in ("chroma", "talk"))
    assert talk["loss_packing_db"] > chroma["loss_packing_db"]


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (3, 5)])
def test_the_smallest_sprites_pack(size):
    height, width = size
    sprite = replace(
        master(),
        terms=np.ones((1, 5, height, width, 3), np.float32),
        alpha=np.ones((1, height, width), np.float32),
        held_out=np.zeros((8, 0, 3), np.float32),
        held_out_texels=np.zeros(0, np.int64),
    )
    board = pack(sprite, params=Params(max_lod=2.0))
    stage_battery.require_finite(board)
    border = board.quality["border"]
    np.testing.assert_allclose(decoded(board)[0, border, border], 1, rtol=1e-6)


def test_a_black_sprite_packs():
    black = replace(
        master(), terms=0 * master().terms, held_out=0 * master().held_out, alpha=0 * master().alpha
    )
    board = pack(black, params=Params())
    stage_battery.require_finite(board)
    np.testing.assert_array_equal(decoded(board), 0)


def test_bright_terms_do_not_overflow_halves():
    bright = replace(master(), terms=master().terms * np.float32(1e9))
    board = pack(bright, params=Params(depth="16"))
    assert all(np.isfinite(codes).all() for codes in board.levels)
    assert board.quality["clipped_values"] > 100


KNOBS = [
    ("filter", "lanczos"), ("packing", "six"), ("unpack", "grey"), ("depth", "32"),
    ("max_lod", -0.1), ("max_lod", 8.5), ("max_lod", float("nan")),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), KNOBS)
def test_knobs_out_of_range_are_named(name, value):
    with pytest.raises(InputError) as refusal:
        pack(master(), params=replace(Params(), **{name: value}))
    assert refusal.value.field == name


@cache
def battery_master():
    mesh = small_meshes.plate((1, 0, 2))
    return billboard.trace(
        mesh, params=billboard.Params(resolution=6, samples=2, lights=8, held_out=2)
    )


@pytest.mark.parametrize("case", stage_battery.cases(battery_master()), ids=str)
def test_battery(case, tmp_path):
    stage_battery.check(case, pack, (battery_master(),), Params(max_lod=1.0), tmp_path)
