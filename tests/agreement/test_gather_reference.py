"""Light gathered on the card against rays of Embree, and how fast its error falls."""

import numpy as np
import pytest

from bake import lightmap, voxel_faces
from tests.runtime.cube_worlds import apart, ceiling, makers, room

pytestmark = pytest.mark.gpu


@pytest.fixture
def gather(context):
    """Give a maker of gathers."""
    # Players of other tests have made contexts of their own current
    context.__enter__()
    yield from makers(context)
    # Nothing can be drawn without a framebuffer
    context.simple_framebuffer((1, 1)).use()
    assert context.error == "GL_NO_ERROR"


def test_all_ways_agree_with_embree(gather):
    """With bounces and a sky; `exact` and `sphere` in every storage find the same light."""
    voxels = room()
    faces = voxel_faces.layout(voxels.cells, texels=1)
    sky = np.full((8, 16, 3), 0.3, np.float32)
    sky[:4] = 0.2, 0.4, 0.8
    params = lightmap.Params(texels=1, rays=2048, target=0)
    truth = lightmap.gather(voxels, faces, params=params, environment=sky)
    used = faces.cell() >= 0
    own = apart(truth.irradiance + truth.error, truth.irradiance, used)
    ways = [("exact", "rgba8"), ("exact", "bc1"), ("exact", "bc1_array"), ("sphere", "rgba8")]
    for mode, storage in ways:
        found = gather(
            voxels, faces, mode=mode, storage=storage, environment=sky, error=0.013, seed=2
        )
        found.step(8192)
        assert found.converged
        difference = apart(found.read(), truth.irradiance, used)
        # Of it .009 is the truth's own error, and BC1 costs up to .004
        assert difference < 0.02
        # And the error that it tells is the right one, to two fifths
        told = np.hypot(found.error(), own)
        assert 0.6 * told < difference < 1.4 * told


def test_error_falls_faster_than_with_independent_rays(gather):
    voxels, faces, floor, expected = ceiling(1)
    counts, slopes = [64, 128, 256, 512, 1024], {}
    for spread in (True, False):
        errors = np.zeros(len(counts))
        for seed in range(3):
            found = gather(voxels, faces, bounces=0, error=0.0, seed=seed, spread=spread)
            for k, count in enumerate(counts):
                found.step(count - found.passes)
                errors[k] += apart(found.read()[floor], expected, np.s_[:]) ** 2
        slopes[spread] = np.polyfit(np.log(counts), np.log(errors) / 2, 1)[0]
    # Measured: -.77 and -.51
    assert slopes[True] < -0.6
    assert -0.56 < slopes[False] < -0.44
