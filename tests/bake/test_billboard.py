"""Traced sprites against closed forms; frames, views and knobs."""

import threading
import tracemalloc
from dataclasses import fields, replace

import numpy as np
import pytest

from bake import billboard, workers
from bake.billboard import Params, trace
from formats.coefficients import Coefficients
from formats.errors import InputError
from formats.mesh import Material
from maths.circular_harmonics import evaluate, ring_direction
from maths.circular_signals import shadow_arc
from tests.bake import small_meshes, stage_battery
from tests.bake.plates import POINT, rounding, tilted_plate, whole

NORMALS = [(0, 0, 1), (1, 0, 1), (-1, 2, 2), (0, -3, 1), (4, 1, 0.5)]


@pytest.mark.parametrize("normal", NORMALS)
@pytest.mark.parametrize("axis", ["view", "up"])
@pytest.mark.parametrize(("lights", "terms"), [(64, 5), (16, 5), (12, 9), (7, 3)])
def test_a_tilted_plate_in_closed_form(normal, axis, lights, terms):
    params = replace(POINT, resolution=12, axis=axis, lights=lights, terms=terms)
    found = whole(trace(small_meshes.plate(normal), params=params))
    assert found.shape[1] >= 4
    expected = tilted_plate(normal, params)[:, None, None]
    np.testing.assert_allclose(
        found, np.broadcast_to(expected, found.shape), rtol=0, atol=rounding(params)
    )


def test_an_up_ring_is_not_a_view_ring():
    sheet = small_meshes.plate((1, 1, 2))
    view, up = (trace(sheet, params=replace(POINT, axis=axis)) for axis in ("view", "up"))
    assert view.ring.one_sided
    assert not up.ring.one_sided
    assert np.abs(whole(view) - whole(up)).max() > 0.05


@pytest.mark.parametrize("elevation", [-0.4, 0.0, 0.9])
def test_elevation(elevation):
    params = replace(POINT, elevation=elevation)
    master = trace(small_meshes.plate((1, 0, 1)), params=params)
    assert master.ring.one_sided == (elevation >= 0)
    expected = tilted_plate((1, 0, 1), params)[:, None, None]
    assert np.abs(whole(master) - expected).max() < rounding(params)


@pytest.mark.parametrize("terms", [1, 5, 9])
def test_a_constant_signal_is_exact(terms):
    """A plate across the view: every light of the ring is as good as any other."""
    params = replace(POINT, terms=terms)
    found = whole(trace(small_meshes.plate(), params=params))
    constant = np.sqrt(2 * np.pi) * np.sin(params.elevation) / np.pi
    np.testing.assert_allclose(found[0], constant, rtol=64 * 2.0**-24)
    # The sums of the sines and cosines of 64 float32 directions cancel to their rounding
    assert np.abs(found[1:]).max(initial=0.0) < 64 * 2.0**-24 * constant


def test_colour_and_albedo_scale_the_coefficients():
    white = whole(trace(small_meshes.plate((1, 0, 2)), params=POINT))
    colour = (0.25, 0.5, 0.75)
    painted = small_meshes.plate((1, 0, 2), material=Material(base_color=colour))
    found = whole(trace(painted, params=POINT))
    np.testing.assert_allclose(found, white * np.float32(colour), rtol=4 * 2.0**-24, atol=1e-7)


@pytest.mark.parametrize("diameter", [0.0, 0.3])
def test_the_shadow_of_a_wall(diameter):
    """A long wall at x = d, height h, on a plate across the view shades the arc |t| < w of the
    ring, cos w = d tan e / h."""
    d, h = 0.25, 0.5
    wall = small_meshes.mesh_of(
        [[d, -1, 0], [d, 1, 0], [d, 1, h], [d, -1, h]], [[0, 1, 2], [0, 2, 3]]
    )
    params = replace(POINT, resolution=64, lights=256, samples=16, sun_diameter=diameter)
    params = replace(params, lights_per_sample=256)
    master = trace(small_meshes.joined(small_meshes.plate(), wall), params=params)
    texel = master.metres_per_texel
    # Texels in the middle row, .08 to .17 m from the wall: the shadow's end is still on the plate
    row, columns = 32, np.arange(34, 38)
    x = -1 + (columns + 0.5) * texel
    tan = np.tan(params.elevation)
    lit = np.sin(params.elevation) / np.pi
    for column, distance in zip(columns, d - x, strict=True):
        w, near, far = (
            np.arccos(s * tan / h) for s in (distance, distance - texel, distance + texel)
        )
        t = np.zeros(5)
        t[0] = np.sqrt(2 * np.pi)
        expected = lit * (t - shadow_arc(w, 5))
        # Each of two edges is smeared over the texel, over one light's step, and over the disc:
        # radius / cos e by azimuth, radius d / (h cos^2 e sin w) by height, under half of that
        smear = abs(near - far) / 2 + diameter / np.cos(params.elevation) + 2 * np.pi / 256
        # The disc itself lights the plate by its mean cosine, off by at most cos of its radius
        bound = 2 * smear * lit / np.sqrt(np.pi) + (1 - np.cos(diameter / 2)) * lit * 4
        found = master.terms[0, :, row, column, 0]
        np.testing.assert_allclose(found, expected, rtol=0, atol=bound)
        # The bound tells a shadow from none
        assert np.abs(expected[2]) > 2 * bound


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 1, 0.3), (0, -1, 0.3), (1, 0, 1)])
@pytest.mark.parametrize(("samples", "bound"), [(16, 0.04), (1024, 0.002)])
def test_sky_fill_in_closed_form(normal, samples, bound):
    """A sky of radiance f (1 + y) / 2 pi: irradiance f (1/2 + n_y / 3), of which 1 / pi is sent.

    Measured: under 2.8 % off with 64 directions, under .06 % with 1,024.
    """
    n_y = normal[1] / np.linalg.norm(normal)
    params = replace(POINT, samples=samples, resolution=6, lights=8, elevation=0.0)
    sheet = small_meshes.plate(normal)
    filled, dark = (trace(sheet, params=replace(params, sky_fill=f)) for f in (0.8, 0.0))
    added = whole(filled) - whole(dark)
    expected = np.sqrt(2 * np.pi) * 0.8 * (0.5 + n_y / 3) / np.pi
    np.testing.assert_allclose(added[0], expected, rtol=bound)
    np.testing.assert_array_equal(added[1:], 0)


def test_threads_change_no_bit(monkeypatch):
    mesh = small_meshes.joined(
        small_meshes.sphere(), small_meshes.plate((1, 1, 2), (0.8, 0.8, 0.8), 0.5)
    )
    monkeypatch.setattr(billboard, "TILE", 100)
    params = replace(POINT, resolution=40, held_out=4, views=2, sky_fill=0.2)
    results = []
    for count in (1, 2, 5):
        monkeypatch.setattr(workers, "_count", count)
        results.append(trace(mesh, params=params))
    for name in (f.name for f in fields(Coefficients)):
        first, *others = (getattr(r, name) for r in results)
        for other in others:
            np.testing.assert_equal(other, first)


def test_tiles_change_next_to_nothing(monkeypatch):
    """A tile is a matter of memory: only the order of float32 sums depends on it."""
    mesh = small_meshes.sphere()
    params = replace(POINT, resolution=40, held_out=4)
    plain = trace(mesh, params=params)
    monkeypatch.setattr(billboard, "TILE", 100)
    tiled = trace(mesh, params=params)
    np.testing.assert_array_equal(plain.alpha, tiled.alpha)
    np.testing.assert_array_equal(plain.held_out_texels, tiled.held_out_texels)
    np.testing.assert_allclose(plain.terms, tiled.terms, rtol=0, atol=rounding(params))


def test_memory_does_not_grow_with_the_lights(monkeypatch):
    """From 16 lights on there is one block of them in memory (measured: 1.9 % more for 256)."""
    monkeypatch.setattr(workers, "_count", 1)
    mesh = small_meshes.sphere()
    peaks = {}
    for lights in (16, 16, 256):
        params = replace(POINT, resolution=56, lights=lights, lights_per_sample=lights)
        tracemalloc.start()
        trace(mesh, params=params)
        peaks[lights] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peaks[16] > 1e6
    assert peaks[256] < 1.05 * peaks[16]


def test_progress_runs_to_one(monkeypatch):
    monkeypatch.setattr(billboard, "TILE", 64)
    said = []
    trace(small_meshes.sphere(), params=replace(POINT, resolution=32), progress=said.append)
    assert said == sorted(said)
    assert said[-1] == 1.0
    assert threading.active_count() < 20


def test_the_report_measures_the_fit():
    master = trace(small_meshes.sphere(), params=replace(POINT, resolution=24, held_out=8))
    quality = master.quality
    assert quality["condition"] == pytest.approx(np.sqrt(2), abs=0.5)
    assert quality["largest_gap_degrees"] == pytest.approx(360 / 64)
    assert quality["terms_used"] == 5
    assert quality["covered_texels"] == np.count_nonzero(master.alpha)
    # Recompute the minimum and the held-out error from the coefficients themselves
    t = 2 * np.pi * np.arange(64) / 64
    relit = np.einsum("khwc,tk->thwc", master.terms[0], evaluate(t, 5))
    assert quality["minimum"] == pytest.approx(relit.min(), abs=1e-6)
    assert len(master.held_out_angles) == 8
    basis = evaluate(np.array(master.held_out_angles), 5)
    texels = master.terms[0].reshape(5, -1, 3)[:, master.held_out_texels]
    error = np.maximum(np.einsum("kpc,mk->mpc", texels, basis), 0) - master.held_out
    expected = 20 * np.log10(master.held_out.max() / np.sqrt(np.mean(error**2)))
    assert quality["held_out_psnr"] == pytest.approx(expected, abs=1e-3)
    assert not quality["notes"]


def test_leave_one_out_is_that_of_refitting():
    """A plate's residual, refitted without each light in turn by least squares."""
    params = replace(POINT, lights=16, terms=5)
    master = trace(small_meshes.plate((1, 0, 0.4)), params=params)
    t = 2 * np.pi * np.arange(16) / 16
    n = np.array([1, 0, 0.4]) / np.hypot(1, 0.4)
    X = np.maximum(0, ring_direction(t, "view", params.elevation) @ n) / np.pi
    basis, errors = evaluate(t, 5), []
    for i in range(16):
        others = np.arange(16) != i
        Y = np.linalg.lstsq(basis[others], X[others], rcond=None)[0]
        errors.append(X[i] - basis[i] @ Y)
    expected = np.sqrt(np.mean(np.square(errors)))
    # A difference of two float32 mean squares of about .02
    assert master.quality["leave_one_out_rms"] == pytest.approx(expected, rel=1e-4)


def test_too_few_lights_lower_the_order_and_say_so():
    params = replace(POINT, lights=3, terms=5)
    master = trace(small_meshes.plate((1, 0, 1)), params=params)
    assert master.quality["terms_used"] == 3
    assert any("3 distinct azimuths" in note for note in master.quality["notes"])
    np.testing.assert_array_equal(master.terms[:, 3:], 0)
    assert trace(small_meshes.plate(), params=replace(POINT, lights=1)).quality["terms_used"] == 1


def test_a_black_mesh_has_a_report_too():
    black = small_meshes.sphere(material=Material(base_color=(0.0, 0.0, 0.0)))
    master = trace(black, params=replace(POINT, held_out=4))
    np.testing.assert_array_equal(master.terms, 0)
    stage_battery.require_finite(master)


KNOBS = [
    ("resolution", 0), ("resolution", 8193), ("resolution", 2.5), ("views", 0), ("views", 17),
    ("samples", 0), ("samples", float("nan")), ("axis", "sideways"), ("elevation", 1.6),
    ("lights", 0), ("lights", -1), ("lights", 5000), ("terms", 4), ("terms", 35),
    ("sun_diameter", -0.1), ("sky_fill", float("nan")), ("transmission", 1.1), ("gloss", -1),
    ("field_of_view", 3.0), ("lights_per_sample", -1), ("held_out", 257),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), KNOBS)
def test_knobs_out_of_range_are_named(name, value):
    with pytest.raises(InputError) as refusal:
        trace(small_meshes.plate(), params=replace(POINT, **{name: value}))
    assert refusal.value.field == name
    assert refusal.value.exit_code == 2


def test_an_empty_mesh_is_refused():
    empty = replace(
        small_meshes.plate(),
        faces=np.zeros((0, 3), np.int64),
        normals=np.zeros((0, 3, 3), np.float32),
        material=np.zeros(0, np.int32),
    )
    with pytest.raises(InputError, match="no faces"):
        trace(empty, params=POINT)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_broken_vertices_are_refused(value):
    sheet = small_meshes.plate()
    vertices = sheet.vertices.copy()
    vertices[2, 1] = value
    with pytest.raises(InputError) as refusal:
        trace(replace(sheet, vertices=vertices), params=POINT)
    assert refusal.value.field == "vertices"


BATTERY_MESH = replace(
    small_meshes.plate((1, 0, 2), material=Material((0.5, 0.4, 0.3), double_sided=True)),
    uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
    colours=np.linspace(0, 1, 12).reshape(4, 3).astype(np.float32),
)


@pytest.mark.parametrize("case", stage_battery.cases(BATTERY_MESH), ids=str)
def test_battery(case, tmp_path):
    params = Params(resolution=6, samples=2, lights=8, held_out=2, gloss=0.5, sky_fill=0.1)
    stage_battery.check(case, trace, (BATTERY_MESH,), params, tmp_path)
