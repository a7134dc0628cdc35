"""Lights projected at the ends of casters, and how far their shadows reach."""

import numpy as np
import pytest

from formats.meshes import PlacedMesh, Shadow
from formats.occlusion import decode
from maths import spherical_lights as sl
from maths.occlusion_shadow import receiver_lobe
from maths.spherical_rotation import rotate
from maths.transforms import rotation
from runtime import casters
from runtime.lighting import (
    Lights,
)
from tests.runtime.shadow_truth import ball_volume, bands_volume, received, slots_at, small_box

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
    found = np.einsum("vk,eck->evc", decode(stored).astype(np.float64), weights)
    # By terms, in the mesh's own axes
    terms = asset.decoded().reshape(6**3, -1) @ asset.basis
    turn = made.placed.world_from_mesh(0.0)[:3, :3] / 1.5
    for end in range(2):
        L = rotate(light[end, :16], turn.T)
        L = L if coloured else L @ np.array([[0.2126], [0.7152], [0.0722]])
        expected = terms @ L / (2 * np.sqrt(np.pi) * L[0])
        # float32 of the decoded values
        np.testing.assert_allclose(found[end], expected, atol=2e-6)


@pytest.mark.parametrize("coloured", [True, False])
def test_weights_of_a_receiver_make_of_stored_values_what_its_normal_loses(caster, coloured):
    asset = ball_volume(small_box(), grid=4, l_max=3)
    made = caster(asset, coloured=coloured, receiver_normal=True)
    rng = np.random.default_rng(4)
    light = rng.normal(size=(2, 49, 3))
    light[:, 0] = np.abs(light[:, 0]) + 3
    n = rng.normal(size=(7, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    assert made.l_max == 5
    weights, faced = made.receiver_weights(light, 0.0)
    slots = np.moveaxis(decode(asset.volumes), 0, 3).reshape(4**3, -1)
    hidden = np.einsum("vk,ecjk,nj->evnc", slots, weights, receiver_lobe(n))
    facing = np.einsum("ejc,nj->enc", faced, receiver_lobe(n))
    terms = asset.decoded().reshape(4**3, -1) @ asset.basis
    turn = made.placed.world_from_mesh(0.0)[:3, :3] / 1.5
    for end in range(2):
        L = rotate(light[end, :36], turn.T)
        L = L if coloured else L @ np.array([[0.2126], [0.7152], [0.0722]])
        for voxel in range(0, 64, 9):
            stored = np.repeat(terms[voxel][None], 7, axis=0)
            lost, whole = received(stored, L, n @ turn)
            # float32 of the decoded values
            np.testing.assert_allclose(hidden[end, voxel], lost, atol=3e-6)
            np.testing.assert_allclose(facing[end], whole, atol=1e-12)
    # Without a normal it is the share of all light
    np.testing.assert_allclose(
        weights[:, :, 0], made.weights(light, 0.0) / 4 * np.sqrt(4 * np.pi), rtol=1e-10, atol=1e-12
    )


def test_where_no_light_is_nothing_is_hidden(caster):
    made = caster(ball_volume(small_box(), grid=4))
    light = np.zeros((2, 9, 3))
    light[:, 0, 0] = 1.0
    weights = made.weights(light, 0.0)
    assert np.all(weights[:, 1:] == 0)
    assert np.any(weights[:, 0] != 0)


@pytest.mark.parametrize("coloured", [True, False])
@pytest.mark.parametrize("grids", [1, 2])
def test_nothing_is_hidden_beyond_the_reach(caster, coloured, grids):
    asset = ball_volume(small_box(), grid=8, l_max=3)
    if grids == 2:
        asset = bands_volume(small_box(), l_max=3)
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
    values = slots_at(asset, p)
    from maths.occlusion_shadow import occlusion_falloff

    hidden = (
        np.einsum("vk,eck->vec", values, weights) * occlusion_falloff(p, made.extent)[:, None, None]
    )
    most = float(hidden.max())
    assert most <= least
    # Taken as far out as a corner the bound is loose, but not by ten
    assert most > 0.1 * least


def test_the_edge_bounds_every_lookup_there():
    """Whatever weighs the values: between the middles of both grids they are linear."""
    asset = bands_volume(small_box(), l_max=3)
    edge, _ = casters._edge(asset)
    rng = np.random.default_rng(6)
    p = rng.uniform(-1, 1, (4000, 3))
    p /= np.abs(p).max(axis=1, keepdims=True)
    weights = rng.normal(size=(edge.shape[1], 50))
    found, bound = slots_at(asset, p) @ weights, edge @ weights
    # float32 lookups of sixteen values up to one
    assert np.all(found.max(axis=0) <= bound.max(axis=0) + 2e-5)
    assert np.all(found.max(axis=0) > bound.max(axis=0) * 0.8)


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
