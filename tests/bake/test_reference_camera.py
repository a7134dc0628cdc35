"""The reference's lens against the circle of confusion, by geometry and in a picture."""

import numpy as np
import pytest

from bake import reference, reference_camera
from formats.files import glb
from maths import optics
from tests.bake import reference_scenes, small_meshes

FOCUS, FOCAL, SENSOR = 1.0, 0.1, 0.024
CAMERA = {
    "position": [0.0, 0.0, 0.0],
    "target": [0.0, 0.0, -1.0],
    "focal_length_mm": 1000 * FOCAL,
    "sensor_height_mm": 1000 * SENSOR,
    "lens": {"f_number": 1.0, "focus_distance": FOCUS},
}


def rays(tmp_path, size, samples, *, lens=True, camera=CAMERA):
    scene = reference_scenes.scene_of(tmp_path, camera)
    found = reference_camera.at(scene, 0.0, (size, size), lens=lens)
    pixel = np.arange(size * size)
    return found, np.tile(pixel, samples), found.rays(pixel, np.arange(1), samples, 0)


def at_depth(cast, depth):
    """Where rays cross the plane z = -depth, (n, 2)."""
    along = (-depth - cast.start[:, 2]) / cast.direction[:, 2]
    return (cast.start + along[:, None] * cast.direction)[:, :2]


@pytest.mark.parametrize("depth", [0.6, 0.8, FOCUS, 3.0, 50.0])
def test_a_pixel_sees_a_disc_as_wide_as_the_circle_of_confusion(tmp_path, depth):
    size, samples = 9, 4096
    _, pixel, cast = rays(tmp_path, size, samples)
    middle = at_depth(cast, depth)[pixel == size * size // 2]
    circle = optics.circle_of_confusion(depth, FOCAL, 1.0, FOCUS)
    radius = np.linalg.norm(middle, axis=1) * FOCAL / depth / SENSOR * size
    blur = optics.pixels(circle, size, SENSOR) / 2
    # The half diagonal of the pixel comes on top, of which 4096 points reach all but a little
    assert radius.max() <= blur + np.sqrt(0.5) + 1e-9
    assert radius.max() >= blur + 0.5 - 0.05
    # A disc and a box in second moments; squares of radii vary by at most 0.7 of their mean, so
    # four deviations of 4096 points by chance are 4 %, and these are spread more evenly
    assert abs(np.mean(radius**2) / (blur**2 / 2 + 1 / 6) - 1) < 0.04


def test_without_a_lens_all_rays_leave_one_point_and_stay_in_their_pixel(tmp_path):
    size = 6
    camera, pixel, cast = rays(tmp_path, size, 16, lens=False)
    assert camera.aperture == 0
    assert np.all(cast.start == 0)
    place = at_depth(cast, 1.0) * FOCAL / SENSOR * size
    column, row = place[:, 0] + size / 2, size / 2 - place[:, 1]
    # What rounding puts on an edge is 1e-12 of a pixel off
    assert np.all(np.abs(column - (pixel % size + 0.5)) <= 0.5 + 1e-12)
    assert np.all(np.abs(row - (pixel // size + 0.5)) <= 0.5 + 1e-12)


def test_batches_and_seeds_are_different_rays(tmp_path):
    camera, _, one = rays(tmp_path, 4, 2)
    other = camera.rays(np.arange(16), np.arange(1, 2), 2, 0)
    seeded = camera.rays(np.arange(16), np.arange(1), 2, 1)
    assert len(set(one.key.flat) | set(other.key.flat) | set(seeded.key.flat)) == 3 * 16 * 2


def test_a_batch_is_spread_more_evenly_than_chance(tmp_path):
    camera, _, _ = rays(tmp_path, 64, 1)
    cast = camera.rays(np.arange(4096), np.arange(1), 16, 0)
    lens = cast.start[:, :2].reshape(16, 4096, 2) / camera.aperture
    # The mean square of a point of the unit disc by chance varies by 1 / sqrt(12 * 16)
    assert (lens**2).sum(axis=-1).mean(axis=0).std() < 0.5 / np.sqrt(12 * 16)


def test_a_point_out_of_focus_is_a_disc_in_the_picture(tmp_path):
    half, depth, size = 0.006, 0.6, 32
    glow = glb.Material(emissive=(1.0, 1.0, 1.0))
    plate = small_meshes.plate(half=half)
    source = reference_scenes.write_mesh(tmp_path, "dot", plate, glow)
    meshes = [{"name": "dot", "source": source, "position": [0, 0, -depth]}]
    scene = reference_scenes.scene_of(tmp_path, CAMERA, meshes=meshes)
    params = reference.Params(width=size, height=size, samples=512, bounces=0)
    light = reference.render(scene, params=params).radiance[..., 0].astype(np.float64)
    pixel = np.arange(size) + 0.5 - size / 2
    square = pixel[:, None] ** 2 + pixel**2
    circle = optics.circle_of_confusion(depth, FOCAL, 1.0, FOCUS)
    blur = optics.pixels(circle, size, SENSOR)
    side = 2 * half * FOCAL / depth / SENSOR * size
    assert blur > 9
    # Blurring keeps light: the plate's area in pixels
    hits = 512 * side**2
    assert abs(light.sum() / side**2 - 1) < 4 / np.sqrt(hits)
    # Second moments of disc, plate and the two boxes (a pixel's own, and its centre's) add up
    moment = (square * light).sum() / light.sum()
    truth = blur**2 / 8 + side**2 / 6 + 1 / 6
    # The square of the radius is even over the disc, so its deviation is 1 / sqrt 3 of its mean
    assert abs(moment / truth - 1) < 4 / np.sqrt(3 * hits)
    assert light[square > (blur / 2 + side / np.sqrt(2) + np.sqrt(0.5)) ** 2].max() == 0


def test_what_is_nearer_than_the_near_plane_is_not_seen(tmp_path):
    plate = small_meshes.plate(half=1.0)
    glow = glb.Material(emissive=(1.0, 1.0, 1.0))
    source = reference_scenes.write_mesh(tmp_path, "near", plate, glow)
    found = []
    for z in (-0.09, -0.11):
        meshes = [{"name": "near", "source": source, "position": [0, 0, z]}]
        scene = reference_scenes.scene_of(tmp_path, CAMERA, meshes=meshes)
        params = reference.Params(width=4, height=4, samples=2)
        found.append(reference.render(scene, params=params).coverage.mean())
    assert found == [0, 1]
