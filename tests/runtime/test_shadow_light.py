"""What is hidden of the light, summed once a voxel."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from formats.errors import InputError
from formats.occlusion import decode
from maths.occlusion_shadow import LOBES, receiver_lobe
from runtime import shadow_light
from tests.runtime.shadow_truth import ball_volume, bands_volume, small_box


@pytest.fixture
def player():
    """A card that keeps what is written to it."""

    class Texture(SimpleNamespace):
        def write(self, data):
            self.data = np.array(data)

    def make(limit=2048):
        def texture3d(size, components, **options):
            return Texture(size=size, components=components, data=None)

        ctx = SimpleNamespace(info={"GL_MAX_3D_TEXTURE_SIZE": limit}, texture3d=texture3d)
        return SimpleNamespace(ctx=ctx, targets=SimpleNamespace(adopt=lambda made, size: made))

    return make


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("make", [partial(ball_volume, grid=6), bands_volume])
def test_a_voxel_holds_the_sum_of_its_values(player, make, channels):
    asset = make(small_box())
    volumes = shadow_light.Volumes(player(), asset, "a", normals=False)
    weights = np.random.default_rng(0).normal(size=(2, channels, len(asset.scales)))
    volumes.write(weights)
    first = 0
    for number, grid in enumerate(asset.grids):
        last = first + 4 * len(grid)
        values = np.concatenate(list(decode(grid)), axis=-1).astype(np.float64)
        for end in range(2):
            texture = volumes.textures[2 * number + end]
            z, y, x = grid.shape[1:4]
            assert texture.size == (x, y, z)
            found = texture.data.reshape(z, y, x, 4)[..., :3]
            expected = np.broadcast_to(values @ weights[end, :, first:last].T, found.shape)
            # Sums of up to 48 numbers up to 3 in float32
            np.testing.assert_allclose(found, expected, atol=2e-5)
        first = last
    assert first == len(asset.scales)


def test_normals_along_axes_have_the_sum_of_their_harmonics(player):
    asset = ball_volume(small_box(), grid=4)
    volumes = shadow_light.Volumes(player(), asset, "a", normals=True)
    weights = np.random.default_rng(1).normal(size=(2, 3, LOBES, len(asset.scales)))
    volumes.write(weights)
    for texture in volumes.textures:
        slabs = texture.data[..., :3]
        for face, axis in enumerate([(1, 0, 0), (0, 1, 0), (0, 0, 1)]):
            for sign in (1.0, -1.0):
                normal = sign * np.array(axis)
                expected = np.tensordot(receiver_lobe(normal), slabs[:LOBES], 1)
                found = slabs[LOBES + face + (3 if sign < 0 else 0)]
                np.testing.assert_allclose(found, expected, atol=2e-5)


def test_a_machine_of_small_volumes_is_told_what_to_lower(player):
    asset = ball_volume(small_box(), grid=8)
    shadow_light.Volumes(player(8), asset, "a", normals=False)
    shadow_light.Volumes(player(8 * shadow_light.SLABS), asset, "a", normals=True)
    with pytest.raises(InputError, match="lower grid or size"):
        shadow_light.Volumes(player(8 * shadow_light.SLABS - 1), asset, "a", normals=True)
