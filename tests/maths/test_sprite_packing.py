"""Planes and codes of sprites: layout, exact zeros, bounds of 8 bits, the program of the talk."""

import numpy as np
import pytest

from maths import sprite_packing
from maths.colour import luminance
from maths.sprite_packing import decode, encode, pack, planes_of, scales_of, unpack, unpack_talk

TERMS = (1, 3, 5, 7, 9)


def coefficients(rng, terms, size=(6, 7)):
    """Terms (K, h, w, 3) as a bake gives them: Y0 is positive, the rest of either sign."""
    Y = rng.normal(scale=0.3, size=(terms, *size, 3))
    Y[0] = rng.uniform(0.05, 1, (*size, 3))
    return Y.astype(np.float32), rng.uniform(0, 1, size).astype(np.float32)


@pytest.mark.parametrize("terms", TERMS)
def test_full_keeps_everything(terms, rng):
    Y, alpha = coefficients(rng, terms)
    planes = pack(Y, alpha, "full")
    assert planes.shape == (terms, 6, 7, 4)
    assert planes.dtype == np.float32
    np.testing.assert_array_equal(unpack(planes, terms, "full"), Y)
    np.testing.assert_array_equal(planes[0, ..., 3], alpha)
    np.testing.assert_array_equal(planes[1:, ..., 3], 0)


@pytest.mark.parametrize("terms", TERMS)
@pytest.mark.parametrize("unpacking", sprite_packing.UNPACKINGS)
def test_twelve_keeps_what_it_says(terms, unpacking, rng):
    Y, alpha = coefficients(rng, terms)
    planes = pack(Y, alpha, "twelve")
    assert len(planes) == planes_of(terms, "twelve")
    found = unpack(planes, terms, "twelve", unpacking)
    np.testing.assert_array_equal(found[:3], Y[:3])
    np.testing.assert_array_equal(planes[0, ..., 3], alpha)
    # The luma of every further term survives, whatever colour it is given: a handful of roundings
    for k in range(3, terms):
        np.testing.assert_allclose(luminance(found[k]), luminance(Y[k]), rtol=2e-6, atol=1e-7)


def test_twelve_numbers_lie_where_the_talk_has_them(rng):
    Y, alpha = coefficients(rng, 5)
    planes = pack(Y, alpha, "twelve")
    expected = np.stack([
        np.concatenate([Y[0], alpha[..., None]], axis=-1),
        np.concatenate([Y[1], luminance(Y[3])[..., None]], axis=-1),
        np.concatenate([Y[2], luminance(Y[4])[..., None]], axis=-1),
    ])  # fmt: skip
    np.testing.assert_allclose(planes, expected, rtol=2.0**-24)


@pytest.mark.parametrize("terms", TERMS)
@pytest.mark.parametrize("packing", sprite_packing.PACKINGS)
def test_no_channel_is_used_twice(terms, packing):
    """Mark each number of the terms by a value of its own and find them all again."""
    used = np.count_nonzero(pack(np.ones((terms, 1, 3)), np.ones(1), packing))
    coloured = terms if packing == "full" or terms < 5 else 3
    assert used == 3 * coloured + 1 + (terms - coloured)
    assert planes_of(terms, packing) == -(-used // 4) or packing == "full" or terms < 5


@pytest.mark.parametrize("terms", TERMS)
def test_one_hue_a_texel_is_unpacked_exactly(terms, rng):
    """Where all terms have the hue of Y0, `chroma` loses nothing: the case of one material."""
    shade, hue = rng.normal(size=(terms, 6, 7, 1)), rng.uniform(0.1, 1, (6, 7, 3))
    shade[0] = np.abs(shade[0])
    Y = shade * hue
    found = unpack(pack(Y, np.ones((6, 7)), "twelve"), terms, "twelve", "chroma")
    np.testing.assert_allclose(found, Y, rtol=1e-13, atol=1e-15)


def test_grey_needs_no_hue(rng):
    Y = np.repeat(rng.uniform(0.1, 1, (5, 6, 7, 1)), 3, axis=-1)
    planes = pack(Y, np.ones((6, 7)), "twelve")
    for unpacking in sprite_packing.UNPACKINGS:
        np.testing.assert_allclose(unpack(planes, 5, "twelve", unpacking), Y, rtol=1e-14)


@pytest.mark.parametrize("terms", [0, 2, 4, -1])
def test_even_terms_are_refused(terms):
    with pytest.raises(ValueError, match="odd"):
        planes_of(terms, "full")


def test_packing_is_linear(rng):
    """C9: negative input is kept as it is, and sums stay sums."""
    (A, a), (B, b) = coefficients(rng, 7), coefficients(rng, 7)
    A, B = A.astype(np.float64), -3.0 * B.astype(np.float64)
    total = pack(2 * A + B, 2.0 * a + b, "twelve")
    parts = 2 * pack(A, a, "twelve").astype(np.float64) + pack(B, b, "twelve")
    np.testing.assert_allclose(total, parts, rtol=0, atol=1e-6)  # alpha is float32
    talk = unpack(total, 7, "twelve", "talk")
    summed = 2 * unpack(pack(A, a, "twelve"), 7, "twelve", "talk")
    summed = summed + unpack(pack(B, b, "twelve"), 7, "twelve", "talk")
    np.testing.assert_allclose(talk, summed, rtol=0, atol=1e-12)


# Codes


@pytest.mark.parametrize("terms", TERMS)
@pytest.mark.parametrize("packing", sprite_packing.PACKINGS)
def test_a_black_texel_is_exactly_black(terms, packing, rng):
    Y, alpha = coefficients(rng, terms)
    Y[:, 2, 3], alpha[2, 3] = 0, 0
    planes = pack(Y, alpha, packing)
    codes, _ = encode(planes, scales_of(planes))
    decoded = decode(codes, scales_of(planes))
    np.testing.assert_array_equal(decoded[:, 2, 3], 0)
    np.testing.assert_array_equal(unpack(decoded, terms, packing)[:, 2, 3], 0)


def test_codes_are_within_half_a_step(rng):
    Y, alpha = coefficients(rng, 5, (64, 64))
    planes = pack(Y * np.float32(17.0), alpha, "full").astype(np.float64)
    scales = scales_of(planes)
    codes, clipped = encode(planes, scales)
    assert clipped == 0
    assert codes.dtype == np.uint8
    error = np.abs(decode(codes, scales) - planes).max(axis=(1, 2))
    # s / 510 for unsigned codes, s / 254 for signed ones, and float32 rounding of the product
    assert (error[0] <= scales[0] * (1 / 510 + 2.0**-23)).all()
    assert (error[1:] <= scales[1:] * (1 / 254 + 2.0**-23)).all()
    # The bound is met: codes are as coarse as it says
    assert (error[1:, :3] > scales[1:, :3] / 254 * 0.9).all()


def test_relit_error_bound(rng):
    """C14: codes change relit radiance by at most the sum of s_k |b_k| / 254."""
    Y, alpha = coefficients(rng, 5, (32, 32))
    planes = pack(Y, alpha, "full")
    scales = scales_of(planes)
    decoded = decode(encode(planes, scales)[0], scales)
    b = np.array([0.4, -0.56, 0.1, 0.3, -0.5])
    error = np.abs(np.einsum("khwc,k->hwc", (decoded - planes)[..., :3].astype(np.float64), b))
    bound = np.einsum("kc,k->c", scales[:, :3].astype(np.float64), np.abs(b)) / 254
    assert (error.max(axis=(0, 1)) <= bound * (1 + 1e-5)).all()


def test_ends_of_the_range_are_exact():
    planes = np.zeros((2, 3, 4), np.float32)
    planes[0] = [[0, 0.3, 1, 0], [2, 0.5, 0, 1], [1.2, 0.3, 0.6, 0.5]]
    planes[1] = [[-3, 0, 0, 1], [3, 0, 0, -1], [0, 0, 0, 0]]
    scales = scales_of(planes)
    codes, _ = encode(planes, scales)
    assert codes[0].tolist() == [[0, 153, 255, 0], [255, 255, 0, 255], [153, 153, 153, 128]]
    assert codes[1].tolist() == [[1, 128, 128, 255], [255, 128, 128, 1], [128, 128, 128, 128]]
    decoded = decode(codes, scales)
    # Coverage of 1 is 1; a scale is the next float32 above the largest value
    assert decoded[0, 1, 3] == 1.0
    np.testing.assert_allclose(decoded[1, :2], planes[1, :2], rtol=2.0**-22)


def test_scales(rng):
    planes = rng.normal(size=(3, 40, 40, 4)).astype(np.float32)
    planes[0] = np.abs(planes[0])
    planes[2, ..., 1] = 0
    scales = scales_of(planes)
    largest = np.abs(planes).max(axis=(1, 2))
    assert scales.dtype == np.float32
    assert scales[0, 3] == 1.0
    assert scales[2, 1] == 0.0
    rest = np.ones((3, 4), bool)
    rest[0, 3] = rest[2, 1] = False
    np.testing.assert_allclose(scales[rest], largest[rest], rtol=2.0**-22)
    assert (scales[rest] >= largest[rest]).all()
    codes, clipped = encode(planes, scales)
    np.testing.assert_array_equal(decode(codes, scales)[2, ..., 1], 0)
    # Coverage above 1 is none
    assert clipped == np.count_nonzero(planes[0, ..., 3] > 1 + 0.5 / 127)


def test_scales_do_not_depend_on_the_colour_of_others(rng):
    planes = rng.normal(size=(3, 8, 8, 4))
    louder = planes.copy()
    louder[1, ..., 2] *= 100
    before, after = scales_of(planes), scales_of(louder)
    np.testing.assert_array_equal(np.delete(before, 6), np.delete(after, 6))


def test_one_outlier_does_not_cost_the_rest_its_precision(rng):
    """C10: a firefly of 1e4 clips, is counted, and the other texels keep their steps."""
    Y, alpha = coefficients(rng, 5, (80, 80))
    clean = pack(Y, alpha, "twelve")
    Y[1, 40, 40, 0] = 1e4
    planes = pack(Y, alpha, "twelve")
    scales = scales_of(planes)
    codes, clipped = encode(planes, scales)
    assert clipped == 1
    assert codes[1, 40, 40, 0] == 255
    # The scale is at most `outlier` times the quantile .9995 of the others
    assert scales[1, 0] <= 4 * np.abs(clean[1, ..., 0]).max()
    others = np.ones((80, 80), bool)
    others[40, 40] = False
    error = np.abs(decode(codes, scales) - planes)[1, others, 0].max()
    assert error <= scales[1, 0] / 254 * (1 + 1e-5)


def test_a_few_bright_texels_of_a_small_sprite_are_no_outliers():
    planes = np.full((1, 10, 10, 4), 0.01)
    planes[0, 3, 3, :3] = 10.0
    assert encode(planes, scales_of(planes))[1] == 0


@pytest.mark.parametrize("size", [1e-6, 1.0, 6.5e4, 1e30])
def test_every_magnitude_has_the_same_relative_steps(size, rng):
    Y, alpha = coefficients(rng, 5)
    planes = pack(Y.astype(np.float64) * size, alpha, "full")
    scales = scales_of(planes)
    codes, clipped = encode(planes, scales)
    assert clipped == 0
    plain = pack(Y.astype(np.float64), alpha, "full")
    expected, _ = encode(plain, scales_of(plain))
    # Scales are rounded to float32: a value in the middle between two codes may go either way
    assert np.count_nonzero(codes != expected) <= 2


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(value):
    planes = np.ones((3, 2, 2, 4))
    planes[1, 0, 1, 2] = value
    with pytest.raises(ValueError, match="finite"):
        scales_of(planes)
    with pytest.raises(ValueError, match="finite"):
        encode(planes, np.ones((3, 4)))


def test_extreme_scales_do_not_overflow():
    planes = np.full((2, 1, 1, 4), 3e38, np.float32)
    codes, _ = encode(planes, scales_of(planes))
    assert np.isfinite(decode(codes, scales_of(planes))).all()
    tiny = np.full((2, 4), 1e-45, np.float32)
    codes, clipped = encode(planes, tiny)
    assert clipped == planes.size
    assert (codes == 255).all()


def test_float16_planes_are_scaled_only():
    planes = np.array([[[0.5, 1.0, -2.0, 0.25]]], np.float16)
    scales = np.array([[2.0, 1.0, 3.0, 1.0]], np.float32)
    np.testing.assert_array_equal(decode(planes, scales), [[[1.0, 1.0, -6.0, 0.25]]])


# The program of the talk


def ps_1_1(t0, t1, t2, c, v0):
    """The pixel shader of the talk, instruction by instruction, for one pixel."""
    lumen = [0.2126, 0.7152, 0.0722]
    c3, c4 = (sum(w * x for w, x in zip(lumen, c[i], strict=True)) for i in (3, 4))
    r0 = [t0[i] * c[0][i] for i in range(3)] + [t0[3]]  # mul r0, t0, c0   (c0.a = 1)
    r0[:3] = [r0[i] + t1[i] * c[1][i] for i in range(3)]  # mad r0.rgb, t1, c1, r0
    r0[:3] = [r0[i] + t2[i] * c[2][i] for i in range(3)]  # mad r0.rgb, t2, c2, r0
    r0[:3] = [r0[i] + t1[3] * c3 for i in range(3)]  # mad r0.rgb, t1.a, c3, r0
    r0[:3] = [r0[i] + t2[3] * c4 for i in range(3)]  # mad r0.rgb, t2.a, c4, r0
    return [r0[i] * v0[i] for i in range(4)]  # mul r0, r0, v0


def test_unpack_talk_is_the_program(rng):
    planes = rng.normal(size=(3, 4, 5, 4))
    c, v0 = rng.normal(size=(5, 3)), rng.uniform(size=4)
    found = unpack_talk(planes, c, v0)
    for y in range(4):
        for x in range(5):
            expected = ps_1_1(*planes[:, y, x], c, v0)
            np.testing.assert_allclose(found[y, x], expected, rtol=0, atol=1e-14)


def test_unpack_talk_is_unpack_under_white_lumas(rng):
    """Terms unpacked as white, relit channel by channel, where c3 and c4 are grey."""
    Y, alpha = coefficients(rng, 5)
    planes = pack(Y.astype(np.float64), alpha, "twelve")
    c = rng.normal(size=(5, 3))
    c[3:] = c[3:, :1]
    relit = np.einsum("k...c,kc->...c", unpack(planes, 5, "twelve", "talk"), c)
    found = unpack_talk(planes, c, np.ones(4))
    np.testing.assert_allclose(found[..., :3], relit, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(found[..., 3], alpha)
