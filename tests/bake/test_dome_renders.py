"""Renders of a mesh under a dome of lights: closed forms, the ring's own renders, refusals."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bake import billboard, dome, dome_knobs, photographs, workers
from bake.dome_renders import Params, render
from bake.photographs import Photographs
from formats.errors import InputError, MachineError
from formats.mesh import Material
from maths.circular_harmonics import ring_direction
from tests.bake import small_meshes, stage_battery

POINT = Params(resolution=8, samples=4, lights=12, sun_diameter=0.0, transmission=0.0)


def test_a_plate_facing_the_viewer_gives_the_cosine() -> None:
    made = render(small_meshes.plate(), params=POINT)
    cosine = made.directions[:, 2]
    whole = made.pictures[:, made.coverage == 1]
    assert whole.shape[1] >= 16
    # White, under a sun of irradiance pi: radiance is the cosine, to single precision
    np.testing.assert_allclose(
        whole, np.broadcast_to(cosine[:, None, None], whole.shape), rtol=2e-6
    )
    assert (made.space, made.views, made.height) == ("linear", 1, pytest.approx(2.0))
    assert made.metres_per_texel == pytest.approx(2.0 / 8)
    assert made.pivot == (pytest.approx(4.0), pytest.approx(8.0))


def test_lights_are_spread_from_five_degrees_up() -> None:
    towards = Params(lights=200).towards()
    z = np.sort(towards[:, 2])
    assert np.degrees(np.arcsin(z[0])) > 5
    # Evenly in solid angle is evenly in z: each at the middle of its share
    np.testing.assert_allclose(np.diff(z), (1 - photographs.GRAZING) / 200, rtol=1e-9)
    nearest = np.sort(np.arccos(np.clip(towards @ towards.T, -1, 1)), axis=1)[:, 1]
    # A hexagonal grid of 200 on that area would have a spacing of .18 (measured .15)
    assert nearest.min() > 0.75 * np.sqrt(2 / np.sqrt(3) * 2 * np.pi * 0.91 / 200)


def test_a_ring_of_lights_gives_what_the_sprite_was_fitted_to() -> None:
    """The held-out renders of a ring sprite are the same rays under the same lights."""
    mesh = small_meshes.joined(
        small_meshes.box((0.5, 0.5, 0.5), (0.0, 0.5, 0.0)),
        small_meshes.plate((0, 1, 0.4), (0.0, 0.1, 0.0), 1.0),
    )
    shared: dict[str, Any] = {"resolution": 12, "samples": 4, "sky_fill": 0.3, "gloss": 0.5}
    ring = billboard.trace(
        mesh, params=billboard.Params(held_out=5, lights_per_sample=64, **shared)
    )
    angles = np.array(ring.held_out_angles)
    towards = ring_direction(angles, "view", billboard.Params().elevation)
    directions = tuple(tuple(float(v) for v in d) for d in towards)
    made = render(mesh, params=Params(directions=directions, **shared))
    flat = made.pictures.reshape(5, -1, 3)[:, ring.held_out_texels]
    assert flat.shape[1] > 8
    # Unit irradiance there, pi here; sums in another order
    np.testing.assert_allclose(flat, np.pi * ring.held_out, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(made.coverage, ring.alpha[0])
    assert made.pivot == ring.pivot


def test_views_are_stacked() -> None:
    mesh = small_meshes.box((0.7, 0.4, 0.2), (0.0, 0.4, 0.0))
    made = render(mesh, params=replace(POINT, views=4))
    rows = made.pictures.shape[1] // 4
    front, side, back = (made.coverage[v * rows : (v + 1) * rows] for v in range(3))
    assert np.array_equal(front, back)
    assert side.sum() < 0.5 * front.sum()
    one = render(mesh, params=replace(POINT, resolution=POINT.resolution, views=1))
    np.testing.assert_allclose(one.pictures, made.pictures[:, :rows], atol=2e-6)


def test_a_dome_of_renders_is_relit_like_a_plate() -> None:
    made = render(small_meshes.plate((1, 0, 2)), params=replace(POINT, lights=64))
    asset = dome.fit(made, params=dome.Params(coverage=True))
    assert (asset.channels, asset.coverage) == (15, True)
    # A clamped cosine is smooth: measured 39 dB
    assert asset.quality["fitted_psnr"] > 35


def test_threads_change_nothing() -> None:
    made = []
    for threads in (1, 3):
        workers.use(threads)
        try:
            made.append(render(small_meshes.sphere(), params=replace(POINT, resolution=100)))
        finally:
            workers.use(0)
    assert np.array_equal(made[0].pictures, made[1].pictures)
    assert np.array_equal(made[0].coverage, made[1].coverage)


def test_what_cannot_be_held_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photographs, "MAX_BYTES", 12 * 12 * 64 - 1)
    with pytest.raises(MachineError, match="12 lights on 1 views of 8 x 8"):
        render(small_meshes.plate(), params=POINT)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("resolution", 0), ("views", 17), ("samples", 0), ("lights", 0), ("sun_diameter", -0.1),
        ("sky_fill", float("nan")), ("transmission", 1.1), ("gloss", -1.0), ("field_of_view", 3.0),
        ("directions", ((0.0, 0.0, 0.0),)), ("directions", ((0.0, float("inf"), 1.0),)),
        ("directions", ((0.0, 1.0),)),
    ],
)  # fmt: skip
def test_knobs_out_of_range_are_named(name: str, value: Any) -> None:
    with pytest.raises(InputError) as refusal:
        render(small_meshes.plate(), params=replace(POINT, **{name: value}))
    assert refusal.value.field == name


def test_directions_may_have_any_length() -> None:
    made = render(small_meshes.plate(), params=replace(POINT, directions=((0.0, 0.0, 9.0),)))
    assert np.array_equal(made.directions, [[0.0, 0.0, 1.0]])


BATTERY_MESH = replace(
    small_meshes.plate((1, 0, 2), material=Material((0.5, 0.4, 0.3), double_sided=True)),
    colours=np.linspace(0, 1, 12).reshape(4, 3).astype(np.float32),
)


@pytest.mark.parametrize("case", stage_battery.cases(BATTERY_MESH), ids=str)
def test_battery(case: Any, tmp_path: Path) -> None:
    params = Params(resolution=6, samples=2, lights=4, gloss=0.5, sky_fill=0.1)
    error = stage_battery.check(case, render, (BATTERY_MESH,), params, tmp_path)
    if error is None:
        assert isinstance(Photographs.load(tmp_path / "spoilt"), Photographs)


def test_the_spiral_is_one() -> None:
    towards = dome_knobs.spiral(50, 0.1)
    np.testing.assert_allclose(np.sum(np.square(towards), axis=1), 1, atol=1e-12)
    assert towards[:, 2].min() > 0.1
