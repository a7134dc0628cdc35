"""The study of rays a voxel, and the bake beside its own Embree calls."""

import numpy as np
import pytest

from bake import occlusion
from pipelines.studies import occlusion_rays, subjects


def test_cones_beat_spheres() -> None:
    found = occlusion_rays.measure(subjects.Setting(quick=True))
    cones = [row for row in found.rows if row["way"] == "cones"]
    assert [row["way"] for row in found.rows[:6]] == ["fibonacci"] * 3 + ["random"] * 3
    # Measured on the full study: .25 and 1/100
    assert found.figures["of_fibonacci"] < 1 / 2
    assert found.figures["of_random"] < 1 / 10
    for row in cones:
        assert 0.6 < float(row["bar"]) / float(row["rms"]) < 1.8


def test_rays_for_an_error_lie_on_the_power_law() -> None:
    counts = [100, 200, 400]
    errors = [3.0 * n**-0.75 for n in counts]
    assert occlusion_rays._rays_for(3.0 * 1000**-0.75, counts, errors) == pytest.approx(1000)


def test_overhead_counts_every_ray_of_the_bake() -> None:
    mesh = subjects.knot(60, 12)
    params = occlusion.Params(grid=8, rays=64, proof=4)
    found = occlusion_rays.overhead(mesh, params, repeats=1)
    # The volume's, the proof's 4 x 4096, and those that look for the inside, there and at 512
    # places under the surface: 7 pairs each, again after each of a few crossings
    least = occlusion.trace(mesh, params=params).quality["rays"] + 4 * 4096
    assert least < found["rays"] < least + 64 * (8**3 + 512)
    assert np.isfinite(found["ratio"])
    assert found["ratio"] > 0
