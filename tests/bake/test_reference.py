"""Paths against closed forms, each judged by the error bars that come with the picture."""

import numpy as np
import pytest

from bake import reference, workers
from formats.errors import InputError
from formats.files import exr, glb
from maths import area_lights
from tests.bake import reference_scenes, small_meshes
from tests.bake.reference_scenes import GREY, check_z, ground_points, scene_of

UP = np.array([0.0, 1.0, 0.0])
GROUND = {"albedo": [GREY] * 3}
WHITE = [2.0, 2.0, 2.0]
BALL = {"type": "sphere", "position": [0.6, 0.8, 0.1], "radius": 0.5, "radiance": WHITE}
LAMP = {"type": "rectangle", "position": [0.3, 1.0, 0.2], "facing": [0.2, -1.0, 0.1]}
LAMP |= {"size": [0.8, 0.5], "radiance": WHITE}


def params(size=16, samples=64, **knobs):
    return reference.Params(width=size, height=size, samples=samples, **knobs)


def on_ground(irradiance, size=16):
    """Radiance (size, size) that the ground sends out under irradiance(points)."""
    return GREY / np.pi * irradiance(ground_points((size, size))).mean(axis=-1)


@pytest.mark.parametrize(("albedo", "bounces"), [(0.5, 0), (0.8, 3)])
def test_a_closed_furnace_is_a_geometric_series(tmp_path, albedo, bounces):
    material = glb.Material(base_color=(albedo,) * 3 + (1.0,), emissive=(0.5, 0.5, 0.5))
    source = reference_scenes.write_mesh(tmp_path, "box", small_meshes.box(), material)
    camera = {"position": [0.3, 0.2, 0.1], "target": [-1.0, 0.1, 0.2], "focal_length_mm": 12.0}
    scene = scene_of(tmp_path, camera, meshes=[{"name": "box", "source": source}])
    found = reference.render(scene, params=params(samples=64, bounces=bounces))
    # A light's own light is the first of bounces + 1 passes
    truth = 0.5 * (1 - albedo ** (bounces + 2)) / (1 - albedo)
    mean = found.radiance[..., 0].mean(dtype=np.float64)
    error = np.sqrt(np.mean(found.error[..., 0].astype(np.float64) ** 2) / 256)
    assert abs(mean - truth) < 4 * error
    # The test can tell one bounce more from this: it is many errors away
    assert 0.5 * albedo ** (bounces + 2) > 20 * error


def sphere(point):
    return area_lights.sphere_irradiance(point, UP, BALL["position"], 0.5, 2.0)


def low_sphere(point):
    return area_lights.sphere_irradiance(point, UP, [1.4, 0.1, 0.1], 0.3, 2.0)


def disc(point):
    axis = np.array([0.28, -0.96, 0.0])
    return area_lights.disc_irradiance(point, UP, [0.2, 0.7, 0.1], axis, 0.4, 2.0)


def rectangle(point):
    axis = np.array(LAMP["facing"]) / np.linalg.norm(LAMP["facing"])
    right = np.cross(UP, axis) / np.linalg.norm(np.cross(UP, axis))
    right, up = 0.4 * right, 0.25 * np.cross(axis, right / np.linalg.norm(right))
    corners = [x * right + y * up for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    corners = np.array(LAMP["position"]) + corners
    return area_lights.polygon_irradiance(point, UP, corners, 2.0)


def polygon(point):
    return area_lights.polygon_irradiance(point, UP, OUTLINE, 2.0, two_sided=True)


def sun(point):
    to_light = np.array([0.8, 0.6, 0.0])
    normal = np.broadcast_to(UP, point.shape)
    return area_lights.sun_irradiance(normal, to_light, 2.0, np.radians(20))


OUTLINE = np.array([[0.0, 1.2, 0.0], [0.9, 0.9, -0.2], [0.8, 0.6, 0.8], [0.2, 0.8, 0.85]])
OUTLINE[3] = OUTLINE[0] + 0.9 * (OUTLINE[2] - OUTLINE[1])
LIGHTS = {
    "sphere": (BALL, sphere),
    "sphere across the horizon": (
        BALL | {"position": [1.4, 0.1, 0.1], "radius": 0.3},
        low_sphere,
    ),
    "disc": (
        {"type": "disc", "position": [0.2, 0.7, 0.1], "facing": [0.28, -0.96, 0], "radius": 0.4,
         "radiance": WHITE},
        disc,
    ),
    "rectangle": (LAMP, rectangle),
    "polygon": (
        {"type": "polygon", "outline": OUTLINE.tolist(), "radiance": WHITE, "two_sided": True},
        polygon,
    ),
    "sun": (
        {"type": "sun", "to_light": [0.8, 0.6, 0], "irradiance": WHITE, "angular_diameter": 40.0},
        sun,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LIGHTS)
def test_ground_under_one_light_is_its_closed_form(tmp_path, name):
    light, irradiance = LIGHTS[name]
    scene = scene_of(tmp_path, lights=[light], ground=GROUND)
    found = reference.render(scene, params=params())
    # Means over a pixel of 8 x 8 points: those of 16 x 16 differ by less than 4e-4 of themselves
    check_z(found, on_ground(irradiance))


def test_the_error_falls_with_the_root_of_the_samples_and_faster_when_they_are_spread(tmp_path):
    scene = scene_of(tmp_path, lights=[BALL], ground=GROUND)
    truth = on_ground(sphere, 32)
    counts = np.array([4, 8, 16, 64, 256])
    rms, told = [], []
    for samples in counts:
        found = reference.render(scene, params=params(32, int(samples)))
        rms.append(np.sqrt(np.mean((found.radiance[..., 0] - truth) ** 2)))
        told.append(np.sqrt(np.mean(found.error[..., 0].astype(np.float64) ** 2)))
    # The rms of 1024 pixels is known to 1 / sqrt(2048) = 2.2 %: four of it over a factor of 4
    slack = 4 * 0.022 * np.sqrt(2) / np.log(4)
    for errors in (rms, told):
        # Up to 16 every sample is a batch of its own, by chance
        slope = np.polyfit(np.log(counts[:3]), np.log(errors[:3]), 1)[0]
        assert abs(slope + 0.5) < slack
        # Beyond, 4 and 16 of a batch are spread over the pixel and over the light
        slope = np.polyfit(np.log(counts[2:]), np.log(errors[2:]), 1)[0]
        assert -1.2 < slope < -0.6


def test_the_shadow_of_a_plate_lies_where_geometry_puts_it(tmp_path):
    plate = small_meshes.plate(normal=(0, 1, 0), half=0.2)
    source = reference_scenes.write_mesh(tmp_path, "plate", plate)
    sun_light = {"type": "sun", "to_light": [1, 1, 0], "irradiance": WHITE, "angular_diameter": 0}
    meshes = [{"name": "plate", "source": source, "position": [0.5, 0.8, 0.0]}]
    scene = scene_of(tmp_path, lights=[sun_light], ground=GROUND, meshes=meshes)
    found = reference.render(scene, params=params(32, 4, bounces=0))
    # The shadow is the plate shifted by its height against the sun, to x = -0.3
    points = ground_points((32, 32))
    inside = (np.abs(points[..., 0] + 0.3) < 0.2) & (np.abs(points[..., 2]) < 0.2)
    # The plate hides its own projection from the camera at 4 m: leave that half of the picture
    seen = points[..., 0].max(axis=-1) < 0.2
    dark, lit = inside.all(axis=-1) & seen, ~inside.any(axis=-1) & seen
    edge = np.abs(np.maximum(np.abs(points[..., 0] + 0.3), np.abs(points[..., 2])) - 0.2)
    # A pixel is 0.0625 m wide
    lit &= edge.min(axis=-1) > 0.05
    dark &= edge.min(axis=-1) > 0.0
    assert dark.sum() > 20
    assert np.all(found.radiance[dark] == 0)
    truth = GREY / np.pi * 2.0 * np.sqrt(0.5)
    # The same light from everywhere: only float32 rounds it
    assert np.abs(found.radiance[lit] / truth - 1).max() < 1e-6
    through = reference.render(scene, params=params(32, 4, shadows=False))
    assert np.abs(through.radiance[dark | lit] / truth - 1).max() < 1e-6


def test_error_bars_are_honest_between_seeds(tmp_path):
    source = reference_scenes.write_mesh(tmp_path, "ball", small_meshes.sphere(8, 16))
    meshes = [{"name": "ball", "source": source, "position": [0.3, 0.5, 0.0], "scale": 0.4}]
    scene = scene_of(tmp_path, lights=[LAMP, BALL], ground=GROUND, meshes=meshes)
    one, two = (reference.render(scene, params=params(24, 64, seed=s)) for s in (1, 2))
    a, b = (f.error[..., 0].astype(np.float64) for f in (one, two))
    z = (one.radiance[..., 0] - two.radiance[..., 0]) / np.hypot(a, b)
    # Both bars have 15 degrees of freedom: together z is Student's of about 30, whose square has
    # mean 30/28 and variance 1.071^2 (2 + 6/26) = 2.56
    assert abs(z.mean()) < 4 * np.sqrt(30 / 28 / z.size)
    assert abs((z * z).mean() - 30 / 28) < 4 * np.sqrt(2.56 / z.size)


def test_threads_do_not_change_a_byte(tmp_path):
    source = reference_scenes.write_mesh(tmp_path, "ball", small_meshes.sphere(8, 16))
    meshes = [{"name": "ball", "source": source, "scale": 0.4}]
    scene = scene_of(tmp_path, lights=[LAMP, BALL], ground=GROUND, meshes=meshes)
    found = []
    try:
        for count in (1, 2):
            workers.use(count)
            found.append(reference.render(scene, params=params(64, 16)))
    finally:
        workers.use(0)
    # 64 x 64 pixels are two tiles
    assert found[0].radiance.tobytes() == found[1].radiance.tobytes()
    assert found[0].error.tobytes() == found[1].error.tobytes()


def test_a_saved_reference_has_its_error_beside_it(tmp_path):
    scene = scene_of(tmp_path, lights=[BALL], ground=GROUND)
    found = reference.render(scene, params=params(8, 4))
    found.save(tmp_path / "x.exr")
    parts = exr.read(tmp_path / "x.exr")
    assert np.array_equal(parts["beauty"], found.radiance)
    assert np.array_equal(parts["error"], found.error)
    assert np.all(found.coverage == 1)
    # Straight down from 4 m
    assert abs(found.distance[3:5, 3:5].mean() / 4.0 - 1) < 0.01


@pytest.mark.parametrize(
    "knobs", [{"samples": 1}, {"width": 0}, {"bounces": -1}, {"time": float("nan")}]
)
def test_knobs_out_of_range_are_one_line(tmp_path, knobs):
    with pytest.raises(InputError, match=r"choose a whole number|finite"):
        reference.render(scene_of(tmp_path), params=reference.Params(**knobs))
