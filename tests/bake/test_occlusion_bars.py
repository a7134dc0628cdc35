"""Error bars of shadow volumes: pooled neighbours, measured shares, and whether they hold."""

import numpy as np
import pytest

from bake import occlusion, occlusion_bars, occlusion_rays
from bake.rays import RayScene
from maths.spherical_lights import project_polygon
from tests.bake import small_meshes

TRIANGLE = np.array([[-1.0, -0.3, 0.0], [1.0, -0.2, 0.1], [0.2, 0.05, 0.3]])


def test_pooled_is_the_mean_over_neighbours_that_count(rng: np.random.Generator) -> None:
    n = 5
    voxels = np.sort(rng.permutation(n**3)[:70])
    values = rng.random(70)
    found = occlusion_bars.pooled(values, voxels, n)
    at = np.stack(np.unravel_index(voxels, (n, n, n)), axis=1)
    for place, mean in zip(at, found, strict=True):
        near = np.abs(at - place).max(axis=1) <= 1
        assert mean == pytest.approx(values[near].mean(), rel=1e-12)


def test_bands_count_by_their_coefficients() -> None:
    by_coefficient = np.arange(9.0)[:, None] ** 2
    bands = occlusion_rays.by_bands(by_coefficient).T
    np.testing.assert_allclose(bands, [[0, (1 + 4 + 9) / 3, (16 + 25 + 36 + 49 + 64) / 5]])
    assert occlusion_bars.over_bands(bands)[0] == pytest.approx(by_coefficient.mean())


def test_nothing_in_sight_has_no_error() -> None:
    # From its edges a plate has no size: no ray meets it, and nothing tells a share
    plate = small_meshes.plate(normal=(0, 0, 1))
    scene = RayScene(plate.vertices, plate.faces)
    points = np.array([[1.7, 0.2, 0.0], [0.3, -1.4, 0.0]])
    where = occlusion_rays.cones(points, plate.vertices.min(0), plate.vertices.max(0), 2**0.5)
    asked = scene, points.astype(np.float32), where, np.arange(2), 128
    found = occlusion_rays.project(*asked, 4)
    scale, _ = occlusion_bars.scales(*asked, found)
    assert np.all(scale == 1)
    assert np.all(occlusion_bars.variances(found, scale) == 0)


def test_the_share_is_that_of_a_sphere() -> None:
    scene = RayScene(*small_meshes.sphere_arrays(48, 96))
    rng = np.random.default_rng(1)
    points = small_meshes.directions(rng, 1500) * rng.uniform(1.2, 3, (1500, 1))
    where = occlusion_rays.cones(points, -np.ones(3), np.ones(3), 1.0)
    asked = scene, points.astype(np.float32), where, np.arange(1500), 256
    one, two = (occlusion_rays.project(*asked, 4, number=k) for k in (5, 6))
    scale, rays = occlusion_bars.scales(*asked, occlusion_rays.project(*asked, 4))
    # 64 voxels are traced again
    assert rays == pytest.approx(64 / 1500 * occlusion_rays.total_of(where, 256), rel=0.1)
    whole = np.mean(np.square(one.terms - two.terms)) / 2
    told = np.mean(occlusion_bars.over_bands(one.apart * scale))
    # Measured shares of the variance are .28 to .4, not 1; 64 voxels of 25 numbers, 9 of them
    # independent, say: a standard error of 6 %
    assert np.all((scale > 0.15) & (scale < 0.6))
    assert told == pytest.approx(whole, rel=0.25)


def test_intervals_of_a_thin_triangle_hold() -> None:
    """Most rays miss it; the old bars, a constant share of each voxel's own halves, held 77 %."""
    scene, faces = RayScene(TRIANGLE, [[0, 1, 2]]), np.array([[0, 1, 2]])
    box, _, _ = occlusion.box_of(TRIANGLE)
    params = occlusion.Params(grid=5, l_max=3, rays=64, proof=0)
    points = box.voxel_centres(5)
    truth = project_polygon(points, TRIANGLE, np.ones(3), 3, two_sided=True)[..., 0]
    rng, runs, draws, held = np.random.default_rng(4), 50, 8, 0
    for seed in range(runs):
        found = occlusion.around(scene, TRIANGLE, faces, params=params, seed=seed)
        off = np.abs(found.terms.reshape(-1, 16) - truth)
        inside = off <= found.quality["coverage_factor"] * found.spread.ravel()[:, None]
        held += int(inside[rng.permutation(125)[:draws], rng.integers(0, 16, draws)].sum())
    # 400 draws: a standard deviation of .011; the study counts 2,000 runs
    assert 0.95 - 4 * 0.011 < held / (runs * draws) < 0.95 + 4 * 0.011
