"""The camera: rays and matrices agree, sprites share its yaw."""

from __future__ import annotations

import numpy as np
import pytest

from formats.scene import NEAR
from maths import transforms
from runtime.camera import Camera


@pytest.fixture
def camera():
    return Camera(np.array([1.0, 2, 3]), np.array([-2.0, 1, 0.5]), focal_length=0.035)


def test_a_ray_goes_where_the_matrix_shows_it(camera, rng):
    aspect = 1.7
    for _ in range(20):
        x, y = rng.uniform(-1, 1, 2)
        distance = rng.uniform(1, 50)
        point = camera.position + distance * (camera.world_from_ray(aspect) @ [x, y, 1])
        clip = camera.clip_from_world(aspect) @ np.append(point, 1)
        np.testing.assert_allclose(clip[:2] / clip[3], [x, y], atol=1e-12)
        assert clip[3] == pytest.approx(distance)
        assert camera.depth(point) == pytest.approx(distance)
        # Window depth
        assert 0.5 + 0.5 * clip[2] / clip[3] == pytest.approx(1 - NEAR / distance)


def test_yaw_takes_the_world_to_the_frame_of_the_sprites(camera):
    world_from_sprite = transforms.rotation("y", camera.yaw)
    np.testing.assert_allclose(world_from_sprite[:, 0], camera.right, atol=1e-12)
    assert world_from_sprite[:, 2] @ camera.forward < 0


@pytest.mark.parametrize("target", [[1.0, -5, 3], [1.0, 9, 3]])
def test_straight_down_and_up_have_a_yaw(target):
    camera = Camera(np.array([1.0, 2, 3]), np.array(target))
    assert np.isfinite(camera.yaw)
    assert camera.right[1] == pytest.approx(0)
