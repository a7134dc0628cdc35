"""Clusters of lights: every light in one, chances that follow distance, samples that are fair."""

import numpy as np

from bake import reference_lights, reference_scene
from bake.reference_clusters import MOST, Clusters
from bake.reference_emission import EmitterSampler
from bake.reference_scene import Part
from bake.reference_world import World
from formats.files import glb
from formats.mesh import Material
from maths.area_lights import polygon_irradiance
from tests.bake import reference_scenes, small_meshes
from tests.bake.reference_scenes import scene_of


def test_lights_fall_into_clusters_that_keep_their_power(rng):
    places, power = rng.normal(size=(500, 3)), rng.random(500) + 0.1
    found = Clusters.around(places, np.full(500, 1e-4), power)
    assert len(found.power) == MOST == len(np.unique(found.of))
    for number in range(MOST):
        own = found.of == number
        centre = (power[own, None] * places[own]).sum(axis=0) / power[own].sum()
        assert np.isclose(found.power[number], power[own].sum(), rtol=1e-12)
        assert np.allclose(found.centre[number], centre, rtol=0, atol=1e-12)
        # All three axes were halved at least once
        assert np.ptp(places[own], axis=0).max() < np.ptp(places, axis=0).max() / 1.9
    same = Clusters.around(np.ones((5, 3)), np.ones(5), np.ones(5))
    assert same.power.tolist() == [5.0]


def test_a_near_lamp_is_chosen_over_a_far_panel_of_more_power():
    places = np.array([[0.0, 1.0, 0.0], [20.0, 0.0, 0.0]])
    found = Clusters.around(places, np.array([0.0625, 4.0]), np.array([1.0, 20.0]))
    points = np.array([[0.0, 0.0, 0.0], [18.0, 0.0, 0.0]])
    weight = np.array([[1 / (1 + 0.0625), 20 / (400 + 4)], [1 / (325 + 0.0625), 20 / (4 + 4)]])
    for point, weights in zip(points, weight / weight.sum(axis=1, keepdims=True), strict=True):
        many = np.tile(point, (2, 1))
        # A dozen roundings of numbers up to 400 beside 1
        assert np.allclose(found.chance(many, found.of), weights, rtol=1e-12)
        u = np.linspace(0, 1, 1001)[:-1]
        cluster, chance, within = found.choose(np.tile(point, (1000, 1)), u)
        assert np.allclose(chance, weights[np.argsort(found.of)][cluster], rtol=1e-12)
        # Numbers go on as evenly as they came
        start = np.where(cluster == 0, 0, chance[0])
        assert cluster[0] == 0
        assert cluster[-1] == 1
        assert np.allclose(start + within * chance, u, rtol=0, atol=1e-12)


def plates(folder):
    """Four plates that look down from a height, of radiance 1, 2, 3, 4, and what lights ground."""
    meshes, corners = [], []
    for i, (x, y, half) in enumerate([(-0.6, 0.5, 0.1), (0.5, 1.0, 0.3), (0, 2, 0.2), (6, 3, 2)]):
        plate = small_meshes.plate(normal=(0, -1, 0), centre=(x, y, 0.1 * i), half=half)
        glow = glb.Material(base_color=(0.0, 0.0, 0.0, 1.0), emissive=(i + 1.0,) * 3)
        source = reference_scenes.write_mesh(folder, f"plate{i}", plate, glow)
        meshes.append({"name": f"plate{i}", "source": source})
        corners.append(plate.vertices)
    scene = scene_of(folder, meshes=meshes)
    parts, _ = reference_scene.parts_of(scene, 0.0, 0.0, np.zeros(3))
    return scene, World(reference_scene.merged(parts), None), corners


def test_samples_of_several_emitters_add_up_to_the_light_of_all(tmp_path, rng):
    _, world, corners = plates(tmp_path)
    sampler = EmitterSampler(world)
    assert len(np.unique(sampler.clusters.of)) > 4
    up = np.array([0.0, 1.0, 0.0])
    for point in ([0.0, 0.0, 0.0], [-0.6, 0.3, 0.05], [5.0, 1.0, 1.0]):
        n = 20000
        points = np.tile(point, (n, 1))
        drawn = sampler.sample(points, rng.random((n, 3)))
        found = drawn.weight[:, 0] * np.maximum(drawn.direction @ up, 0)
        lights = [polygon_irradiance(point, up, c, i + 1.0) for i, c in enumerate(corners)]
        assert abs(found.mean() - sum(lights)) < 4 * found.std() / np.sqrt(n)
        assert found.std() / np.sqrt(n) < 0.02 * sum(lights)
        # What weighs a sample against a path that meets the light is the same number
        face, way = drawn.face.astype(np.int32), drawn.direction
        again = sampler.density(points, face, way, drawn.distance)
        assert np.allclose(again, drawn.density, rtol=1e-9)


def test_glowing_faces_too_small_for_an_area_are_no_light(tmp_path):
    glow = Material(emissive=(1.0, 1.0, 1.0))
    # Corners of the small one are one point as float32 has them
    near = [[1e-9, 0, 0], [0, 1e-9, 0]]
    speck = small_meshes.mesh_of([[5, 5, 5], *np.add(near, 5)], [[0, 1, 2]], glow)
    parts = [Part(mesh, np.eye(4)[None], np.ones((1, 3))) for mesh in (speck, small_meshes.box())]
    world = World(reference_scene.merged(parts), None)
    assert world.glowing
    assert reference_lights.at(scene_of(tmp_path), 0.0, world).emitters is None
