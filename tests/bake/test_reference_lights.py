"""Environments, glowing meshes and thin sheets of the reference against sums over directions."""

from dataclasses import replace

import numpy as np
import pytest

from bake import reference_air, reference_lights, reference_scene
from bake.reference import Params, render
from bake.reference_camera import at as camera_at
from bake.reference_emission import EnvironmentSampler
from bake.reference_paths import Tracer
from bake.reference_polygons import solid_angle, spherical_triangle
from bake.reference_world import World
from formats.files import exr, glb
from formats.mesh import Material
from maths import area_lights, transforms
from tests.bake import reference_scenes, small_meshes
from tests.bake.reference_scenes import GREY, check_z, ground_points, scene_of

FACING = {"position": [0.0, 0.0, 3.0], "target": [0.0, 0.0, 0.0], "focal_length_mm": 60.0}


def map_of(rng):
    """A lat-long map with one bright texel."""
    radiance = rng.random((8, 16, 3)).astype(np.float32)
    radiance[2, 11] = 30.0
    return radiance


def irradiance(radiance, turn, normal, fine=32):
    """Sum of a map (h, w, 3) over finer directions, turned about +y."""
    height, width = np.array(radiance.shape[:2]) * fine
    v, u = (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width
    uv = np.stack(np.meshgrid(u, v), axis=-1)
    direction = transforms.latlong_direction(uv) @ transforms.rotation("y", turn).T
    solid = transforms.latlong_solid_angles(height, width)[:, None]
    cosine = np.maximum(direction @ np.asarray(normal), 0) * solid
    return np.einsum("hw,hwc->c", cosine, np.repeat(np.repeat(radiance, fine, 0), fine, 1))


@pytest.mark.parametrize(("rotate", "shadows"), [(0.0, True), (70.0, True), (70.0, False)])
def test_a_plate_under_an_environment(tmp_path, rng, rotate, shadows):
    radiance = map_of(rng)
    exr.write(tmp_path / "map.exr", {"beauty": radiance})
    source = reference_scenes.write_mesh(tmp_path, "plate", small_meshes.plate(half=2.0))
    light = {"type": "environment", "source": "map.exr", "rotate": rotate, "scale": 0.5}
    meshes = [{"name": "plate", "source": source}]
    scene = scene_of(tmp_path, FACING, lights=[light], meshes=meshes)
    found = render(scene, params=Params(width=16, height=16, bounces=0, shadows=shadows))
    truth = 0.5 * irradiance(radiance, np.radians(rotate), [0.0, 0.0, 1.0]) / np.pi
    check_z(found, truth[0])


def test_directions_of_an_environment_and_their_density_belong_together(rng):
    radiance = map_of(rng).astype(np.float64)
    light = EnvironmentSampler.of_map(radiance, 0.7)
    drawn = light.sample(np.zeros((4096, 3)), rng.random((4096, 3)))
    seen, density = light.look(drawn.direction)
    # A direction within rounding of a texel's edge may be looked up in the next one
    same = np.isclose(density, drawn.density, rtol=1e-12)
    assert np.count_nonzero(~same) <= 2
    assert np.allclose((seen / density[:, None])[same], drawn.weight[same], rtol=1e-12)
    # The density is one over the sphere
    solid = transforms.latlong_solid_angles(8, 16)[:, None]
    assert abs((light.density * solid).sum() - 1) < 1e-12


def test_ground_under_a_glowing_plate(tmp_path):
    glow = glb.Material(base_color=(0.0, 0.0, 0.0, 1.0), emissive=(2.0, 2.0, 2.0))
    plate = small_meshes.plate(normal=(-0.5, -1.0, 0.2), centre=(1.3, 0.8, 0.0), half=0.4)
    source = reference_scenes.write_mesh(tmp_path, "lamp", plate, glow)
    meshes = [{"name": "lamp", "source": source}]
    scene = scene_of(tmp_path, ground={"albedo": [GREY] * 3}, meshes=meshes)
    found = render(scene, params=Params(width=16, height=16))
    up = [0.0, 1.0, 0.0]
    light = area_lights.polygon_irradiance(ground_points((16, 16)), up, plate.vertices, 2.0)
    check_z(found, GREY / np.pi * light.mean(axis=-1))
    # In the player what glows does not light
    alone = render(scene, params=Params(width=16, height=16, samples=4, shadows=False))
    assert not alone.radiance.any()


@pytest.mark.parametrize("behind", [True, False])
def test_a_thin_sheet_lets_its_share_through(tmp_path, behind):
    material = Material(base_color=(0.8, 0.8, 0.8), double_sided=True)
    sheet = small_meshes.plate(half=2.0, material=material)
    to_light = [0.0, 0.6, -0.8 if behind else 0.8]
    sun = {"type": "sun", "to_light": to_light, "irradiance": [2, 2, 2], "angular_diameter": 0}
    scene = scene_of(tmp_path, FACING, lights=[sun])
    part = reference_scene.Part(sheet, np.eye(4)[None], np.array([[1.0, 0.5, 2.0]]), 0.3)
    world = World(reference_scene.merged([part]), None)
    lights = reference_lights.at(scene, 0.0, world)
    tracer = Tracer(world, lights, reference_air.Air(), bounces=0, shadows=True)
    rays = camera_at(scene, 0.0, (8, 8)).rays(np.arange(64), np.arange(1), 1, 0)
    truth = 0.8 * np.array([1.0, 0.5, 2.0]) / np.pi * 2.0 * 0.8 * (0.3 if behind else 0.7)
    # The same for all rays: only float32 rounds
    assert np.abs(tracer.trace(rays).radiance / truth - 1).max() < 1e-5


def test_a_white_box_of_thin_sheets_vanishes_in_an_even_environment(tmp_path):
    exr.write(tmp_path / "even.exr", {"beauty": np.full((2, 4, 3), 0.7, np.float32)})
    scene = scene_of(tmp_path, FACING, lights=[{"type": "environment", "source": "even.exr"}])
    white = Material(base_color=(1.0, 1.0, 1.0), double_sided=True)
    box = replace(small_meshes.box(half=(0.3, 0.3, 0.3)), materials=(white,))
    part = reference_scene.Part(box, np.eye(4)[None], np.ones((1, 3)), 0.5)
    world = World(reference_scene.merged([part]), None)
    lights = reference_lights.at(scene, 0.0, world)
    # Half of the light leaves at each of 24 turns: 1e-7 of it is still inside
    tracer = Tracer(world, lights, reference_air.Air(), bounces=24, shadows=True)
    batches, pixels = 256, 16
    camera = camera_at(scene, 0.0, (4, 4))
    rays = camera.rays(np.arange(pixels), np.arange(batches), 1, 0)
    paths = tracer.trace(rays)
    inner = np.flatnonzero(np.isfinite(paths.distance))
    assert len(inner) > 500
    found = paths.radiance[inner, 0]
    assert abs(found.mean() - 0.7) < 4 * found.std() / np.sqrt(len(inner))
    # Which is sharp enough to tell a share of light that was lost
    assert found.std() / np.sqrt(len(inner)) < 0.01


@pytest.mark.parametrize("height", [0.05, 30.0])
def test_ground_right_under_a_panel_and_far_below_it(tmp_path, height):
    panel = {"type": "rectangle", "position": [0.2, height, 0.1], "facing": [0, -1, 0]}
    panel |= {"size": [1.0, 0.6], "radiance": [2.0, 2.0, 2.0]}
    scene = scene_of(tmp_path, lights=[panel], ground={"albedo": [GREY] * 3})
    found = render(scene, params=Params(width=16, height=16))
    corners = scene.lights[0].corners(0.0)
    points = ground_points((16, 16), cells=16)
    light = area_lights.polygon_irradiance(points, [0.0, 1.0, 0.0], corners, 2.0)
    check_z(found, GREY / np.pi * light.mean(axis=-1))
    # Under the panel nothing but the cosine varies: by at most 1 / sqrt(3) of the mean, over 8
    middle = found.error[7:9, 7:9] / found.radiance[7:9, 7:9]
    assert middle.max() < 2 / np.sqrt(3) / 8


def test_directions_fill_a_spherical_triangle_evenly(rng):
    a, b, c = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    a, b, c = (np.tile(x, (40000, 1)) for x in (a, b, c))
    area = solid_angle(a, b, c)
    # An octant
    assert np.allclose(area, np.pi / 2, rtol=1e-14)
    found = spherical_triangle(a, b, c, area, rng.random((40000, 2)))
    assert np.allclose(np.linalg.norm(found, axis=1), 1, rtol=1e-12)
    x = np.stack([np.einsum("ij,ij->i", found, y) for y in (a, b, c)])
    assert x.min() > -1e-12
    # Every coordinate of an octant is even in 0..1, and its square has mean 1/3
    assert np.abs(x.mean(axis=1) - 0.5).max() < 4 / np.sqrt(12 * 40000)
    assert np.abs((x * x).mean(axis=1) - 1 / 3).max() < 4 * np.sqrt(4 / 45 / 40000)


def test_inside_a_ball_there_is_light_all_around(tmp_path):
    ball = {"type": "sphere", "position": [0, 0, 0], "radius": 6.0, "radiance": [1.5, 1.5, 1.5]}
    scene = scene_of(tmp_path, lights=[ball], ground={"albedo": [GREY] * 3})
    check_z(render(scene, params=Params(width=16, height=16)), GREY * 1.5)
