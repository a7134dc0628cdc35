"""The truth of the lens: the same scene through many points of the aperture, added up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maths import transforms
from runtime.camera import Camera

GOLDEN = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True, eq=False)
class PointOfLens(Camera):
    """The pinhole at (right, up) metres off the axis whose picture meets at the plane of focus."""

    off: tuple[float, float] = (0.0, 0.0)

    def clip_from_world(self, aspect):
        x, y = self.off
        moved = np.eye(4)
        moved[:2, 3] = -x, -y
        # A point at depth d moves by off (1 / d_f - 1 / d) per unit of depth
        moved[0, 2], moved[1, 2] = -x / self.focus_distance, -y / self.focus_distance
        near = 0.1
        perspective = transforms.perspective(
            self.focal_length, self.sensor_height, aspect, near, np.inf
        )
        return perspective @ moved @ self.view_from_world

    def world_from_ray(self, aspect):
        rays = super().world_from_ray(aspect)
        x, y = self.off
        up = self.view_from_world[1, :3]
        rays[:, 2] -= (x * self.right + y * up) / self.focus_distance
        return rays

    def uniforms(self, size):
        x, y = self.off
        up = self.view_from_world[1, :3]
        moved = tuple(self.position + x * self.right + y * up)
        return super().uniforms(size) | {"camera_position": moved}


def points(count):
    """Even points (count, 2) of the unit disc: a sunflower."""
    radius = np.sqrt((np.arange(count) + 0.5) / count)
    angle = GOLDEN * np.arange(count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def accumulate(player, count=256):
    """Mean radiance (h, w, 3) of a player without a lens pass over the aperture of its camera."""
    player.reuse = False
    player.look(0.0)
    view = player.view
    aperture = 0.5 * view.focal_length / view.f_number
    total = 0.0
    for off in aperture * points(count):
        player.camera = PointOfLens(
            view.position,
            view.target,
            view.focal_length,
            view.sensor_height,
            view.f_number,
            view.focus_distance,
            off=tuple(off),
        )
        total = total + player.linear(0.0)[..., :3].astype(np.float64)
    player.camera = None
    return total / count
