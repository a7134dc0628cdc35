"""The stage that traces an occlusion volume: whole volumes, their frame, their error bars."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake import occlusion, workers
from bake.occlusion import Params
from formats.errors import InputError
from formats.occlusion import OcclusionHarmonics
from maths import spherical_harmonics
from tests.bake import small_meshes, stage_battery

QUICK = Params(grid=8, rays=128, proof=8)
BALL = small_meshes.sphere(24, 48)
BOX = small_meshes.box((1.0, 0.6, 0.3), (0.2, 0.1, -0.1))


def test_a_ball_casts_the_share_of_the_sky_that_it_covers() -> None:
    found = occlusion.trace(BALL, params=Params(grid=12, rays=1024, proof=0))
    assert found.box.centre == pytest.approx((0, 0, 0), abs=1e-12)
    assert found.box.half_extent == pytest.approx((1, 1, 1))
    points = found.box.voxel_centres(12)
    distance = np.linalg.norm(points, axis=1)
    inside = found.inside.ravel()
    # Chords of 24 rings lie within cos(pi / 24) = .9914; no voxel centre lies between
    assert not np.any((distance > 0.99) & (distance < 1))
    assert np.array_equal(inside, distance < 1)
    # z_0 = sqrt(pi) (1 - cos a), z_1 = sqrt(3 pi) / 2 sin^2 a, a = asin(1 / distance)
    far, terms = points[~inside], found.terms.reshape(-1, 25)[~inside]
    sine = 1 / distance[~inside]
    zonal = np.sqrt(np.pi) * (1 - np.sqrt(1 - sine**2))
    # The polyhedron covers .6 % less: chords lose (pi / 24)^2 / 3 of the area of an outline
    np.testing.assert_allclose(terms[:, 0], zonal, atol=0.03 * zonal.max())
    np.testing.assert_allclose(terms[:, 0].mean(), zonal.mean(), rtol=0.01)
    Y = spherical_harmonics.evaluate(-far / distance[~inside, None], 1)[:, 1:]
    first = np.sqrt(4 * np.pi / 3) * np.sqrt(3 * np.pi) / 2 * sine[:, None] ** 2 * Y
    np.testing.assert_allclose(terms[:, 1:4], first, atol=0.05)
    # Inside there is what is outside, never nothing
    assert found.terms.reshape(-1, 25)[inside][:, 0].min() > 0.5 * terms[:, 0].max()


def test_axes_and_box() -> None:
    found = occlusion.trace(BOX, params=Params(grid=8, rays=256, proof=0))
    assert found.box.centre == pytest.approx((0.2, 0.1, -0.1))
    assert found.box.half_extent == pytest.approx((1.0, 0.6, 0.3))
    assert found.box.longest_axis == 0
    # Beyond +x the box lies towards -x: Y(1, 1) ~ x, index 3; +y is the second axis, +z the first
    assert found.terms[4, 4, 7, 3] < -0.1
    assert found.terms[4, 7, 4, 1] < -0.1
    assert found.terms[7, 4, 4, 2] < -0.1
    assert found.terms[0, 4, 4, 2] > 0.1


def test_thin_axes_are_padded() -> None:
    plate = small_meshes.plate(half=2.0)
    found = occlusion.trace(plate, params=QUICK)
    assert found.box.half_extent == pytest.approx((2.0, 2.0, 0.5))
    assert not found.inside.any()
    assert found.terms[..., 0].min() >= 0


def test_scale_and_place_change_nothing() -> None:
    plain = occlusion.trace(BALL, params=QUICK)
    for scale, offset in ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e6)):
        moved = replace(BALL, vertices=BALL.vertices * scale + offset)
        found = occlusion.trace(moved, params=QUICK)
        assert np.array_equal(found.inside, plain.inside)
        # float64 holds 1e6 + 1 to 1e-10; rays at an edge may fall on its other side
        assert np.sqrt(np.mean((found.terms - plain.terms) ** 2)) < 1e-4


def test_error_bars_hold() -> None:
    fine = occlusion.trace(BOX, params=Params(grid=8, rays=1 << 14, proof=0))
    for rays in (128, 512):
        found = occlusion.trace(BOX, params=Params(grid=8, rays=rays, proof=0))
        outside = ~found.inside
        error = (found.terms - fine.terms)[outside]
        # Against 32 times as many rays; measured ratios are .8 to 1.15
        ratio = np.sqrt(np.mean(error**2, axis=0)) / found.error
        assert np.all((ratio > 0.4) & (ratio < 1.7))
        overall = np.sqrt(np.mean(error**2) / np.mean(found.spread[outside] ** 2))
        assert 0.6 < overall < 1.3
        assert np.all(found.spread[found.inside] == 0)


def test_truncation_is_what_all_higher_bands_hold() -> None:
    low = occlusion.trace(BOX, params=Params(grid=6, l_max=1, rays=4096, proof=0))
    high = occlusion.trace(BOX, params=Params(grid=6, l_max=9, rays=4096, proof=0))
    both = low.terms.reshape(-1, 4), high.terms.reshape(-1, 100)
    gained = np.sum(both[1][:, 4:] ** 2, axis=1)
    squared = [occlusion.truncation(terms) ** 2 for terms in both]
    # Sampling noise of 4,096 rays in 100 coefficients: up to .01, measured
    np.testing.assert_allclose(squared[0] - squared[1], gained, atol=0.02)
    assert gained.max() > 0.2


def test_the_adaptive_mode_stops_where_it_may() -> None:
    every = Params(grid=8, rays=4096, proof=0)
    full = occlusion.trace(BALL, params=every)
    found = occlusion.trace(BALL, params=replace(every, adaptive=0.1))
    assert found.quality["rays"] < 0.5 * full.quality["rays"]
    outside = ~found.inside
    terms = found.terms[outside]
    error = np.sqrt(25) * found.spread[outside]
    assert np.all(error <= 0.1 * occlusion.truncation(terms) + 1e-6)
    difference = np.sqrt(np.sum((terms - full.terms[outside]) ** 2, axis=1))
    assert np.sqrt(np.mean(difference**2)) < 1.5 * np.sqrt(np.mean(error**2))


def test_any_number_of_threads_gives_the_same_bytes(tmp_path: Path) -> None:
    before, files = workers.count(), []
    try:
        for threads in (1, 2, 4):
            workers.use(threads)
            folder = tmp_path / str(threads)
            folder.mkdir()
            occlusion.trace(BALL, params=QUICK).save(folder)
            files.append(stage_battery.files_of(folder))
    finally:
        workers.use(before)
    assert files[0] == files[1] == files[2]


def test_proof_agrees_with_the_closed_form_of_two_caps() -> None:
    found = occlusion.trace(BALL, params=Params(grid=8, rays=64, l_max=2, proof=64))
    assert found.proof_lights.shape == (4, 48, 9)
    # Scaled so that full occlusion, (2 sqrt(pi), 0, ...), hides all of a light
    np.testing.assert_allclose(found.proof_lights[..., 0] * 2 * np.sqrt(np.pi), 1, atol=1e-5)
    points = found.box.voxel_centres(8)[found.proof_voxels]
    distance = np.linalg.norm(points, axis=1)
    direction = found.proof_lights[..., [3, 1, 2]].astype(float)
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    between = np.arccos(np.clip(direction @ (-points / distance[:, None]).T, -1, 1))
    cap, light = np.arcsin(1 / distance), np.asarray(found.proof_radii)[:, None, None]
    # 4,096 directions lie .055 radians apart: a light's edge is uncertain by half of that
    apart, under = between > cap + light + 0.04, between < cap - light - 0.04
    assert np.all(found.proof_shadow[apart] == 1)
    # Sums of up to 600 weights in float32
    assert np.all(found.proof_shadow[under] < 1e-5)
    assert apart.sum() > 1000
    assert under.sum() > 100


@pytest.mark.parametrize(
    ("params", "name"),
    [
        (Params(grid=1), "grid"),
        (Params(grid=256, l_max=10), "grid"),
        (Params(l_max=11), "l_max"),
        (Params(rays=24), "rays"),
        (Params(adaptive=-0.1), "adaptive"),
        (Params(adaptive=float("nan")), "adaptive"),
        (Params(proof=-1), "proof"),
    ],
)
def test_knobs_out_of_range_are_refused(params: Params, name: str) -> None:
    with pytest.raises(InputError, match=name):
        occlusion.trace(BALL, params=params)


def test_meshes_without_area_are_refused() -> None:
    line = replace(BALL, vertices=BALL.vertices * [1.0, 0, 0])
    with pytest.raises(InputError, match="area"):
        occlusion.trace(line, params=QUICK)
    none = {"faces": BALL.faces[:0], "normals": BALL.normals[:0], "material": BALL.material[:0]}
    with pytest.raises(InputError, match="faces"):
        occlusion.trace(replace(BALL, **none), params=QUICK)


def test_faces_without_area_are_dropped() -> None:
    point = np.zeros((3, 3), np.int64)
    more = replace(
        BALL,
        faces=np.concatenate([BALL.faces, point]),
        normals=np.concatenate([BALL.normals, BALL.normals[:3]]),
        material=np.zeros(len(BALL.faces) + 3, np.int32),
    )
    found, plain = (occlusion.trace(mesh, params=QUICK) for mesh in (more, BALL))
    assert found.quality["faces_without_area"] == 3
    assert np.array_equal(found.terms, plain.terms)


SMALL = small_meshes.sphere(4, 6)


@pytest.mark.parametrize("case", stage_battery.cases(SMALL), ids=str)
def test_battery(case: stage_battery.Case, tmp_path: Path) -> None:
    params = Params(grid=4, l_max=1, rays=32, proof=2)
    stage_battery.check(case, occlusion.trace, (SMALL,), params, tmp_path)


def test_round_trip(tmp_path: Path) -> None:
    found = occlusion.trace(BALL, params=QUICK)
    found.save(tmp_path)
    again = OcclusionHarmonics.load(tmp_path)
    assert again.box == found.box
    assert again.proof_radii == found.proof_radii
    for name in ("terms", "inside", "spread", "error", "proof_lights", "proof_shadow"):
        assert np.array_equal(getattr(again, name), getattr(found, name))
