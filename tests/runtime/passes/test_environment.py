"""Environment maps: the light of sprites and ground, and nothing drawn."""

from __future__ import annotations

import numpy as np
import pytest

from maths import circular_lights, sprite_packing
from runtime.player import Player

pytestmark = pytest.mark.gpu
HALF = 2.0**-11


def test_a_sprite_under_a_map_is_the_sum_over_its_texels(kit, write_scene, ctx, rng):
    asset = kit.sphere_asset(size=64)
    radiance = rng.uniform(0, 1, (16, 32, 3)).astype(np.float16).astype(np.float32)
    lights = [{"type": "environment", "source": "environments/e.hdr", "scale": 0.5, "rotate": 40.0}]
    raw = kit.texel_to_pixel(asset, lights=lights)
    folder = write_scene(raw, {"ball": asset}, environment=radiance)
    with Player(folder, size=(64, 64), context=ctx) as player:
        found = player.linear(0.0)[..., :3]
        assert player.profile["draw_calls"] == 1
    # Slow truth: every texel is a small light of its own
    v, u = (np.mgrid[0:16, 0:32] + 0.5) / np.array([16, 32])[:, None, None]
    azimuth = 2 * np.pi * (u - 0.5) - np.radians(40.0)
    edges = np.cos(np.pi * np.arange(17) / 16)
    solid = (edges[:-1] - edges[1:])[:, None] * 2 * np.pi / 32
    ring_sine = np.sin(np.pi * v)
    directions = np.stack(
        [ring_sine * np.sin(azimuth), np.cos(np.pi * v), -ring_sine * np.cos(azimuth)], axis=-1
    )
    basis = circular_lights.evaluate_direction(
        directions, 5, axis="view", elevation=asset.ring.elevation, one_sided=True
    )
    L = np.einsum("vuk,vuc->kc", basis, 0.5 * radiance * solid[..., None])
    planes = sprite_packing.decode(asset.levels[0], asset.scales).astype(float)
    Y = sprite_packing.unpack(planes, 5, "twelve", "chroma")
    expected = np.maximum(np.einsum("khwc,kc->hwc", Y, L), 0)
    np.testing.assert_allclose(found, expected, rtol=3 * HALF, atol=expected.max() / 255 / 8)
