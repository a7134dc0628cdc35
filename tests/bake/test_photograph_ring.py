"""Photographs near one elevation as circular harmonics: closed forms, gates, refusals."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bake import mips, photograph_ring, photographs
from bake.photograph_ring import Params, fit
from bake.photographs import Photographs
from formats.errors import InputError
from maths import circular_lights

Array = NDArray[np.float64]
SIZE = 6


def lights_at(elevations: Any, count: int = 24) -> Array:
    """Lights evenly about the axis, at elevations in degrees that repeat."""
    t = 2 * np.pi * np.arange(count) / count
    e = np.radians(np.resize(elevations, count))
    return np.stack([np.cos(e) * np.cos(t), np.cos(e) * np.sin(t), np.sin(e)], axis=-1)


def normals() -> Array:
    """Unit normals (SIZE, SIZE, 3) of a shallow bowl, lit by every light of this file."""
    x = 0.3 * ((np.arange(SIZE) + 0.5) / SIZE - 0.5)
    found = np.stack([*np.meshgrid(x, -x), np.ones((SIZE, SIZE))], axis=-1)
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def matt(lights: Array, **fields: Any) -> Photographs:
    """White Lambert under suns of irradiance pi: the cosine itself."""
    shade = np.einsum("hwc,nc->nhw", normals(), lights)
    assert shade.min() > 0
    pictures = np.repeat(shade[..., None], 3, axis=-1).astype(np.float32)
    return Photographs(pictures, lights, "linear", **fields)


def relit(terms: NDArray[np.float32], light: Array, elevation: float) -> Array:
    """What the sprite of terms (K, h, w, 3) sends under a sun of irradiance pi."""
    L = circular_lights.evaluate_direction(light, len(terms), axis="view", elevation=elevation)
    return np.einsum("k,khwc->hwc", np.pi * L, terms)


def test_lambert_on_the_ring_is_exact() -> None:
    made = fit(matt(lights_at(35)), params=Params(np.radians(35), np.radians(1)))
    light = lights_at(35, 7)[3]
    truth = np.repeat((normals() @ light)[..., None], 3, axis=-1)
    # One constant and one harmonic hold a cosine: what is left is float32
    np.testing.assert_allclose(relit(made.terms[0], light, np.radians(35)), truth, atol=2e-6)
    assert made.quality["leave_one_out_psnr"] > 100
    assert (made.quality["lights"], made.quality["height_term"]) == (24, False)
    assert np.all(made.alpha == 1)
    assert made.ring.one_sided
    assert (made.pivot, made.height) == ((SIZE / 2, SIZE), 1.0)
    assert made.metres_per_texel == 1 / SIZE


def test_lights_over_and_under_the_ring_say_what_it_would_be_on_it() -> None:
    # Lower ones outnumber: a plain mean would be darker by 3 % than the ring
    set_ = matt(lights_at([35, 28, 28, 40]))
    made = fit(set_, params=Params(np.radians(35), np.radians(10)))
    assert made.quality["height_term"]
    light = lights_at(35, 7)[3]
    truth = np.repeat((normals() @ light)[..., None], 3, axis=-1)
    found = relit(made.terms[0], light, np.radians(35))
    # n.d is nz sin e, which the term in height holds exactly, and nxy cos e cos t, where cos e of
    # lower lights is taken for that of the ring: up to 1 - cos 35 / cos 28 = 7.2 % of |nxy| = .21
    assert np.abs(found - truth).max() < 0.072 * 0.21
    plain, _ = photograph_ring.fitted(set_.directions, Params(np.radians(35)), False)
    mean = plain.matrix[0] @ set_.pictures[:, 2, 2, 0] / (2 * np.pi) ** 0.5
    assert truth[2, 2, 0] - mean > 0.02


def test_terms_are_rounded_once(rng: np.random.Generator) -> None:
    """Summed in double precision, so that codes do not depend on the kernel of BLAS."""
    pictures = rng.random((24, 5, 4, 3), np.float32)
    train, matrix = np.arange(0, 24, 2), rng.normal(size=(5, 12))
    taken = Photographs(pictures, lights_at([30.0]), "linear")
    terms = photograph_ring.terms_of(taken, train, matrix, lambda done: None)
    exact = np.tensordot(matrix, pictures[train].astype(np.longdouble), 1) / np.pi
    # A rounding of 24 bits, and twelve of 53 bits before
    np.testing.assert_allclose(terms, exact.reshape(5, 20, 3), rtol=2.0**-24, atol=1e-14)


def test_only_lights_near_the_ring_count() -> None:
    lights = np.concatenate([lights_at(35), lights_at(80)])
    near = fit(matt(lights), params=Params(np.radians(35)))
    alone = fit(matt(lights_at(35)), params=Params(np.radians(35)))
    np.testing.assert_array_equal(near.terms, alone.terms)
    assert (near.quality["lights"], near.quality["lights_of_the_set"]) == (24, 48)


def test_held_out_lights_are_not_seen() -> None:
    lights = lights_at(35)
    params = Params(np.radians(35), held_out=(0, 5, 9))
    whole = matt(lights)
    spoiled = whole.pictures.copy()
    spoiled[[0, 5, 9]] = 0.5
    made = fit(whole, params=params)
    other = fit(Photographs(spoiled, lights, "linear"), params=params)
    np.testing.assert_array_equal(made.terms, other.terms)
    assert made.quality["held_out_lights"] == 3
    assert made.quality["held_out_psnr"] > 100 > 40 > other.quality["held_out_psnr"]
    # What mips measure losses against is what was held out, under irradiance 1
    np.testing.assert_allclose(
        made.held_out, whole.pictures[[0, 5, 9]].reshape(3, -1, 3)[:, made.held_out_texels] / np.pi
    )


def test_packed_it_is_a_sprite_with_a_border() -> None:
    made = fit(matt(lights_at(35)), params=Params(np.radians(35)))
    board = mips.pack(made, params=mips.Params(max_lod=0.0))
    coverage = board.levels[0][0, ..., 3]
    assert coverage[2:-2, 2:-2].min() == 255
    assert coverage[[0, -1]].max() == 0
    assert abs(board.quality["loss_packing_db"]) < 1
    assert board.pivot == (SIZE / 2 + 2, SIZE + 2)
    assert board.quality["size"] == [SIZE, SIZE]


def test_coverage_and_views_are_kept() -> None:
    coverage = np.linspace(0, 1, 2 * SIZE * SIZE, dtype=np.float32).reshape(2 * SIZE, SIZE)
    set_ = matt(lights_at(35))
    two = np.concatenate([set_.pictures, 0.5 * set_.pictures], axis=1)
    made = fit(
        Photographs(two, set_.directions, "linear", coverage=coverage, views=2),
        params=Params(np.radians(35)),
    )
    np.testing.assert_array_equal(made.alpha, coverage.reshape(2, SIZE, SIZE))
    # Exact: a power of two scales each product
    np.testing.assert_allclose(made.terms[1], 0.5 * made.terms[0], rtol=1e-6, atol=1e-9)


def test_gates_leave_notes() -> None:
    t = np.linspace(0, np.pi / 2, 12)
    lights = np.stack([np.cos(t), np.sin(t), np.full(12, 0.7)], axis=-1)
    lights /= np.linalg.norm(lights, axis=-1, keepdims=True)
    elevation = float(np.arcsin(lights[0, 2]))
    made = fit(matt(lights), params=Params(elevation))
    assert made.quality["terms_used"] < 5
    assert made.quality["largest_gap_degrees"] == pytest.approx(270)
    assert any("gap" in note for note in made.quality["notes"])
    # A quarter of azimuths, yet answers all around stay within twice the photographs
    around = [relit(made.terms[0], d, elevation) for d in lights_at(np.degrees(elevation))]
    assert np.abs(around).max() < 2


def test_too_few_lights_say_where_there_are_more() -> None:
    lights = np.concatenate([lights_at(30, 4), lights_at(60, 20)])
    with pytest.raises(InputError) as caught:
        fit(matt(lights), params=Params(np.radians(30)))
    assert caught.value.value == "4 lights within 10 of 30 degrees"
    assert "20, lie about 60" in caught.value.remedy


@pytest.mark.parametrize(
    ("knobs", "field"),
    [
        ({"elevation": -0.1}, "elevation"),
        ({"elevation": 1.6}, "elevation"),
        ({"tolerance": 2.0}, "tolerance"),
        ({"terms": 4}, "terms"),
        ({"terms": 35}, "terms"),
        ({"elevation": float("nan")}, "elevation"),
        ({"held_out": (24,)}, "held_out"),
    ],
    ids=str,
)
def test_knobs_out_of_range_are_refused(knobs: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError) as caught:
        fit(matt(lights_at(35)), params=Params(**knobs))
    assert caught.value.field == field


def test_values_as_stored_are_refused() -> None:
    set_ = matt(lights_at(35))
    with pytest.raises(InputError, match="linear"):
        fit(Photographs(set_.pictures, set_.directions, "stored"), params=Params(np.radians(35)))


@pytest.mark.skipif("BAKELIGHT_DATA" not in os.environ, reason="BAKELIGHT_DATA is not set")
def test_a_real_set() -> None:
    path = Path(os.environ["BAKELIGHT_DATA"]) / "rti/neural_rti/exampledataset/dirs.lp"
    made = fit(photographs.load(path), params=Params())
    # Measured: 27 lights, 30.4 dB; .5 dB is room for other decoders of JPEG
    assert made.quality["lights"] == 27
    assert made.quality["leave_one_out_psnr"] > 29.9
