"""Rays into cones: what they must hold, and the closed forms of caps and half-spaces."""

import numpy as np
import pytest
from scipy.stats import linregress

from bake import occlusion_bars, workers
from bake import occlusion_rays as rays
from bake.rays import RayScene
from maths import spherical_harmonics
from tests.bake import small_meshes

RNG = np.random.default_rng


def cap_terms(axis: np.ndarray, half_angle: np.ndarray, l_max: int) -> np.ndarray:
    """Coefficients (v, K) of caps about axes (v, 3): z_l = sqrt(pi / (2l+1)) (P(l-1) - P(l+1))."""
    cosine, found = np.cos(half_angle), []
    Y = spherical_harmonics.evaluate(axis, l_max)
    for band in range(l_max + 1):
        one = np.eye(l_max + 3)
        below = 1.0 if band == 0 else np.polynomial.legendre.legval(cosine, one[band - 1])
        z = np.sqrt(np.pi / (2 * band + 1)) * (
            below - np.polynomial.legendre.legval(cosine, one[band + 1])
        )
        scale = np.sqrt(4 * np.pi / (2 * band + 1)) * z
        found.append(scale[:, None] * Y[:, band**2 : (band + 1) ** 2])
    return np.concatenate(found, axis=1)


def sphere_scene() -> RayScene:
    return RayScene(*small_meshes.sphere_arrays(96, 192))


def around(rng: np.random.Generator, count: int) -> np.ndarray:
    """Points between 1.2 and 3 radii from the middle of the unit sphere."""
    return small_meshes.directions(rng, count) * rng.uniform(1.2, 3, (count, 1))


def estimate(scene: RayScene, points: np.ndarray, count: int, l_max: int = 4) -> rays.Estimate:
    where = rays.cones(points, -np.ones(3), np.ones(3), 1.0)
    return rays.project(
        scene, points.astype(np.float32), where, np.arange(len(points)), count, l_max
    )


def test_cones_hold_every_vertex() -> None:
    rng = RNG(1)
    vertices = rng.uniform(-1, 1, (200, 3)) * [1.0, 0.3, 0.1]
    low, high = vertices.min(0), vertices.max(0)
    radius = float(np.linalg.norm(vertices - (low + high) / 2, axis=1).max())
    points = rng.uniform(-2, 2, (4000, 3)) * [1.0, 0.5, 0.5]
    found = rays.cones(points, low, high, radius)
    to = vertices[None] - points[:, None]
    to /= np.linalg.norm(to, axis=2, keepdims=True)
    widest = np.arccos(np.clip(np.einsum("vni,vi->vn", to, found.axis), -1, 1)).max(axis=1)
    assert np.all(widest <= found.angle + 1e-9)
    # A class is at most one step wider than its cone, both sharing the margin
    own = np.sin(np.minimum(found.angle + rays.MARGIN, np.pi) / 2) ** 2
    assert np.all((found.share >= own * (1 - 1e-12)) & (found.share <= own * rays.STEP * 1.0001))
    # Turned patterns still hold the cone: the spin's axis strays by less than the slack
    euler = rays.angles(found, np.arange(len(points)), 1)
    axis = rays.frames_of(euler)[:, :, 2]
    wide = found.share < 1
    stray = np.arccos(np.clip(np.einsum("vi,vi->v", axis, found.axis), -1, 1))[wide]
    assert np.all(stray + found.angle[wide] <= 2 * np.arcsin(np.sqrt(found.share[wide])) + 1e-7)


def test_turned_is_the_function_of_turned_directions() -> None:
    rng = RNG(2)
    euler = rng.uniform(-3, 3, (50, 3))
    directions = small_meshes.directions(rng, 50)
    for l_max in (0, 1, 4):
        before = spherical_harmonics.evaluate(directions, l_max)
        moved = np.einsum("vij,vj->vi", rays.frames_of(euler), directions)
        after = rays.turned(before.T.astype(np.float32), euler, l_max).T
        # A handful of float32 products of values up to .9
        np.testing.assert_allclose(after, spherical_harmonics.evaluate(moved, l_max), atol=2e-6)


def test_frames_are_rotations() -> None:
    R = rays.frames_of(RNG(3).uniform(-9, 9, (20, 3)))
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=1e-14)


def test_a_spiral_fills_its_cap_evenly() -> None:
    for share in (1.0, 0.5, 0.02):
        points = rays.spiral(share, 1000)
        assert points[:, 2].min() > 1 - 2 * share
        # The mean of z over a cap is 1 - share; the strips are midpoints, exact for a linear z
        assert points[:, 2].mean() == pytest.approx(1 - share, abs=1e-12)
        for half in (points[:500], points[500:]):
            # Strips of a half are shifted by half of one: 2 share / 1000
            assert half[:, 2].mean() == pytest.approx(1 - share, abs=2.001 * share / 1000)


def test_sphere_is_a_cap_everywhere() -> None:
    points = around(RNG(4), 600)
    distance = np.linalg.norm(points, axis=1)
    truth = cap_terms(-points / distance[:, None], np.arcsin(1 / distance), 4)
    found = estimate(sphere_scene(), points, 4096)
    error = found.terms - truth
    # Halves differ by more than the whole errs, where rays are spread along an outline; measured
    # .53 to .65
    ratio = np.sqrt(np.mean(error**2) / np.mean(occlusion_bars.over_bands(found.apart)))
    assert 0.45 < ratio < 0.75
    # No coefficient is off on the whole: 600 independent voxels, 4 standard errors, and the chords
    bias = np.abs(error.mean(axis=0))
    assert np.all(bias < 4 * error.std(axis=0) / np.sqrt(len(points)) + 0.0006)


def test_half_space_under_a_wide_plate() -> None:
    plate = small_meshes.plate(normal=(0, 1, 0))
    scene = RayScene(plate.vertices, plate.faces)
    points = np.array([[0.1, 1e-4, 0.05], [-0.2, 1e-4, 0.1]])
    where = rays.cones(points, plate.vertices.min(0), plate.vertices.max(0), 2**0.5)
    # The cone never opens beyond the half-space by more than a class
    np.testing.assert_allclose(where.share, 0.5 * rays.STEP, atol=0.01)
    found = rays.project(scene, points.astype(np.float32), where, np.arange(2), 8192, 4)
    truth = cap_terms(np.array([[0.0, -1, 0]] * 2), np.full(2, np.pi / 2), 4)
    assert truth[0, 0] == pytest.approx(np.sqrt(np.pi))
    assert truth[0, 1] == pytest.approx(-np.sqrt(3 * np.pi) / 2)
    # The plate ends 1e-4 above the horizon; 6e-4 is one ray of a whole sphere of 8,192, measured
    # errors are up to .0018
    np.testing.assert_allclose(found.terms, truth, atol=0.004)


def test_what_cannot_be_hit_is_exactly_zero() -> None:
    plate = small_meshes.plate(normal=(0, 0, 1))
    scene = RayScene(plate.vertices, plate.faces)
    # A plate from its edge has no size
    points = np.array([[1.7, 0.2, 0.0], [0.3, -1.4, 0.0]])
    where = rays.cones(points, plate.vertices.min(0), plate.vertices.max(0), 2**0.5)
    found = rays.project(scene, points.astype(np.float32), where, np.arange(2), 512, 4)
    assert np.all(found.terms == 0)
    assert np.all(found.apart == 0)


def test_error_falls_faster_than_random_rays() -> None:
    points = around(RNG(5), 300)
    distance = np.linalg.norm(points, axis=1)
    truth = cap_terms(-points / distance[:, None], np.arcsin(1 / distance), 3)
    counts = [128, 256, 512, 1024, 2048]
    scene = sphere_scene()
    errors = [np.sqrt(np.mean((estimate(scene, points, n, 3).terms - truth) ** 2)) for n in counts]
    slope = linregress(np.log(counts), np.log(errors)).slope
    # Random rays: -.5. Evenly spread over a shape with an edge: -.75
    assert -1.0 < slope < -0.65


def test_neighbours_do_not_share_their_error() -> None:
    at = np.linspace(-0.3, 0.3, 12)
    x, y = np.meshgrid(at, at, indexing="ij")
    points = np.stack([x, y, np.full_like(x, 1.8)], axis=-1).reshape(-1, 3)
    distance = np.linalg.norm(points, axis=1)
    truth = cap_terms(-points / distance[:, None], np.arcsin(1 / distance), 4)
    error = (estimate(sphere_scene(), points, 512).terms - truth).reshape(12, 12, 25)
    error -= error.mean(axis=(0, 1))
    left, right = error[:, :-1].reshape(-1, 25), error[:, 1:].reshape(-1, 25)
    r = np.sum(left * right) / np.sqrt(np.sum(left**2) * np.sum(right**2))
    # 132 pairs of 25 numbers, say 9 of them independent: a standard error of .03
    assert abs(r) < 0.1


def test_any_number_of_threads_gives_the_same_bytes() -> None:
    points, before = around(RNG(6), 400), workers.count()
    scene = sphere_scene()
    try:
        found = []
        for threads in (1, 2, 4):
            workers.use(threads)
            found.append(estimate(scene, points, 256))
    finally:
        workers.use(before)
    for other in found[1:]:
        assert np.array_equal(other.terms, found[0].terms)
        assert np.array_equal(other.apart, found[0].apart)
