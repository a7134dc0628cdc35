"""Studies of an occlusion volume's rays and knobs, and the bake beside its own Embree calls."""

import numpy as np
import pytest

from bake import occlusion
from pipelines.studies import meshes, occlusion_knob, occlusion_rays
from pipelines.studies import sampling_pattern as pattern
from pipelines.studies.answer import slope_of


def test_a_convex_mesh_hides_what_its_faces_are_seen_as() -> None:
    mesh = pattern.box()
    assert pattern.convex(mesh)
    assert pattern.convex(pattern.gem())
    assert not pattern.convex(meshes.knot(20, 6))
    found = pattern.voxels(mesh, 20, 0)
    exact = pattern.silhouettes(mesh, found)
    # 20,000 rays of a sequence: errors fall as rays^-.75, 1e-3 of the sphere
    close = pattern.everywhere(found, pattern.shifted, 20_000)
    assert np.abs(exact - close).max() < 8e-3
    assert exact[:, 0].min() > 0


@pytest.mark.parametrize("name", pattern.PATTERNS)
def test_patterns_are_even_over_the_sphere(name: str) -> None:
    keys = np.arange(50)
    made = np.broadcast_to(pattern.PATTERNS[name](keys, 512), (50, 512, 3))
    np.testing.assert_allclose(np.linalg.norm(made, axis=-1), 1, atol=1e-12)
    # The mean direction of 25,600 independent ones is within 4 / sqrt(3 * 25,600) on each axis,
    # those that all voxels share are far more even
    assert np.abs(made.mean(axis=(0, 1))).max() < 4 / np.sqrt(3 * 25_600)
    squares = np.einsum("vni,vnj->ij", made, made) / made[..., 0].size
    np.testing.assert_allclose(squares, np.eye(3) / 3, atol=0.01)


def test_slopes_of_patterns_are_those_of_theory() -> None:
    """Binary visibility: independent rays -1/2, structured ones at most -.70 (aim)."""
    found, counts = pattern.voxels(pattern.box(), 60, 0), [64, 256, 1024]
    truth = pattern.silhouettes(pattern.box(), found)
    for name, make in pattern.PATTERNS.items():
        errors = [
            np.sqrt(np.mean((pattern.everywhere(found, make, n) - truth) ** 2)) for n in counts
        ]
        slope = slope_of(list(zip(counts, errors, strict=True)))
        if name == pattern.RANDOM:
            # 60 voxels x 25 coefficients: the slope scatters by about .02
            assert slope == pytest.approx(-0.5, abs=0.06)
        else:
            assert slope < -0.66


def test_rays_for_an_error_lie_on_the_power_law() -> None:
    counts = [100, 200, 400]
    errors = [3.0 * n**-0.75 for n in counts]
    assert pattern.rays_for(3.0 * 1000**-0.75, counts, errors) == pytest.approx(1000)


def test_enough_is_where_every_subject_is_near_its_best() -> None:
    def row(subject: str, rays: int, error: float) -> dict[str, float | int | str]:
        return {"subject": subject, "encoding": "x", "rays": rays, "error": error}

    rows = [row("a", 64, 0.3), row("a", 256, 0.105), row("a", 1024, 0.1)]
    rows += [row("b", 64, 0.21), row("b", 256, 0.2), row("b", 1024, 0.2)]
    assert occlusion_knob.enough(rows, "rays", "x") == 256
    assert occlusion_knob.mean_error(rows, "rays", 1024, "x") == pytest.approx(0.15)


def test_overhead_counts_every_ray_of_the_bake() -> None:
    mesh = meshes.knot(60, 12)
    params = occlusion.Params(grid=8, rays=64, proof=4)
    found = occlusion_rays.overhead(mesh, params, repeats=1)
    # The volume's, the proof's 4 x 4096, and those that look for the inside, there and at 512
    # places under the surface: 7 pairs each, again after each of a few crossings
    least = occlusion.trace(mesh, params=params).quality["rays"] + 4 * 4096
    assert least < found["rays"] < least + 64 * (8**3 + 512)
    assert np.isfinite(found["ratio"])
    assert found["ratio"] > 0
