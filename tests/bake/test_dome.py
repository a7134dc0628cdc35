"""The dome stage: held-out error, sixteen numbers a pixel, coverage, views, levels."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bake import dome, dome_knobs, mips, workers
from bake.photographs import Photographs, Space
from formats.errors import InputError
from maths import hemispherical_harmonics as harmonics
from maths.colour import srgb_encode
from maths.image_error import psnr
from pipelines.studies.glossy_ball import ball, lights
from tests.bake import stage_battery


def taken(count: int, space: Space = "linear", size: int = 20) -> Photographs:
    pictures = ball(lights(count), size)
    if space == "stored":
        pictures = srgb_encode(pictures).astype(np.float32)
    return Photographs(pictures, lights(count), space)


def sun(asset: dome.Dome, direction: np.ndarray) -> np.ndarray:
    """Return the colours (channels, 3) under a sun of irradiance pi."""
    basis = harmonics.evaluate(direction, round(asset.components.shape[1] ** 0.5))
    return asset.constants(np.repeat(basis[..., None], 3, axis=-1))


def relit(asset: dome.Dome, direction: np.ndarray, level: int = 0, view: int = 0) -> np.ndarray:
    return asset.decoded(level, view) @ sun(asset, direction)


@pytest.mark.parametrize("space", ["linear", "stored"])
def test_unseen_lights_are_met_better_than_by_a_polynomial(space: Space) -> None:
    photographs = taken(49, space)
    held = tuple(range(3, 49, 7))
    quality = dome.fit(photographs, params=dome.Params(held_out=held)).quality
    assert (quality["lights"], quality["held_out_lights"]) == (42, 7)
    # Measured with the ball's hard shadow: 22.1 and 22.6 dB, HSH 21.1 and 21.3, PTM 20.2 and 20.8
    assert quality["held_out_psnr"] > quality["held_out_hsh_27_psnr"] + 0.5
    assert quality["held_out_psnr"] > quality["held_out_ptm_18_psnr"] + 1.2
    # Measured .18 and .25, and under .005
    assert quality["loss_channels_db"] < 0.5
    assert abs(quality["loss_bits_db"]) < 0.02


def test_the_report_says_what_relighting_gives() -> None:
    photographs, held = taken(40, "stored"), (4, 13, 22)
    asset = dome.fit(photographs, params=dome.Params(held_out=held))
    slow = [
        psnr(np.clip(relit(asset, photographs.directions[n]), 0, 1), photographs.pictures[n])
        for n in held
    ]
    # Products of single against double precision: 1e-6 of values, of an error of 3e-2
    assert asset.quality["held_out_psnr"] == pytest.approx(np.mean(slow), abs=1e-3)


def test_held_out_photographs_change_nothing() -> None:
    photographs = taken(30)
    spoilt = photographs.pictures.copy()
    spoilt[[5, 17]] = 0.99
    params = dome.Params(held_out=(5, 17))
    plain = dome.fit(photographs, params=params)
    other = dome.fit(Photographs(spoilt, photographs.directions, "linear"), params=params)
    assert np.array_equal(plain.levels[0], other.levels[0])
    assert np.array_equal(plain.components, other.components)
    assert plain.quality["held_out_psnr"] > other.quality["held_out_psnr"]


def test_threads_do_not_change_a_byte() -> None:
    photographs, baked = taken(24, size=70), []
    for threads in (1, 3):
        workers.use(threads)
        try:
            baked.append(dome.fit(photographs, params=dome.Params(bands=4, penalty=0.1)))
        finally:
            workers.use(0)
    assert np.array_equal(baked[0].levels[0], baked[1].levels[0])
    assert np.array_equal(baked[0].components, baked[1].components)
    assert baked[0].quality == baked[1].quality


def test_light_adds_up() -> None:
    asset = dome.fit(taken(30), params=dome.Params())
    a, b = lights(7)[[2, 5]]
    both = asset.decoded() @ (2.0 * sun(asset, a) + sun(asset, b))
    np.testing.assert_allclose(both, 2.0 * relit(asset, a) + relit(asset, b), atol=1e-12)


def test_more_channels_than_there_is_to_keep() -> None:
    photographs = taken(30, "stored", 4)
    flat = Photographs(np.full_like(photographs.pictures, 0.5), photographs.directions, "stored")
    asset = dome.fit(flat, params=dome.Params(channels=6))
    assert asset.levels[0].shape == (2, 4, 4, 4)
    assert asset.quality["rank"] == 1
    assert any("5 are zero" in note for note in asset.quality["notes"])
    # A constant is free of penalty; 127 is the code of the largest, so it is exact
    np.testing.assert_allclose(relit(asset, np.array([0, 0, 1.0])), 0.5, rtol=1e-5)


def test_channels_are_the_least_penalised_squares(rng: np.random.Generator) -> None:
    photographs, train = taken(20, size=4), np.arange(1, 20)
    vectors = rng.normal(size=(5, 16, 3))
    vectors[3] = 0
    d, pixels = photographs.directions[train], np.array([0, 5, 6, 15])
    for exponent in (0.0, 1.5):
        knobs = dome_knobs.Knobs(4, 0.1, exponent, 0.0, 1.0)
        scores = dome.scores_of(photographs, train, knobs, vectors, pixels)
        x = photographs.pictures.reshape(20, -1, 3)[train][:, pixels].transpose(1, 0, 2)
        w = dome_knobs.weights_of(x.astype(np.float64), exponent)
        w /= w.mean(axis=1, keepdims=True)
        given = np.einsum("nk,jkc->ncj", harmonics.evaluate(d, 4), vectors)
        rough = np.sqrt(0.1 * 19 * harmonics.penalties(4))
        smooth = (vectors * rough[:, None]).reshape(5, -1).T
        for p in range(4):
            rows = np.concatenate([
                (given * np.sqrt(w[p])[:, None, None]).reshape(-1, 5), smooth,
            ])  # fmt: skip
            right = np.append((x[p] * np.sqrt(w[p])[:, None]).ravel(), np.zeros(len(smooth)))
            slow = np.linalg.lstsq(rows, right, rcond=None)[0]
            # Single precision, times the conditioning of the normal equations (measured 4e-6)
            np.testing.assert_allclose(scores[p], slow, atol=3e-5)
            if exponent == 0:
                # Summed in double precision and rounded once, whatever the kernel of BLAS
                np.testing.assert_allclose(scores[p], slow, rtol=2.0**-24, atol=1e-11)


def covered(size: int = 24, views: int = 1) -> Photographs:
    """The ball cut out with a soft edge, premultiplied; of a second view the mirror image."""
    photographs = taken(40, size=size)
    x = (np.arange(size) + 0.5) / size * 2 - 1
    distance = np.hypot(*np.meshgrid(x, x))
    alpha = np.clip((0.8 - distance) * 4, 0, 1).astype(np.float32)
    pictures = photographs.pictures * alpha[..., None]
    if views == 2:
        alpha = np.concatenate([alpha, alpha[:, ::-1]])
        pictures = np.concatenate([pictures, pictures[:, :, ::-1]], axis=1)
    return replace(photographs, pictures=pictures, coverage=alpha, views=views)


def test_fifteen_and_coverage_cost_little() -> None:
    photographs = covered()
    held = tuple(range(3, 40, 7))
    asset = dome.fit(photographs, params=dome.Params(held_out=held))
    assert (asset.channels, asset.planes, asset.coverage) == (15, 4, True)
    # Measured .02 dB of 24.4
    assert abs(asset.quality["loss_coverage_db"]) < 0.1
    border = asset.quality["border"]
    assert border == mips.border_of(mips.Params(max_lod=0.0))
    inside = slice(border, border + 24)
    alpha = asset.alpha()
    assert np.abs(alpha[inside, inside] - photographs.coverage).max() <= 0.5 / 255 + 1e-6
    assert alpha.sum() == pytest.approx(alpha[inside, inside].sum(), abs=0)
    # Nothing is where nothing is covered
    assert not asset.decoded()[alpha == 0].any()
    assert asset.pivot == (12.0 + border, 24.0 + border)
    assert asset.quality["size"] == [24, 24]


def test_dark_pixels_have_a_say_in_the_choice_of_channels(rng: np.random.Generator) -> None:
    series = rng.normal(size=(5, 12)).astype(np.float32)
    series[1] *= 0.04
    series[2:] = 0
    made = dome.for_channels(series, "linear")
    square = np.square(series.astype(np.float64)).mean(axis=1)
    expected = series / np.sqrt(np.sqrt(square) + 0.05 * np.sqrt(square.mean()))[:, None]
    # A few roundings
    np.testing.assert_allclose(made, expected, rtol=1e-14)
    np.testing.assert_array_equal(dome.for_channels(series, "stored"), series)
    assert not dome.for_channels(0 * series, "linear").any()


def test_pixels_without_coverage_have_no_say() -> None:
    photographs = covered()
    spoilt = photographs.pictures.copy()
    spoilt[:, photographs.coverage == 0] = 7.0
    params = dome.Params(bands=4, penalty=0.1)
    plain = dome.fit(photographs, params=params)
    other = dome.fit(replace(photographs, pictures=spoilt), params=params)
    assert np.array_equal(plain.levels[0], other.levels[0])
    assert np.array_equal(plain.components, other.components)
    assert plain.quality == other.quality


def test_opaque_photographs_get_a_border_where_coverage_is_asked_for() -> None:
    asset = dome.fit(taken(30), params=dome.Params(bands=4, penalty=0.1, coverage=True))
    border = asset.quality["border"]
    assert asset.channels == 15
    inside = slice(border, border + 20)
    expected = np.zeros(asset.size[::-1])
    expected[inside, inside] = 1
    assert np.array_equal(asset.alpha(), expected)


def test_views_are_those_that_were_stacked() -> None:
    params = dome.Params(bands=4, penalty=0.1)
    asset = dome.fit(covered(views=2), params=params)
    assert len(asset.levels[0]) == 2 * asset.planes
    light = np.array([0.36, 0.48, 0.8])
    border = asset.quality["border"]
    inside = slice(border, border + 24)
    first, second = (asset.alpha(0, v)[inside, inside] for v in (0, 1))
    assert np.array_equal(first, second[:, ::-1])
    assert asset.quality["size"] == [24, 24]
    a, b = (relit(asset, light, view=v)[inside, inside] for v in (0, 1))
    # The same pixels in both views: equal to the last bit
    assert np.array_equal(a, b[:, ::-1])
    assert not np.allclose(a, b)


def test_levels_are_what_the_lens_sees() -> None:
    asset = dome.fit(covered(), params=dome.Params(bands=4, penalty=0.1, max_lod=2.0))
    assert asset.quality["levels"] == len(asset.levels) > 3
    assert asset.max_lod == 2.0
    assert asset.quality["border"] == mips.border_of(mips.Params(max_lod=2.0))
    light = np.array([0.36, 0.48, 0.8])
    constants = sun(asset, light)
    alpha = asset.alpha()[..., None].astype(np.float32)
    picture = np.concatenate([relit(asset, light), alpha], axis=-1)[None].astype(np.float32)
    chain = mips.mip_chain(picture, len(asset.levels), "kaiser")
    # Light and filter are both sums; codes of both levels round by half of theirs
    slots = asset.scales.ravel()[[0, 1, 2, *range(4, 16)]]
    bound = 2 * np.abs(constants).T @ slots / 254
    for level, expected in enumerate(chain):
        error = np.abs(relit(asset, light, level) - expected[0, ..., :3]).max(axis=(0, 1))
        # The kernel's negative lobes make its absolute sum 1.5
        assert np.all(error <= 1.5 * bound)
        assert np.abs(asset.alpha(level) - np.clip(expected[0, ..., 3], 0, 1)).max() < 1.25 / 255
        assert not asset.alpha(level)[[0, -1]].any()


@pytest.mark.parametrize(
    ("params", "field"),
    [
        (dome.Params(bands=9), "bands"),
        (dome.Params(penalty=-0.1), "penalty"),
        (dome.Params(penalty=float("nan")), "penalty"),
        (dome.Params(channels=1), "channels"),
        (dome.Params(filter="lanczos"), "filter"),
        (dome.Params(max_lod=9.0), "max_lod"),
        (dome.Params(held_out=(12,)), "held_out"),
        (dome.Params(held_out=(0, 1, 2, 3, 4, 5, 6)), "lights"),
    ],
)
def test_knobs_out_of_range_are_refused(params: dome.Params, field: str) -> None:
    with pytest.raises(InputError) as caught:
        dome.fit(taken(12, size=4), params=params)
    assert caught.value.field == field


def test_nothing_to_be_seen_is_refused() -> None:
    photographs = covered(4)
    blank = replace(photographs, coverage=np.zeros((4, 4), np.float32))
    with pytest.raises(InputError, match="nothing is to be seen"):
        dome.fit(blank, params=dome.Params())


def test_a_folder_of_photographs_comes_back(tmp_path: Path) -> None:
    photographs = covered(6, views=2)
    photographs.save(tmp_path)
    back = Photographs.load(tmp_path)
    # Half floats
    np.testing.assert_allclose(back.pictures, photographs.pictures, rtol=2.0**-11, atol=1e-7)
    np.testing.assert_allclose(back.coverage, photographs.coverage, rtol=2.0**-11)
    assert np.array_equal(back.directions, photographs.directions)
    for name in ("space", "notes", "metres_per_texel", "pivot", "height", "views"):
        assert getattr(back, name) == getattr(photographs, name), name


SMALL = covered(5)


@pytest.mark.parametrize("case", stage_battery.cases(SMALL), ids=str)
def test_battery(case: Any, tmp_path: Path) -> None:
    params = dome.Params(held_out=(2,), bands=3, penalty=0.1, channels=8, max_lod=1.0)
    stage_battery.check(case, dome.fit, (SMALL,), params, tmp_path)
