"""What a gather does when lamps, cells and skies change."""

from dataclasses import replace

import numpy as np
import pytest

from bake import voxel_faces
from formats.voxels import Voxels
from tests.runtime.cube_worlds import Glow, apart, box, inside, lamp, makers, palette, room

pytestmark = pytest.mark.gpu


@pytest.fixture
def gather(ctx):
    """Give a maker of gathers."""
    yield from makers(ctx)


@pytest.mark.parametrize("bounces", [-1, 3])
def test_light_follows_a_lamp(gather, bounces):
    """The bias, of the mean of eight seeds, halves every 8 passes, and no ghost is left."""
    voxels = room()
    voxels = replace(voxels, emission=np.zeros_like(voxels.emission))
    faces = voxel_faces.layout(voxels.cells, texels=1)
    used, marks = faces.cell() >= 0, (0, 8, 16, 24, 64)
    means = np.zeros((len(marks), *used.shape, 3))
    for seed in range(8):
        found = gather(voxels, faces, brightest=10.0, error=0.05, seed=seed, bounces=bounces)
        found.update(glows=lamp(6, 5, 6))
        found.step(128)
        assert found.update(glows=lamp(2, 2, 2))
        assert found.update(glows=lamp(2, 2, 2)) == []
        for k, mark in enumerate(marks):
            found.step(mark - found.since)
            means[k] += found.read() / 8
    truth = gather(voxels, faces, brightest=10.0, error=0.01, bounces=bounces)
    truth.update(glows=lamp(2, 2, 2))
    truth.step(8192)
    light = truth.read()
    bias = [abs(mean[used].mean() / light[used].mean() - 1) for mean in means]
    error = [apart(mean, light, used) for mean in means]
    # Both lamps light other things: texels differ by more than their mean
    assert error[0] > 0.9
    # Noise of eight seeds: .05 at 24 passes, .03 at 64
    for k in (1, 2, 3):
        assert error[k] < error[k - 1] / 2 + 0.05
    assert error[4] < 0.06
    assert bias[4] < 0.02


def test_only_what_is_near_begins_anew(gather):
    cells = np.zeros((6, 3, 40), np.uint16)
    cells[:, 0] = 1
    cells[2, 1, 2] = 2
    voxels = Voxels(cells, *palette((0.5, 0.0), (0.0, 10.0)))
    faces = voxel_faces.layout(cells, texels=1)
    found = gather(voxels, faces, brightest=10.0, error=0.05)
    found.step(64)
    dim = [Glow(np.array([[36, 1, 3]]), np.ones(1), np.full(3, 0.02))]
    assert len(found.update(glows=dim)) == 1
    found.step(2)
    passes = found.targets.read_sums()[2]
    away = np.linalg.norm(np.nan_to_num(faces.positions(), nan=-99) - [36.5, 1.5, 3.5], axis=-1)
    # A change of .25 x .05 of the mean irradiance: pi .02 .75 / d^2 is that at 2 to 4 cells
    assert passes[away < 2].max() == 2
    assert passes[(away > 15) & (away < 50)].min() == 66


def test_covered_texels_are_dark_and_show_their_neighbours(gather, ctx):
    cells = np.zeros((6, 5, 6), np.uint16)
    cells[:, 0] = 1
    cells[:, 4, 3] = 3
    moved = cells.copy()
    moved[2:4, 1, 2:4] = 2
    voxels = Voxels(cells, *palette((0.5, 0.0), (0.9, 0.0), (0.0, 4.0)))
    faces = voxel_faces.layout([cells, moved], texels=2)
    found = gather(voxels, faces, error=0.05)
    found.step(64)
    changes = found.update(cells=moved, boxes=[((2, 1, 2), (4, 2, 4))])
    assert [(c.low, c.high) for c in changes] == [((2, 1, 2), (4, 2, 4))]
    found.step(64)
    w, h = faces.size
    raw = np.frombuffer(found.lightmap().read(), np.float16).reshape(h, w, 4)
    at = np.nan_to_num(faces.positions(), nan=-1)
    floor = (faces.normals()[..., 1] > 0) & (np.abs(at[..., 1] - 1) < 1e-3)
    under = floor & np.all((at[..., [0, 2]] > 2) & (at[..., [0, 2]] < 4), axis=-1)
    assert under.sum() == 16
    assert raw[under, 3].max() == 0
    # Those at the rim have the light beside them, the four in the middle none
    assert np.count_nonzero(raw[under, 0] > 0) == 12
    top = (faces.normals()[..., 1] > 0) & (np.abs(at[..., 1] - 2) < 1e-3)
    assert raw[top, 3].min() == 1
    assert raw[top, 0].min() > 0
    # Gutters show what the layout says
    source = faces.source()
    used = source[..., 0] >= 0
    np.testing.assert_array_equal(raw[used], raw[source[used][:, 1], source[used][:, 0]])


def test_another_sky(gather):
    """A sky may come, change, and change its size."""
    voxels = box(4, 0.5, 0.0)
    faces = voxel_faces.layout(voxels.cells, texels=1)
    found = gather(voxels, faces, error=0.02)
    outside = (faces.cell() >= 0) & ~inside(faces, 4)
    for radiance, width in ((1.0, 8), (3.0, 8), (2.0, 16)):
        found.set_environment(np.full((4, width, 3), radiance, np.float32))
        found.step(64)
        # What was shown before is gone to 2^-16
        np.testing.assert_allclose(found.read()[outside], np.pi * radiance, rtol=1e-4)
