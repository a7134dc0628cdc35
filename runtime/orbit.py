"""What hands do to a camera: orbit, pan, dolly, focus. No window, no OpenGL."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.camera import Camera

STEEPEST = np.radians(89.0)
NEAREST, FARTHEST = 0.05, 1e5  # metres from the target
MARGIN = 1.1  # of the picture about what is framed


def orbit(camera: Camera, yaw: float, pitch: float) -> Camera:
    """Turn the camera about its target; radians, kept short of straight up and down."""
    offset = camera.position - camera.target
    distance = float(np.linalg.norm(offset))
    azimuth = np.arctan2(offset[0], offset[2]) + yaw
    height = np.arcsin(np.clip(offset[1] / distance, -1, 1)) + pitch
    height = np.clip(height, -STEEPEST, STEEPEST)
    level = np.cos(height)
    towards = np.array([level * np.sin(azimuth), np.sin(height), level * np.cos(azimuth)])
    return replace(camera, position=camera.target + distance * towards)


def pan(camera: Camera, right: float, up: float) -> Camera:
    """Shift camera and target along the picture, in picture heights at the target's distance."""
    distance = float(np.linalg.norm(camera.position - camera.target))
    metres = distance * camera.sensor_height / camera.focal_length
    axes = camera.view_from_world[:2, :3]
    shift = metres * (right * axes[0] + up * axes[1])
    return replace(camera, position=camera.position + shift, target=camera.target + shift)


def dolly(camera: Camera, steps: float) -> Camera:
    """Move towards the target by tenths of the distance; never through it."""
    offset = camera.position - camera.target
    distance = float(np.linalg.norm(offset))
    wanted = float(np.clip(distance * 0.9**steps, NEAREST, FARTHEST))
    return replace(camera, position=camera.target + offset * (wanted / distance))


def focus(camera: Camera, distance: float) -> Camera:
    """Set the plane of focus, metres along the axis; a camera without a lens stays as it is."""
    if camera.focus_distance is None:
        return camera
    return replace(camera, focus_distance=max(distance, 1.05 * camera.focal_length))


def look(camera: Camera, yaw: float, pitch: float) -> Camera:
    """Turn the camera about itself; radians, kept short of straight up and down."""
    turned = orbit(replace(camera, position=camera.target, target=camera.position), yaw, -pitch)
    return replace(camera, target=turned.position)


def fly(camera: Camera, right: float, up: float, forward: float) -> Camera:
    """Move camera and target together; metres, up along the world's +y."""
    shift = right * camera.right + up * np.array([0.0, 1.0, 0.0]) + forward * camera.forward
    return replace(camera, position=camera.position + shift, target=camera.target + shift)


def frame(camera: Camera, points: NDArray[np.float64], aspect: float) -> Camera:
    """Look from the same side at points (n, 3), metres, so that they just fit into the picture.

    aspect : width over height of the picture.
    """
    axes = camera.view_from_world[:3, :3]
    seen = points @ axes.T
    seen[:, 2] = -seen[:, 2]
    half = 0.5 * camera.sensor_height / camera.focal_length / MARGIN
    middle, far = np.zeros(3), -np.inf
    for axis, slope in ((0, half * aspect), (1, half)):
        # The planes of two opposite sides of the picture, each moved until all lies inside
        over = float((seen[:, axis] - slope * seen[:, 2]).max())
        under = float((seen[:, axis] + slope * seen[:, 2]).min())
        middle[axis] = 0.5 * (over + under)
        far = max(far, 0.5 * (over - under) / slope)
    depth = seen[:, 2]
    back = max(far, NEAREST - float(depth.min()))
    eye = axes.T @ np.array([middle[0], middle[1], back])
    distance = back + 0.5 * float(depth.min() + depth.max())
    return replace(camera, position=eye, target=eye + distance * camera.forward)


def hold(camera: Camera, distance: float) -> Camera:
    """Turn about what is `distance` metres along the axis from now on; the picture stays."""
    distance = float(np.clip(distance, NEAREST, FARTHEST))
    return replace(camera, target=camera.position + distance * camera.forward)


def as_toml(camera: Camera) -> str:
    """Return the lines of a scene file that put its camera here.

    >>> print(as_toml(Camera(np.array([0.0, 1.0, 4.0]), np.zeros(3))))
    [camera]
    position = [0, 1, 4]
    target = [0, 0, 0]
    focal_length_mm = 50
    sensor_height_mm = 24
    """
    lines = [
        "[camera]",
        f"position = {_vector(camera.position)}",
        f"target = {_vector(camera.target)}",
        f"focal_length_mm = {1e3 * camera.focal_length:.6g}",
        f"sensor_height_mm = {1e3 * camera.sensor_height:.6g}",
    ]
    if camera.f_number is not None and camera.focus_distance is not None:
        lens = f"f_number = {camera.f_number:.4g}, focus_distance = {camera.focus_distance:.6g}"
        lines.append(f"lens = {{ {lens} }}")
    return "\n".join(lines)


def _vector(values: NDArray[np.float64]) -> str:
    return f"[{', '.join(f'{value:.6g}' for value in values)}]"
