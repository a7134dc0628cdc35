"""How coarse a level the lens asks of a set of sprites, over the whole animation.

Sampled: every frame where there are few, and every key in any case. What falls between is cut off
at the coarsest level that was baked; whether the lens is called for is formats/lens_bounds.py.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from formats.instances import Instances
from formats.scene import NEAR, Billboards, Camera, Particles, Scene
from maths import optics, transforms

MOMENTS = 256  # of the animation that are looked at, keys come on top
WORK = 4_000_000  # sprites times moments of one set
WIDEST = 2.4  # width over height of a picture: nothing seen in cinema's widest is left out
REACH = 1.5  # radius of a sprite about its middle, in heights: a crown may be wider than tall


def moments(scene: Scene, most: int = MOMENTS) -> NDArray[np.float64]:
    """Times (n,) in seconds at which the view of sprites is sampled; one for a still."""
    camera, duration = scene.camera, scene.time.duration
    moving = [camera.position, camera.target, camera.focal_length_mm]
    if camera.lens:
        moving += [camera.lens.f_number, camera.lens.focus_distance]
    moving = [keyed for keyed in moving if not keyed.constant]
    if not moving or duration == 0.0:
        return np.zeros(1)
    frames = int(duration * scene.time.frame_rate) + 1
    keys = np.concatenate([keyed.times for keyed in moving])
    keys = keys[(keys >= 0.0) & (keys <= duration)]
    return np.union1d(np.linspace(0.0, duration, min(frames, most)), keys)


def largest_texels(scene: Scene, billboards: Billboards, texels_per_metre: float) -> float:
    """The largest circle of confusion of a set in texels of its sprites' level 0; 0 without a lens.

    texels_per_metre : of the object at its own height; an instance's factor stretches it.
    """
    largest = 0.0
    for t, depths, scale in _seen(scene, billboards):
        focal_length = scene.camera.focal_length_mm.at(t) / 1000.0
        circles = optics.texels(
            _circles(scene.camera, depths, t), depths, focal_length, scale / texels_per_metre
        )
        largest = max(largest, float(circles.max()))
    for found in scene.particles:
        own = found.look.billboard or f"particles/{found.name}"
        if own == billboards.name and scene.camera.lens is not None and found.most:
            largest = max(largest, _of_cloud(scene, found, texels_per_metre))
    return largest


def _of_cloud(scene: Scene, found: Particles, texels_per_metre: float) -> float:
    """The same of particles: the smallest of them at the ends of their box."""
    low, high = found.box()
    corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1)
    largest = 0.0
    for t in moments(scene):
        camera = scene.camera
        view = transforms.look_at(camera.position.at(float(t)), camera.target.at(float(t)))
        depths = np.maximum(-(corners.reshape(-1, 3) @ view[2, :3] + view[2, 3]), NEAR)
        focal_length = camera.focal_length_mm.at(float(t)) / 1000.0
        circles = _circles(camera, depths, float(t))
        size = found.factor[0] / texels_per_metre
        largest = max(largest, float(optics.texels(circles, depths, focal_length, size).max()))
    return largest


def _circles(camera: Camera, depths: NDArray[np.float64], t: float) -> NDArray[np.float64]:
    """Circles of confusion on the sensor, metres."""
    assert camera.lens is not None
    return optics.circle_of_confusion(
        depths,
        camera.focal_length_mm.at(t) / 1000.0,
        camera.lens.f_number.at(t),
        camera.lens.focus_distance.at(t),
    )


def _seen(
    scene: Scene, billboards: Billboards
) -> Iterator[tuple[float, NDArray[np.float64], NDArray[np.float64]]]:
    """(time, depths (n,), scale (n,)) of the feet and tops of sprites that the camera may see."""
    instances = billboards.instances()
    if scene.camera.lens is None or not len(instances):
        return
    most = int(np.clip(WORK // len(instances), 16, MOMENTS))
    for t in moments(scene, most):
        depths, scale = _visible(scene.camera, billboards, instances, float(t))
        if depths.size:
            yield float(t), depths, scale


def _visible(
    camera: Camera, billboards: Billboards, instances: Instances, t: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    view_from_world = transforms.look_at(camera.position.at(t), camera.target.at(t))
    feet = instances.positions @ view_from_world[:3, :3].T + view_from_world[:3, 3]
    tall = billboards.height * instances.scale
    # One that faces the camera has one depth
    up = tall[:, None] * view_from_world[:3, 1] if billboards.stands else np.zeros_like(feet)
    # Leave out what is outside the widest picture by more than its own reach; rolled it may hang
    reach = (REACH + 0.5 * bool(instances.roll.any())) * tall
    middle = feet + 0.5 * up
    half = 0.5 * camera.sensor_height_mm / camera.focal_length_mm.at(t)
    inside = -middle[:, 2] + reach > NEAR
    for axis, slope in ((0, half * WIDEST), (1, half)):
        outside = np.abs(middle[:, axis]) + slope * middle[:, 2]
        inside &= outside <= reach * np.hypot(1.0, slope)
    hangs = -up if instances.roll.any() else 0.0 * up
    ends = -np.concatenate([(feet + hangs)[inside, 2], (feet + up)[inside, 2]])
    return np.maximum(ends, NEAR), np.tile(instances.scale[inside], 2)
