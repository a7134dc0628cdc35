"""Transfer against closed forms: open skies, walls, corners, furnaces; and what it must not do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bake import subdivision, transfer, transfer_gather, transfer_mesh, transfer_rays, workers
from bake.rays import RayScene
from formats.errors import InputError
from formats.mesh import Material, Mesh
from maths import spherical_harmonics
from tests.bake import stage_battery
from tests.bake.small_meshes import WHITE, box, directions, joined, mesh_of, plate, sphere

UNIFORM = 2 * np.sqrt(np.pi)  # the only coefficient of light of radiance 1 from everywhere


def found(mesh: Mesh, **knobs: Any) -> tuple[Mesh, np.ndarray]:
    """The mesh with one normal a vertex, and its vectors (n, C, K)."""
    single = transfer_mesh.split(mesh)
    whole = transfer_mesh.two_sided(single)
    params = transfer.Params(**knobs)
    return whole, transfer.vectors(single, whole, params, workers.silent).vectors


def irradiance_by_quadrature(normal: np.ndarray, light: np.ndarray, l_max: int) -> float:
    """Integral of L cos over the hemisphere about a normal: exact, as L is a polynomial."""
    z, w = np.polynomial.legendre.leggauss(l_max + 2)
    z, w = (z + 1) / 2, w / 2
    phi = 2 * np.pi * np.arange(2 * l_max + 3) / (2 * l_max + 3)
    x = np.cross(normal, [0.3, 0.9, 0.1])
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    ring = np.sqrt(1 - z * z)[:, None, None]
    around = np.cos(phi)[:, None] * x + np.sin(phi)[:, None] * y
    toward = ring * around + z[:, None, None] * normal
    radiance = spherical_harmonics.evaluate(toward, l_max) @ light
    return float(np.sum(radiance * (w * z)[:, None]) * 2 * np.pi / len(phi))


def test_unshadowed_is_the_irradiance_of_the_light(rng: np.random.Generator) -> None:
    mesh, vectors = found(sphere(6, 8), mode="unshadowed")
    light = rng.normal(size=25)
    normals = transfer_mesh.normals_of(mesh).astype(np.float64)
    expected = [irradiance_by_quadrature(n / np.linalg.norm(n), light, 4) for n in normals]
    # Vectors are float32: 25 terms of up to 3
    np.testing.assert_allclose(vectors[:, 0] @ light, expected, atol=3e-6)


def test_nothing_hides_anything_from_a_sphere() -> None:
    _, vectors = found(sphere(), mode="shadowed", rays=256)
    # float32
    np.testing.assert_allclose(vectors[:, 0, 0] * UNIFORM, np.pi, atol=1e-6)


@pytest.mark.parametrize(("walls", "expected"), [(1, np.pi / 2), (2, np.pi / 4)])
def test_at_the_foot_of_walls(walls: int, expected: float) -> None:
    floor = plate((0, 1, 0), (0, 0, 0), 50)
    parts = [floor, plate((1, 0, 0), (-50, 50, 0), 50), plate((0, 0, 1), (0, 50, -50), 50)]
    mesh = subdivision.subdivide(joined(*parts[: 1 + walls]), 8.0)
    mesh, vectors = found(mesh, mode="shadowed", rays=1024)
    up = transfer_mesh.normals_of(mesh)[:, 1] > 0.5
    at = np.isclose(mesh.vertices[:, 0], -50) & up
    at &= np.isclose(mesh.vertices[:, 2], -50) if walls == 2 else np.abs(mesh.vertices[:, 2]) < 20
    assert at.any()
    # Rays miss pi times 1/1024^0.75 of it, and the walls end at 89.9 degrees
    np.testing.assert_allclose(vectors[at, 0, 0] * UNIFORM, expected, atol=0.012)
    # Away from it the wall is a rectangle that stands across: a closed form
    if walls == 1:
        far = up & (np.abs(mesh.vertices[:, 2]) < 1) & (mesh.vertices[:, 0] > -45)
        away = mesh.vertices[far, 0] + 50
        top = np.hypot(away, 100)
        wall = np.arctan(50 / away) - away / top * np.arctan(50 / top)
        assert wall.max() > 0.3
        np.testing.assert_allclose(vectors[far, 0, 0] * UNIFORM, np.pi - wall, atol=0.012)


def test_a_plate_lets_its_own_side_see_the_whole_sky_and_the_other_none() -> None:
    thin = replace(WHITE, double_sided=True)
    mesh, vectors = found(plate((0, 1, 0), material=thin), mode="interreflected", rays=64)
    assert len(mesh.faces) == 4
    np.testing.assert_allclose(vectors[:, 0, 0] * UNIFORM, np.pi, atol=1e-6)
    up = transfer_mesh.normals_of(mesh)[:, 1] > 0
    assert up.sum() == (~up).sum() == 4
    down = spherical_harmonics.evaluate(np.array([0.0, -1.0, 0.0]), 4)
    # A light from below: bands up to 4 leave 5 % of the clamped cosine
    np.testing.assert_allclose(vectors[up, 0] @ down, 0, atol=0.06)
    np.testing.assert_allclose(vectors[~up, 0] @ down, 1, atol=0.06)


def inverted(mesh: Mesh) -> Mesh:
    return mesh_of(mesh.vertices, mesh.faces[:, ::-1], mesh.materials[0])


def rows_of(mesh: Mesh, rays: int) -> list[np.ndarray]:
    """What each channel's matrix makes of 1 everywhere."""
    single = transfer_mesh.split(mesh)
    whole = transfer_mesh.two_sided(single)
    scene = RayScene(single.vertices, single.faces)
    normals = transfer_mesh.normals_of(whole)
    starts = transfer_rays.starts_of(scene, whole.faces, normals, len(normals), 3)
    vertices = np.arange(len(normals))
    origins, toward = transfer_rays.rays_of(starts, transfer_rays.pattern(rays, 2), vertices)
    hits = scene.intersect(origins, toward)
    found = transfer_gather.gathered(scene, single, whole, hits, toward, len(vertices))
    return [matrix @ np.ones(len(vertices)) for matrix in found]


def test_a_closed_room_returns_its_albedo_at_every_bounce() -> None:
    paint = Material(base_color=(0.9, 0.5, 0.2))
    room = inverted(box((1.0, 2.0, 0.5)))
    room = subdivision.subdivide(replace(room, materials=(paint,)), 0.7)
    for channel, rho in zip(rows_of(room, 128), paint.base_color, strict=True):
        # All rays hit: a sum of 128 float32 weights
        np.testing.assert_allclose(channel, rho, rtol=2e-5)


def test_no_light_comes_into_a_closed_room() -> None:
    room = subdivision.subdivide(inverted(box()), 0.7)
    _, vectors = found(room, rays=128)
    # Only bands that the rays' own error leaves
    np.testing.assert_allclose(vectors[:, :, 0] * UNIFORM, 0, atol=1e-5)


def test_in_an_even_sky_white_walls_are_as_bright_as_the_sky() -> None:
    corner = [plate(n, c, 1) for n, c in (((0, 1, 0), (0, 0, 0)), ((1, 0, 0), (-1, 1, 0)))]
    mesh = subdivision.subdivide(joined(*corner), 0.5)
    _, vectors = found(mesh, rays=128, bounces=40)
    assert vectors.shape[1] == 1
    # At most half of what a vertex sees is wall, so 2^-40 is left, and float32
    np.testing.assert_allclose(vectors[:, 0, 0] * UNIFORM, np.pi, rtol=2e-5)
    _, direct = found(mesh, rays=128, mode="shadowed")
    assert (direct[:, 0, 0] * UNIFORM).min() < 0.6 * np.pi


def test_colour_comes_from_what_is_hit() -> None:
    red = Material(base_color=(1.0, 0.0, 0.0))
    floor, wall = plate((0, 1, 0), material=red), plate((1, 0, 0), (-1, 1, 0))
    mesh = subdivision.subdivide(joined(floor, wall), 0.5)
    whole, vectors = found(mesh, rays=128, bounces=1)
    _, direct = found(mesh, rays=128, mode="shadowed")
    upright = transfer_mesh.normals_of(whole)[:, 0] > 0.5
    assert vectors.shape[1] == 3
    np.testing.assert_array_equal(vectors[upright, 1], direct[upright, 0])
    low = upright & (whole.vertices[:, 1] < 0.1)
    # Half of what the foot of the wall sees is floor, itself half in the open
    gain = (vectors[low, 0, 0] - direct[low, 0, 0]) * UNIFORM
    assert 0.1 * np.pi < gain.min() < gain.max() < 0.4 * np.pi
    np.testing.assert_allclose(vectors[~upright, 0], vectors[~upright, 1], atol=1e-6)


def test_the_backs_of_thin_sheets_shine_by_their_own_light() -> None:
    thin = replace(WHITE, double_sided=True)
    mesh = joined(plate((0, 1, 0)), plate((0, 1, 0), (0, 0.3, 0), material=thin))
    up_only = joined(plate((0, 1, 0)), plate((0, 1, 0), (0, 0.3, 0)))
    lit, dark = (found(subdivision.subdivide(m, 0.5), rays=128, bounces=1) for m in (mesh, up_only))
    floor = [m.vertices[:, 1] < 0.1 for m, _ in (lit, dark)]
    sums = [v[f, 0, 0].sum() for (_, v), f in zip((lit, dark), floor, strict=True)]
    direct = found(subdivision.subdivide(up_only, 0.5), rays=128, mode="shadowed")[1]
    # The back of a one-sided sheet is black: no bounce comes from it
    assert sums[1] == pytest.approx(direct[floor[1], 0, 0].sum(), rel=1e-6)
    assert sums[0] > 1.05 * sums[1]


@pytest.mark.parametrize("mode", transfer.MODES)
def test_threads_change_no_bit(mode: str) -> None:
    mesh = joined(sphere(8, 12), plate((0, 1, 0), (0, -1, 0), 2))
    assets = []
    try:
        for count in (1, 2, 4):
            workers.use(count)
            params = transfer.Params(mode=mode, rays=64, edge=0.1)
            assets.append(transfer.trace(mesh, params=params))
    finally:
        workers.use(0)
    for other in assets[1:]:
        assert other.codes.tobytes() == assets[0].codes.tobytes()
        assert other.layout.basis.tobytes() == assets[0].layout.basis.tobytes()


def test_more_rays_err_less_and_the_report_says_so() -> None:
    mesh = subdivision.subdivide(
        joined(plate((0, 1, 0)), plate((1, 0, 0), (-1, 1, 0)), sphere(6, 9)), 0.6
    )
    truth = found(mesh, mode="shadowed", rays=8192)[1]
    single = transfer_mesh.split(mesh)
    errors, told = [], []
    for rays in (64, 512):
        params = transfer.Params(mode="shadowed", rays=rays)
        one = transfer.vectors(single, single, params, workers.silent)
        errors.append(np.sqrt(np.mean((one.vectors - truth) ** 2)))
        told.append(one.error)
    # Spirals err like rays^-0.75: 0.21; independent rays would like 0.35
    assert errors[1] < 0.3 * errors[0]
    # Single runs; tests of the bars take twenty
    assert all(0.8 * e < t < 1.25 * e for e, t in zip(errors, told, strict=True))


def test_size_and_place_change_nothing() -> None:
    mesh = joined(plate((0, 1, 0)), plate((1, 0, 0), (-1, 1, 0)))
    one = found(subdivision.subdivide(mesh, 0.5), mode="shadowed")[1]
    moved = replace(mesh, vertices=mesh.vertices * 1e3 + [5e4, -2e4, 1e4])
    other = found(subdivision.subdivide(moved, 500.0), mode="shadowed")[1]
    # A ray along an edge may end on its other side
    assert np.abs(one - other).max() < 0.03
    assert np.mean(np.abs(one - other) > 1e-5) < 0.01


def test_stored_numbers_keep_the_irradiance(rng: np.random.Generator) -> None:
    mesh = joined(sphere(8, 12), plate((0, 1, 0), (0, -1, 0), 2))
    fine = transfer.trace(
        mesh, params=transfer.Params(mode="shadowed", rays=64, components=25, depth=16)
    )
    toward = spherical_harmonics.evaluate(directions(rng, 3), 4)
    light = np.repeat(toward[:, :, None], 3, axis=2)
    exact = found_of(mesh, mode="shadowed", rays=64) @ toward.T
    for number in range(3):
        got = fine.irradiance(np.stack([light[number]] * 6))[:, 0]
        # Half floats: 2^-11 of each of 25 numbers up to 2
        np.testing.assert_allclose(got, exact[:, number], atol=2e-3)
    coarse = transfer.trace(mesh, params=transfer.Params(mode="shadowed", rays=64))
    assert coarse.codes.shape[1] == 24
    assert 1e-4 < fine.quality["irradiance_rms"] * 10 < coarse.quality["irradiance_rms"] < 0.02


def found_of(mesh: Mesh, **knobs: Any) -> np.ndarray:
    """Vectors (n, K) of a mesh cut as `trace` cuts it."""
    longest = np.ptp(mesh.vertices, axis=0).max() * transfer.Params().edge
    return np.asarray(found(subdivision.subdivide(mesh, longest), **knobs)[1][:, 0])


@pytest.mark.parametrize(
    ("knob", "value"),
    [
        ("mode", "bright"),
        ("l_max", 11),
        ("rays", 1),
        ("bounces", 0),
        ("edge", 1e-5),
        ("components", 33),
        ("depth", 12),
    ],
)
def test_bad_knobs_are_named(knob: str, value: Any) -> None:
    with pytest.raises(InputError, match=knob):
        transfer.trace(plate(), params=transfer.Params(**{knob: value}))


def test_a_mesh_without_area_is_refused() -> None:
    flat = mesh_of(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="faces"):
        transfer.trace(flat, params=transfer.Params())


BATTERY = joined(plate((0, 1, 0)), plate((1, 0, 0), (-1, 1, 0)))
QUICK = transfer.Params(rays=8, edge=0.0, l_max=1, components=4)


@pytest.mark.parametrize("case", stage_battery.cases(BATTERY), ids=str)
def test_battery(case: stage_battery.Case, tmp_path: Path) -> None:
    stage_battery.check(case, transfer.trace, (BATTERY,), QUICK, tmp_path)
