"""Whole volumes against closed forms: a box, a plate and its half-space, a ball, a ring.

Each must lie within its own error bar of the truth, beyond what a polyhedron differs from the
round thing that it stands for.
"""

import numpy as np
import pytest

from bake import occlusion
from bake.occlusion import Params
from formats.mesh import Mesh
from formats.occlusion import OcclusionHarmonics
from maths.spherical_harmonics import band_of, turn_zonal
from maths.spherical_lights import project_polygon
from maths.spherical_projection import cap
from tests.bake import small_meshes

L_MAX, K = 4, 25
# |Y(l, m)| is at most sqrt((2 l + 1) / 4 pi), by Unsoeld's theorem
PEAK = np.sqrt((2 * band_of(L_MAX) + 1) / (4 * np.pi))


def outside(found: OcclusionHarmonics) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points (v, 3), coefficients (v, K) and error bars (v,) of the voxels outside."""
    kept = ~found.inside.ravel()
    points = found.box.voxel_centres(len(found.inside))
    return points[kept], found.terms.reshape(-1, K)[kept], found.spread.ravel()[kept]


def require(
    terms: np.ndarray, truth: np.ndarray, spread: np.ndarray, solid: np.ndarray | float = 0.0
) -> None:
    """A z-test; `solid` (v,) : steradians that the mesh may differ by from the truth."""
    bound = np.broadcast_to(solid, len(terms))[:, None] * PEAK
    off = terms - truth
    error = np.sign(off) * np.maximum(np.abs(off) - bound, 0)
    # Measured .89 to 1.04: the bar is no smaller than the error and not much larger
    assert rms(error) < 1.15 * rms(spread)
    assert rms(off) > 0.5 * rms(spread)
    # Halves may agree by chance where few rays hit; measured up to 4.2
    z = np.sqrt(np.mean(np.square(error), axis=1)) / np.maximum(spread, 0.3 * spread.mean())
    assert z.max() < 6
    # No coefficient is off on the whole: 25 of them, 4 standard errors
    standard = np.sqrt(np.mean(np.square(error), axis=0) / len(terms))
    assert np.all(np.abs(error.mean(axis=0)) < 4 * standard + 1e-6)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


def by_polygons(mesh: Mesh, points: np.ndarray, *, two_sided: bool = False) -> np.ndarray:
    """What convex polygons hide, as light that would come from them: those that face a point."""
    corners = mesh.vertices[mesh.faces]
    one = np.ones(3)
    parts = [project_polygon(points, c, one, L_MAX, two_sided=two_sided) for c in corners]
    return np.sum(parts, axis=0)[..., 0]


def test_a_box_is_the_faces_that_look_at_a_point() -> None:
    half, centre = np.array([1.0, 0.6, 0.3]), np.array([5.0, -2.0, 0.1])
    mesh = small_meshes.box(half, centre)
    found = occlusion.trace(mesh, params=Params(grid=8, rays=1024, proof=0))
    points, terms, spread = outside(found)
    # Voxel centres lie at odd sixteenths of the volume, the box's faces at quarters
    assert np.abs((points - centre) / half).max(axis=1).min() > 1.2
    assert found.inside.sum() == 4**3
    require(terms, by_polygons(mesh, points), spread)


def test_a_plate_is_a_rectangle() -> None:
    mesh = small_meshes.plate(normal=(0, 0, 1))
    found = occlusion.trace(mesh, params=Params(grid=10, rays=1024, proof=0))
    points, terms, spread = outside(found)
    require(terms, by_polygons(mesh, points, two_sided=True), spread)


def test_close_to_a_plate_is_a_half_space() -> None:
    mesh = small_meshes.plate(normal=(0, 0, 1))
    found = occlusion.trace(mesh, params=Params(grid=32, rays=512, proof=0))
    points, terms, spread = outside(found)
    near = (np.abs(points[:, 2]) < 0.02) & (np.abs(points[:, :2]).max(axis=1) < 0.3)
    points, terms, spread = points[near], terms[near], spread[near]
    assert len(points) == 2 * 16
    down = np.zeros_like(points)
    down[:, 2] = -np.sign(points[:, 2])
    truth = turn_zonal(cap(np.pi / 2, L_MAX), down)
    # (1.77245, 1.53499, 0, -.58618, 0) about the way down
    assert truth[0, [0, 6]] == pytest.approx([1.77245, 0], abs=1e-5)
    # Between the plate's edge and the horizon
    edge = 1 - np.abs(points[:, :2]).max(axis=1)
    rim = 2 * np.pi * np.abs(points[:, 2]) / np.hypot(edge, points[:, 2])
    error = np.abs(terms - truth)
    assert np.all(error < rim[:, None] * PEAK + 5 * spread[:, None])
    assert error.max() < 0.1
    # Its sky is half
    assert 1 - terms[:, 0] / (2 * np.sqrt(np.pi)) == pytest.approx(0.5, abs=0.012)


def test_a_ball_is_a_cap() -> None:
    rings, sectors = 96, 192
    mesh = small_meshes.sphere(rings, sectors)
    found = occlusion.trace(mesh, params=Params(grid=8, rays=1024, proof=0))
    points, terms, spread = outside(found)
    distance = np.linalg.norm(points, axis=1)
    every = np.linalg.norm(found.box.voxel_centres(8), axis=1)
    assert np.array_equal(found.inside.ravel(), every < 1)
    truth = turn_zonal(cap(np.arcsin(1 / distance), L_MAX), -points)
    # The polyhedron holds the inscribed ball
    inscribed = np.cos(np.pi / rings) * np.cos(np.pi / sectors)
    wide, narrow = (np.sqrt(1 - np.square(r / distance)) for r in (1.0, inscribed))
    require(terms, truth, spread, 2 * np.pi * (narrow - wide))


def torus(radius: float, tube: float, around: int, across: int) -> Mesh:
    """Make a closed torus about +y."""
    u = 2 * np.pi * np.arange(around)[:, None] / around
    v = 2 * np.pi * np.arange(across) / across
    wide = radius + tube * np.cos(v)
    grid = np.stack([wide * np.cos(u), tube * np.sin(v) + 0 * u, -wide * np.sin(u)], axis=-1)
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    down, right = (i + 1) % around, (j + 1) % across
    a, b, c, d = (
        (r * across + s).ravel() for r, s in ((i, j), (down, j), (down, right), (i, right))
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return small_meshes.mesh_of(grid.reshape(-1, 3), faces)


def test_a_ring_hides_a_band_from_its_axis() -> None:
    """From its axis a torus lies between two cones: tangents of its tube in the plane of both."""
    R, r, around, across = 1.0, 0.4, 192, 96
    mesh = torus(R, r, around, across)
    # An odd grid has voxels on the axis
    n = 13
    found = occlusion.trace(mesh, params=Params(grid=n, rays=1024, proof=0))
    column = n // 2 * n * n + np.arange(n) * n + n // 2
    points = found.box.voxel_centres(n)[column]
    np.testing.assert_allclose(points[:, [0, 2]], 0, atol=1e-12)
    height = points[:, 1]
    assert not found.inside.ravel()[column].any()
    reach = np.hypot(R, height)
    middle, half = np.arctan2(R, -height), np.arcsin(r / reach)
    zonal = cap(middle + half, L_MAX) - cap(middle - half, L_MAX)
    truth = turn_zonal(zonal, [0.0, 1.0, 0.0])
    # What is left of the sky: from the middle of the hole all but the sine of the band's half
    visible = 1 - truth[:, 0] / (2 * np.sqrt(np.pi))
    assert visible[n // 2] == pytest.approx(1 - r / R, abs=1e-12)
    # By so much chords shrink tube and ring, seen at a tangent's length, at two rims
    shrunk = (R + r) * (1 - np.cos(np.pi / around)) + r * (1 - np.cos(np.pi / across))
    solid = 2 * 2 * np.pi * shrunk / np.sqrt(reach**2 - r**2)
    terms, spread = found.terms.reshape(-1, K)[column], found.spread.ravel()[column]
    require(terms, truth, spread, solid)
    share = 1 - terms[:, 0] / (2 * np.sqrt(np.pi))
    error = np.abs(share - visible)
    assert np.all(error < solid / (4 * np.pi) + 5 * spread / (2 * np.sqrt(np.pi)))
