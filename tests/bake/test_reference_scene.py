"""Where the reference puts meshes and sprites, what it leaves out, and what it refuses."""

import numpy as np
import pytest

from bake import reference_camera, reference_scene
from bake.reference import Params, render
from bake.reference_world import World
from formats.errors import InputError
from formats.scene import Ground
from maths import transforms
from tests.bake import reference_scenes, small_meshes
from tests.bake.reference_scenes import scene_of

ASIDE = {"position": [4.0, 1.0, 3.0], "target": [0.0, 0.5, 0.0]}


@pytest.fixture
def flag(tmp_path):
    """A block 2 m high that stands a little off its origin, to the right and in front."""
    mesh = small_meshes.box(half=(0.5, 1.0, 0.25), centre=(0.25, 3.0, 0.125))
    return reference_scenes.write_mesh(tmp_path, "flag", mesh)


def test_a_mesh_stands_where_its_matrix_puts_it(tmp_path, flag):
    placed = {"name": "flag", "source": flag, "position": [1, 2, 3], "rotation": [0, 90, 0]}
    scene = scene_of(tmp_path, meshes=[placed | {"scale": 2.0}])
    parts, notes = reference_scene.parts_of(scene, 0.0, 0.3, np.zeros(3))
    mesh = reference_scene.merged(parts).mesh
    # About +y, +z turns to +x: (x, y, z) becomes (z, y, -x)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert np.allclose(low, [1 - 0.25, 2 + 4.0, 3 - 1.5], atol=1e-6)
    assert np.allclose(high, [1 + 0.75, 2 + 8.0, 3 + 0.5], atol=1e-6)
    assert notes == []


@pytest.mark.parametrize("flip", [False, True])
def test_a_sprite_is_its_mesh_turned_to_the_camera(tmp_path, flag, flip):
    group = {"name": "flags", "source": flag, "height": 1.0, "positions": [[1.0, 0.5, -2.0]]}
    scene = scene_of(tmp_path, ASIDE, billboards=[group | {"flip": [flip], "scale": [3.0]}])
    camera = reference_camera.at(scene, 0.0, (8, 8))
    parts, _ = reference_scene.parts_of(scene, 0.0, camera.yaw, camera.position)
    mesh = reference_scene.merged(parts).mesh
    offset = mesh.vertices - [1.0, 0.5, -2.0]
    back = np.cross(camera.right, [0.0, 1.0, 0.0])
    right, up, near = offset @ camera.right, offset[:, 1], offset @ back
    # Three metres high for two of the mesh, which stands on its own origin and is mirrored in x
    spans = [(-0.375, 1.125), (0.0, 3.0), (-0.1875, 0.5625)]
    spans[0] = (-1.125, 0.375) if flip else spans[0]
    for values, (low, high) in zip((right, up, near), spans, strict=True):
        assert abs(values.min() - low) < 1e-6
        assert abs(values.max() - high) < 1e-6
    corners = mesh.vertices[mesh.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Mirrored or not, faces are wound as their normals look
    assert np.all(np.einsum("ij,ij->i", outward, mesh.normals[:, 0]) > 0)
    middle = corners.mean(axis=1) - mesh.vertices.mean(axis=0)
    assert np.all(np.einsum("ij,ij->i", outward, middle) > 0)


def test_a_sprite_of_several_views_shows_the_nearest(tmp_path, flag):
    group = {"name": "flags", "source": flag, "height": 2.0, "positions": [[0, 0, 0]]}
    scene = scene_of(tmp_path, ASIDE, billboards=[group | {"views": 4, "yaw": [30.0]}])
    camera = reference_camera.at(scene, 0.0, (8, 8))
    parts, _ = reference_scene.parts_of(scene, 0.0, camera.yaw, camera.position)
    # Seen from azimuth atan2(4, 3) = 53 degrees less 30: view 0. From 90 on the other side: view 1
    turn = transforms.rotation("y", camera.yaw)
    assert np.allclose(parts[0].world_from_mesh[0, :3, :3], turn, atol=1e-6)
    parts, _ = reference_scene.parts_of(scene, 0.0, camera.yaw, np.array([5.0, 1.0, -2.0]))
    turn = turn @ transforms.rotation("y", -np.pi / 2)
    assert np.allclose(parts[0].world_from_mesh[0, :3, :3], turn, atol=1e-6)


def test_too_many_triangles_are_refused(tmp_path, flag, monkeypatch):
    monkeypatch.setattr(reference_scene, "MAX_TRIANGLES", 23)
    group = {"name": "flags", "source": flag, "height": 1.0, "positions": [[0, 0, 0], [1, 0, 0]]}
    scene = scene_of(tmp_path, billboards=[group])
    with pytest.raises(InputError, match="triangles: 24 -- the reference traces at most 23"):
        render(scene, params=Params(width=4, height=4, samples=2))


def test_photographs_are_left_out_with_a_note(tmp_path, flag, monkeypatch):
    group = {"name": "flags", "source": flag, "height": 1.0, "positions": [[0, 0, 0]]}
    scene = scene_of(tmp_path, billboards=[group])
    monkeypatch.setattr(type(scene.billboards[0]), "photographed", property(lambda self: True))
    found = render(scene, params=Params(width=4, height=4, samples=2))
    assert found.notes == ("flags: left out, photographs have no mesh to trace",)
    assert not found.coverage.any()


def test_the_ground_hides_what_is_under_it_and_blocks_from_both_sides(flag, tmp_path):
    scene = scene_of(tmp_path, meshes=[{"name": "flag", "source": flag, "position": [0, -2.5, 0]}])
    merged = reference_scene.merged(reference_scene.parts_of(scene, 0.0, 0.0, np.zeros(3))[0])
    world = World(merged, Ground(height=0.5))
    down = np.array([[0.0, -1.0, 0.0]])
    # The block reaches up to 1.5: what is beside it falls on the ground
    ends = world.cast(np.array([[0.2, 4.0, 0.1], [3.0, 4.0, 0.0]]), down.repeat(2, axis=0))
    assert np.allclose(ends.distance, [2.5, 3.5], atol=1e-5)
    assert ends.ground.tolist() == [False, True]
    start = np.array([[3.0, 0.0, 0.0], [3.0, 1.0, 0.0], [3.0, 1.0, 0.0]])
    towards = np.array([[0, 1.0, 0], [0, -1.0, 0], [0, 1.0, 0]])
    assert world.blocked(start, towards).tolist() == [True, True, False]
    near = world.blocked(start, towards, np.array([0.4, 0.6, 9.0]))
    assert near.tolist() == [False, True, False]


def test_a_scene_of_nothing_is_black(tmp_path):
    found = render(scene_of(tmp_path), params=Params(width=4, height=4, samples=2))
    assert not found.radiance.any()
    assert np.all(np.isinf(found.distance))


def test_pictures_and_particles_are_left_out_with_a_note(tmp_path, flag, monkeypatch):
    group = {"name": "dots", "source": flag, "height": 1.0, "positions": [[0, 0, 0]]}
    emitter = {"rate": 1, "lifetime": [1, 2], "centre": [0, 0, 0]}
    embers = {"name": "embers", "emitter": emitter, "look": {"radius": 0.1}}
    scene = scene_of(tmp_path, billboards=[group], particles=[embers])
    monkeypatch.setattr(type(scene.billboards[0]), "pictured", property(lambda self: True))
    found = render(scene, params=Params(width=4, height=4, samples=2))
    assert found.notes == (
        "dots: left out, a picture has no mesh to trace",
        "embers: left out, particles are not traced",
    )
