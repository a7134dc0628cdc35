"""What hands do to a camera: orbit, pan, dolly, focus. No window, no OpenGL."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.camera import Camera

STEEPEST = np.radians(89.0)
NEAREST, FARTHEST = 0.05, 1e5  # metres from the target


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


def distance_at_centre(
    camera: Camera, sets: list[NDArray[np.float64]], ground: float | None
) -> float:
    """Return the distance along the axis to what stands in the middle of the picture, metres.

    sets : (n, 5) sprites each: foot xyz, half width, height. ground : y of the plane or None. Where
    nothing stands there, the distance to the target.
    """
    found = []
    forward, right = camera.forward, camera.right
    facing = np.array([forward[0], 0.0, forward[2]])
    for sprites in sets:
        # Sprites stand in vertical planes that face the camera
        offset = sprites[:, :3] - camera.position
        depth = offset @ facing / max(float(facing @ forward), 1e-9)
        hit = depth[:, None] * forward - offset
        inside = (
            (np.abs(hit @ right) < sprites[:, 3]) & (hit[:, 1] > 0) & (hit[:, 1] < sprites[:, 4])
        )
        found += depth[inside & (depth > 0)].tolist()
    if ground is not None and forward[1] < -1e-6:
        found.append((ground - camera.position[1]) / forward[1])
    ahead = [d for d in found if d > 0]
    return min(ahead) if ahead else float(np.linalg.norm(camera.target - camera.position))
