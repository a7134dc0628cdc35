"""The camera of one frame: where it is, what it shows, and the frame that sprites share with it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from formats.scene import NEAR
from maths import transforms


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole at `position` that looks at `target`; metres. The player takes a new one a frame.

    focal_length, sensor_height : metres. f_number, focus_distance : of the lens, None without one.
    """

    position: NDArray[np.float64]
    target: NDArray[np.float64]
    focal_length: float = 0.05
    sensor_height: float = 0.024
    f_number: float | None = None
    focus_distance: float | None = None

    @classmethod
    def of_scene(cls, scene: Any, time: float) -> Camera:
        """The scene's own camera at `time` seconds."""
        camera = scene.camera
        lens = camera.lens
        return cls(
            position=np.asarray(camera.position.at(time), np.float64),
            target=np.asarray(camera.target.at(time), np.float64),
            focal_length=camera.focal_length_mm.at(time) * 1e-3,
            sensor_height=camera.sensor_height_mm * 1e-3,
            f_number=lens.f_number.at(time) if lens else None,
            focus_distance=lens.focus_distance.at(time) if lens else None,
        )

    @cached_property
    def view_from_world(self) -> NDArray[np.float64]:
        """(4, 4)."""
        return transforms.look_at(self.position, self.target)

    @property
    def right(self) -> NDArray[np.float64]:
        """World direction (3,) of the picture's +x, always level: +x of every sprite."""
        return self.view_from_world[0, :3]

    @property
    def forward(self) -> NDArray[np.float64]:
        """World direction (3,) of the optical axis."""
        return -self.view_from_world[2, :3]

    @property
    def yaw(self) -> float:
        """Turn about +y, radians, that takes the world's frame to that of upright sprites."""
        x, _, z = self.right
        return float(np.arctan2(-z, x))

    def clip_from_world(self, aspect: float) -> NDArray[np.float64]:
        """(4, 4), far plane at infinity: window depth is 1 - NEAR / distance along the axis."""
        return (
            transforms.perspective(self.focal_length, self.sensor_height, aspect, NEAR, np.inf)
            @ self.view_from_world
        )

    def world_from_ray(self, aspect: float) -> NDArray[np.float64]:
        """(3, 3) from (x, y, 1), -1..1 over the picture, to a ray of length 1 along the axis."""
        half = 0.5 * self.sensor_height / self.focal_length
        world_from_view = self.view_from_world[:3, :3].T
        return world_from_view @ np.diag([half * aspect, half, -1.0])

    def depth(self, points: ArrayLike) -> NDArray[np.float64]:
        """Distance (...) of points (..., 3) along the optical axis, metres."""
        return (np.asarray(points) - self.position) @ self.forward

    def uniforms(self, size: tuple[int, int]) -> dict[str, Any]:
        """What the shaders call the camera, for a picture of `size` (width, height)."""
        aspect = size[0] / size[1]
        return {
            "clip_from_world": column_major(self.clip_from_world(aspect)),
            "world_from_ray": column_major(self.world_from_ray(aspect)),
            "camera_position": tuple(self.position),
            "camera_right": tuple(self.right),
            "camera_forward": tuple(self.forward),
            "near": NEAR,
            "focal_length": self.focal_length,
        }


def column_major(matrix: NDArray[np.float64]) -> tuple[float, ...]:
    """Transpose a target_from_source matrix for upload."""
    return tuple(matrix.T.ravel())
