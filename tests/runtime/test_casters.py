"""Lights projected at the ends of casters, and how far their shadows reach."""

from types import SimpleNamespace

import numpy as np
import pytest

from formats.meshes import PlacedMesh, Shadow
from maths import spherical_lights as sl
from maths.occlusion_shadow import outside
from maths.spherical_rotation import rotate
from maths.transforms import rotation
from runtime import casters
from runtime.lighting import (
    Lights,
)
from tests.runtime.shadow_truth import ball_volume, looked_up, small_box

SQUARE = np.array([[-1.0, 3, -1], [-1, 3, 1], [1, 3, 1], [1, 3, -1]])
RED, BLUE = np.array([3.0, 1, 0.5]), np.array([0.2, 0.4, 2.0])


def lights(**more):
    given = {"suns": (), "spheres": (), "environments": (), "discs": (), "polygons": ()}
    return Lights(**{**given, **more})


def placed(**shadow):
    turn = {"position": [1.0, 2.0, -0.5], "rotation": [20.0, 50.0, -30.0], "scale": 1.5}
    mesh = PlacedMesh.__new__(PlacedMesh)
    values = {"name": "a", "shadow": Shadow(**{"rays": 64, **shadow}), "lighting": "direct"}
    matrix = np.eye(4)
    matrix[:3, :3] = rotation("z", 0.3) @ rotation("x", 1.1) * turn["scale"]
    matrix[:3, 3] = turn["position"]
    for name, value in {**values, "scale": 1.5, "world_from_mesh": lambda t: matrix}.items():
        object.__setattr__(mesh, name, value)
    return mesh


@pytest.fixture
def caster():
    def make(asset, **shadow):
        edge, share = casters._edge(asset)
        return casters.Caster(
            1, placed(**shadow), placed(**shadow).shadow, asset, None, edge, share
        )

    return make


@pytest.mark.parametrize("coloured", [True, False])
@pytest.mark.parametrize("depth", [8, 16])
def test_weights_make_of_stored_values_the_share_hidden(caster, coloured, depth):
    asset = ball_volume(small_box(), grid=6, l_max=3, depth=depth)
    made = caster(asset, coloured=coloured)
    light = np.random.default_rng(1).normal(size=(2, 25, 3))
    light[:, 0] = np.abs(light[:, 0]) + 3
    weights = made.weights(light, 0.0)
    stored = np.moveaxis(asset.volumes, 0, 3).reshape(6**3, -1)
    factor, offset = casters.decode(asset)
    texels = stored / 255.0 if depth == 8 else stored.astype(np.float64)
    found = np.einsum("vk,eck->evc", texels * factor + offset, weights)
    # By terms, in the mesh's own axes
    terms = asset.decoded().reshape(6**3, -1) @ asset.basis
    turn = made.placed.world_from_mesh(0.0)[:3, :3] / 1.5
    for end in range(2):
        L = rotate(light[end, :16], turn.T)
        L = L if coloured else L @ np.array([[0.2126], [0.7152], [0.0722]])
        expected = terms @ L / (2 * np.sqrt(np.pi) * L[0])
        # float32 of the decoded values
        np.testing.assert_allclose(found[end], expected, atol=2e-6)


def test_where_no_light_is_nothing_is_hidden(caster):
    made = caster(ball_volume(small_box(), grid=4))
    light = np.zeros((2, 9, 3))
    light[:, 0, 0] = 1.0
    weights = made.weights(light, 0.0)
    assert np.all(weights[:, 1:] == 0)
    assert np.any(weights[:, 0] != 0)


@pytest.mark.parametrize("coloured", [True, False])
def test_nothing_is_hidden_beyond_the_reach(caster, coloured):
    asset = ball_volume(small_box(), grid=8, l_max=3)
    made = caster(asset, coloured=coloured)
    rng, least, most = np.random.default_rng(2), 0.02, 0.0
    towards = np.array([0.3, 1.0, 0.2])
    light = np.stack([sl.project_sun(towards, RED, 3), sl.project_sun(-towards, BLUE, 3)])
    weights = made.weights(light, 0.0)
    reach = made.reach(weights, least)
    assert np.linalg.norm(made.extent) < reach < 100
    d = rng.normal(size=(4000, 3))
    x = d / np.linalg.norm(d, axis=1, keepdims=True) * reach * rng.uniform(1, 1.2, (4000, 1))
    p = x / made.extent
    stored = np.moveaxis(asset.decoded(), 3, 0)
    slots = np.zeros((*stored.shape[1:], weights.shape[-1]))
    slots[..., : len(stored)] = np.moveaxis(
        stored / asset.scales[: len(stored), None, None, None], 0, 3
    )
    values = looked_up(slots, 0.5 + 0.5 * p / outside(p)[:, None])
    from maths.occlusion_shadow import occlusion_falloff

    hidden = (
        np.einsum("vk,eck->vec", values, weights) * occlusion_falloff(p, made.extent)[:, None, None]
    )
    most = float(hidden.max())
    assert most <= least
    # Taken as far out as a corner the bound is loose, but not by ten
    assert most > 0.1 * least


def test_a_shadow_that_does_not_thin_has_no_end(caster):
    made = caster(ball_volume(small_box(), grid=4), falloff=False)
    weights = made.weights(sl.project_sun(np.eye(3)[:2], np.stack([RED, RED]), 2), 0.0)
    assert made.reach(weights, 1e-3) == np.inf
    assert made.reach(weights, 1e3) == pytest.approx(np.linalg.norm(made.extent))


def test_the_ends_lie_on_the_longest_axis_in_the_world(caster):
    made = caster(ball_volume(small_box(), grid=4))
    matrix = made.placed.world_from_mesh(0.0)
    ends = np.array([[0.1, -0.8, -0.2], [0.1, 0.8, -0.2]])
    np.testing.assert_allclose(made.ends(0.0), ends @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-12)
    p = made.ends(0.0) @ made.object_from_world(0.0)[:3, :3].T + made.object_from_world(0.0)[:3, 3]
    np.testing.assert_allclose(p, [[0, -0.5, 0], [0, 0.5, 0]], atol=1e-12)


def test_a_volume_too_large_for_the_card_is_told():
    from formats.errors import InputError

    ctx = SimpleNamespace(info={"GL_MAX_3D_TEXTURE_SIZE": 8})
    with pytest.raises(InputError, match="lower grid or components"):
        casters.texture(SimpleNamespace(ctx=ctx), ball_volume(small_box(), grid=4), "bust")
