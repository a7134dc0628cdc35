"""The study of normal maps: the baseline is what it says, and errors are those of closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from bake import billboard, dome_renders
from bake.photographs import Photographs
from formats.mesh import Material, Mesh
from maths.colour import srgb_decode, srgb_encode
from pipelines.studies import normal_map, normal_mapped, sprite_methods, subjects

ALBEDO = (0.6, 0.3, 0.1)
KNOBS = billboard.Params(resolution=12, samples=4)
CODE = 0.5 / 255  # half a code, of values up to 1


def quad() -> Mesh:
    """A coloured square of a metre that faces +z and fills its sprite."""
    corners = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]], np.float64)
    normals = np.zeros((2, 3, 3), np.float32)
    normals[..., 2] = 1
    kinds = (Material(base_color=ALBEDO),)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), normals, np.zeros(2, np.int32), kinds)


def training(mesh: Mesh) -> Photographs:
    """Renders of a mesh as the study fits them, small."""
    return dome_renders.render(mesh, params=dome_renders.Params(resolution=12, samples=4))


def test_unseen_lights_are_spread_and_fitted_by_nothing() -> None:
    lights = normal_map.unseen()
    assert lights.shape == (32, 3)
    np.testing.assert_allclose(np.linalg.norm(lights, axis=1), 1, atol=1e-12)
    assert np.count_nonzero(lights[:, 2] < 0.5) == 16
    # No quarter of the sky has less than a sixth of them
    quarters = np.histogram(np.arctan2(lights[:, 1], lights[:, 0]), 4, (-np.pi, np.pi))[0]
    assert quarters.min() >= 6
    # Lights of the ring stand at 30 degrees (measured: .8 degrees away; 2 from the dome's)
    assert np.degrees(np.abs(np.arcsin(lights[:, 2]) - np.pi / 6)).min() > 0.5
    fitted = dome_renders.Params().towards()
    assert np.degrees(np.arccos(np.clip(lights @ fitted.T, -1, 1))).min() > 1


def test_normal_map_of_a_plane_is_lambert() -> None:
    sprite = normal_mapped.trace(quad(), KNOBS)
    assert np.all(sprite.alpha == 1)
    assert np.all(sprite.normal == [0, 0, 1])
    stored = srgb_decode(np.rint(255 * srgb_encode(np.array(ALBEDO))) / 255)
    for light in normal_map.unseen(4):
        lit = sprite.relit(light)
        np.testing.assert_allclose(lit, np.broadcast_to(stored * light[2], lit.shape), rtol=1e-5)


def test_normal_map_of_a_ball_has_its_normals() -> None:
    mesh = normal_mapped.ball()
    sprite = normal_mapped.trace(mesh, replace(KNOBS, resolution=40))
    x = (np.arange(40) + 0.5) / 20 - 1
    x, y = np.meshgrid(x, -x)
    inside = np.hypot(x, y) < 0.8
    truth = np.stack([x, y, np.sqrt(np.where(inside, 1 - x * x - y * y, 0))], axis=-1)
    # Half a signed code, and the mean over a texel (measured together: .0039)
    np.testing.assert_allclose(sprite.normal[inside], truth[inside], atol=0.5 / 127 + 0.002)


def test_ball_is_closed_and_looks_outward() -> None:
    mesh = normal_mapped.ball(12)
    # Its seam has two copies of a point: join equal places
    _, joined = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)
    faces = joined.ravel()[mesh.faces]
    _, uses = np.unique(
        np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True
    )
    assert set(uses.tolist()) == {2}
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c - [0, 0.75, 0])
    assert outward.min() > 0


def test_strengths_of_sun_and_ambient_are_found_again() -> None:
    sprite = normal_mapped.trace(normal_mapped.ball(), replace(KNOBS, resolution=24))
    lights = normal_map.unseen(8)
    known = replace(sprite, sun=0.7, ambient=0.12)
    pictures = np.stack([known.relit(light) for light in lights])
    found = normal_mapped.fitted(sprite, Photographs(pictures, lights, "linear"))
    # Single precision of the pictures, and the solver's stop at 1e-8 of the cost
    assert found.sun == pytest.approx(0.7, abs=1e-4)
    assert found.ambient == pytest.approx(0.12, abs=1e-4)


def test_area_filter_keeps_what_there_is(rng: np.random.Generator) -> None:
    common = billboard.frame_of(quad(), KNOBS)
    picture = rng.random((12, 12, 3)).astype(np.float32)
    same = normal_mapped.shown(picture, common, common)
    np.testing.assert_allclose(same, picture, atol=2e-7)
    fine = billboard.frame_of(quad(), replace(KNOBS, resolution=36))
    larger = np.kron(picture, np.ones((3, 3, 1), np.float32))
    shown = normal_mapped.shown(larger, fine, common)
    # Sums of 36 texels in float64, kept in float32
    np.testing.assert_allclose(shown, picture, atol=1e-6)


@pytest.mark.parametrize("space", ["linear", "stored"])
def test_polynomials_meet_a_plane_to_a_code(space: str) -> None:
    # Under sun from z a plane sends albedo z; z^2 = 1 - x^2 - y^2 is a polynomial, so light it so
    lights = dome_renders.Params().towards()
    value = np.array(ALBEDO) * lights[:, 2:] ** 2
    linear = srgb_decode(value) if space == "stored" else value
    pictures = np.broadcast_to(linear[:, None, None], (64, 2, 3, 3)).astype(np.float32)
    relit = sprite_methods.polynomials(Photographs(pictures, lights, "linear"), space)
    for light in normal_map.unseen(4):
        made = relit(light)
        seen = srgb_encode(made) if space == "stored" else made
        expected = np.broadcast_to(np.array(ALBEDO) * light[2] ** 2, made.shape)
        # A plane has one value a number, so that no scale is needed; single precision is left
        np.testing.assert_allclose(seen, expected, atol=1e-5)


def test_polynomials_have_eight_bits(rng: np.random.Generator) -> None:
    lights = dome_renders.Params().towards()
    made = rng.random((6, 8, 8, 3))
    values = np.einsum("nk,khwc->nhwc", sprite_methods.dome_report.polynomial(lights), made)
    relit = sprite_methods.polynomials(
        Photographs(values.astype(np.float32), lights, "linear"), "linear"
    )
    light = normal_map.unseen(4)[1]
    basis = sprite_methods.dome_report.polynomial(light)
    off = relit(light) - np.maximum(np.einsum("k,khwc->hwc", basis, made), 0)
    # Each of six numbers, within 0..1, is off by up to half a code: no more, but clearly something
    assert 1e-4 < np.abs(off).max() <= CODE * np.abs(basis).sum() + 1e-5


def test_ring_and_dome_show_a_plane() -> None:
    lights = normal_map.unseen(8)
    ring = sprite_methods.ring(quad(), KNOBS)
    elevation = float(np.sin(KNOBS.elevation))
    dome = sprite_methods.hemisphere(training(quad()), "linear")
    for light in lights:
        # A ring knows its own elevation alone: a plane stays as bright as it was there
        expected = np.broadcast_to(np.array(ALBEDO) * elevation, (12, 12, 3))
        # Half a code of .3 for the constant; planes of the other terms hold nothing
        np.testing.assert_allclose(ring(light), expected, atol=0.0006)
        expected = np.broadcast_to(np.array(ALBEDO) * light[2], (12, 12, 3))
        # The penalised fit bends the cosine a little (measured: .0022 at the lowest light)
        np.testing.assert_allclose(dome(light), expected, atol=0.004)


def test_errors_are_those_of_closed_forms() -> None:
    lights = normal_map.unseen(8)
    pictures = np.full((8, 4, 4, 3), srgb_decode(np.array(0.5)), np.float32)
    coverage = np.zeros((4, 4), np.float32)
    coverage[1:3, 1:3] = 0.5
    picture = np.full((4, 4, 3), srgb_decode(np.array(0.6)), np.float32)
    # Outside coverage anything may stand
    picture[0] = 1
    truth = Photographs(pictures, lights, "linear", coverage=coverage)
    one = normal_map.Subject(truth, {"ring": lambda light: picture}, (1.0, 0.0), {"ring": 2.0})
    found = normal_map.errors(one)
    # A tenth off everywhere; single precision of .2
    np.testing.assert_allclose(found["ring"], 0.1, atol=1e-6)
    row = normal_map.rows_of("a", one, {"ring": 10 ** (-np.arange(8.0) / 20)})[0]
    assert (row["bytes_a_pixel"], row["bytes"], row["bake_seconds"]) == (12, 12 * 16, 2.0)
    told = [float(row[name]) for name in ("low", "high", "worst")]
    np.testing.assert_allclose(told, [1.5, 5.5, 0.0], atol=1e-12)
    # The error is the root of the mean square over the lights
    assert row["error"] == pytest.approx(np.sqrt(np.mean(10 ** (-np.arange(8.0) / 10))))


@pytest.mark.slow
def test_a_quick_run_answers() -> None:
    answer = normal_map.measure(subjects.Setting(quick=True))
    table = {str(row["subject"]): row for row in answer.table}
    assert set(table) == {"knot", "ball"}
    # Measured: 4.3 dB better on the knot, 9.8 dB worse on the ball
    assert normal_map.gain(table["knot"], "dome", "normal_16") > 2
    assert normal_map.gain(table["ball"], "dome", "normal_16") < -5
    assert "wins on ball" in answer.title
    for row in answer.rows:
        assert row["all"] == table[str(row["subject"])][str(row["method"])]
        assert row["all"] == pytest.approx((float(row["low"]) + float(row["high"])) / 2, rel=1e-9)
