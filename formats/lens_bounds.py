"""How much a scene's lens blurs anything at most: bounds that hold at every moment.

A still camera is computed as it is; a moving one by boxes of its keys. The circle of confusion
f^2 / N / (d_f - f) |1 - d_f / d| grows with f, falls with N, and between two values of d or of d_f
it is largest at one of them: the corners of a box hold its most.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.poses import Pose, cube_ball, mesh_balls, poses, rays
from formats.scene import NEAR, Billboards, Scene
from maths import optics

Array = NDArray[np.float64]
Reports = Mapping[str, Mapping[str, Any]]
REACH = 1.5  # radius of a sprite about its middle, in heights, before it is baked
UNKNOWN_REACH = 100.0  # metres from the origin of a mesh, at scale 1, that no report measures yet


@dataclass(frozen=True)
class Blur:
    """The largest circle of confusion: where and when. distance and t in metres and seconds."""

    pixels: float
    name: str
    distance: float
    t: float


@dataclass(frozen=True)
class Balls:
    """Balls that hold the sprites of a set, and their lowest and highest point over the foot.

    middles : (n, 3). radii, low, high : (n,) metres. known : measured, not guessed.
    """

    middles: Array
    radii: Array
    low: Array
    high: Array
    known: bool


def balls(billboards: Billboards, reports: Reports) -> Balls:
    """Balls about the sprites of a set: as large as their picture is, where it is baked."""
    instances = billboards.instances()
    tall = billboards.height * instances.scale
    feet, up = instances.positions, np.array([0.0, 1.0, 0.0])
    report = reports.get(f"billboard/{billboards.name}", {})
    layout, size = report.get("layout"), report.get("size")
    if not billboards.stands:
        # About its middle, at one depth
        wide = (
            REACH * tall if layout is None or size is None else _half_diagonal(layout, size, tall)
        )
        return Balls(feet, wide, 0.0 * tall, 0.0 * tall, layout is not None and size is not None)
    if layout is None or size is None:
        if instances.roll.any():
            return Balls(feet, 2.0 * REACH * tall, -REACH * tall, REACH * tall, False)
        return Balls(feet + 0.5 * tall[:, None] * up, REACH * tall, 0.0 * tall, tall, False)
    texel = layout["metres_per_texel"] / layout["height"] * tall
    (w, h), (x, y) = size, layout["pivot"]
    radius = np.hypot(max(x, w - x), max(y, h - y))
    if instances.roll.any():
        return Balls(feet, radius * texel, -radius * texel, radius * texel, True)
    return Balls(feet, radius * texel, -(h - y) * texel, y * texel, True)


def _half_diagonal(layout: Mapping[str, Any], size: Any, tall: Array) -> Array:
    """Metres from the middle of a picture to the farthest corner of its borders."""
    texel, (w, h) = layout["metres_per_texel"] / layout["height"], size
    x, y = layout["pivot"][0], layout["pivot"][1] - 0.5 / texel
    far = np.hypot(max(x, w - x), max(y, h - y))
    return np.asarray(far * texel * tall)


def clouds(scene: Scene, reports: Reports) -> Iterator[tuple[str, Array, Array]]:
    """Yield (name, middle (1, 3), radius (1,)) of balls that hold all particles at every moment."""
    for found in scene.particles:
        if scene.force.get("particles") is False or found.most == 0 or found.dark:
            continue
        low, high = found.box()
        reach = found.factor[1] * _reach(scene, reports, found.look.billboard)
        half = float(np.linalg.norm(high - low)) / 2
        yield f"particles {found.name}", 0.5 * (low + high)[None], np.array([half + reach])


def _reach(scene: Scene, reports: Reports, name: str | None) -> float:
    """Metres about the middle of a particle at factor 1; of a disc 1 m wide its soft levels too."""
    if name is None:
        return REACH
    height = next(each.height for each in scene.billboards if each.name == name)
    report = reports.get(f"billboard/{name}", {})
    if "size" not in report:
        return REACH * height
    layout = report["layout"]
    texel = layout["metres_per_texel"] / layout["height"]
    return float(np.hypot(*report["size"]) * texel * height)


def of_sprites(scene: Scene, reports: Reports, lines: int) -> Blur | None:
    """The largest circle of confusion of any sprite seen, in pixels of a picture `lines` high.

    None without a lens, and where no sprite is ever seen.
    """
    return _largest(scene, lines, lambda pose: _sprites(scene, reports, pose))


def of_ground(scene: Scene, lines: int) -> Blur | None:
    """The same of the ground."""
    return _largest(scene, lines, lambda pose: _ground(scene, pose))


def of_opaque(scene: Scene, reports: Reports, lines: int) -> Blur | None:
    """The same of meshes, cubes, ground and sky, which lies infinitely far."""

    def seen(pose: Pose) -> Iterator[tuple[str, Array]]:
        half = _half(scene)
        found = [(f"the mesh {n}", m, r) for n, m, r in mesh_balls(scene, reports, UNKNOWN_REACH)]
        found += [("the cubes", m, r) for m, r in cube_ball(scene, reports, UNKNOWN_REACH)]
        for name, middle, radius in found:
            shown, low, high = pose.depths(middle[None], np.array([radius]), half)
            if shown[0]:
                yield name, np.stack([low, high])
        yield from _ground(scene, pose)
        if scene.picture.sky is not None:
            yield "the sky", np.full((2, 1), np.inf)

    return _largest(scene, lines, seen)


def _sprites(scene: Scene, reports: Reports, pose: Pose) -> Iterator[tuple[str, Array]]:
    for billboards in scene.billboards:
        found = balls(billboards, reports)
        if not len(found.middles):
            continue
        seen, low, high = pose.depths(found.middles, found.radii, _half(scene))
        if pose.shift == pose.turn == 0.0:
            # Upright and turned to the camera: only height changes depth
            feet = billboards.instances().positions @ pose.view[2, :3] + pose.view[2, 3]
            ends = -np.stack([feet + z * pose.view[2, 1] for z in (found.low, found.high)])
            low, high = np.maximum(np.sort(ends, axis=0), NEAR)
        if seen.any():
            yield billboards.name, np.stack([low, high])[:, seen]
    for name, middle, radius in clouds(scene, reports):
        seen, low, high = pose.depths(middle, radius, _half(scene))
        if seen[0]:
            yield name, np.stack([low, high])


def _ground(scene: Scene, pose: Pose) -> Iterator[tuple[str, Array]]:
    if scene.ground is None:
        return
    fall = scene.ground.height - float(pose.position[1])
    along = rays(scene)
    if along is not None:
        nearness = np.array(along) / fall if fall != 0.0 else np.zeros(2)
        if nearness.max() <= 0.0:
            return
        near, far = 1.0 / nearness.max(), np.inf if nearness.min() <= 0 else 1.0 / nearness.min()
    else:
        slope = _half(scene) / pose.focal_length[0]
        corner = np.hypot(1.0, slope * np.hypot(1.0, 2.4))
        near, far = max(abs(fall) - pose.shift, 0.0) / corner, np.inf
    yield "the ground", np.maximum(np.array([[near], [far]]), NEAR)


def _largest(scene: Scene, lines: int, seen: Any) -> Blur | None:
    found: Blur | None = None
    if scene.camera.lens is None:
        return None
    for pose in poses(scene):
        for name, depths in seen(pose):
            circles = _circles(pose, depths) * lines / (2.0 * _half(scene))
            end, n = np.unravel_index(int(np.argmax(circles)), circles.shape)
            if found is None or circles[end, n] > found.pixels:
                distance = float(depths[end, n])
                found = Blur(float(circles[end, n]), name, distance, pose.start)
    return found


def _circles(pose: Pose, depths: Array) -> Array:
    """The largest circle on the sensor (2, n), metres, of each end of depths (2, n)."""
    lenses = {(f, focus) for f in pose.focal_length for focus in pose.focus}
    circles = [optics.circle_of_confusion(depths, f, pose.f_number, focus) for f, focus in lenses]
    return np.asarray(np.max(circles, axis=0))


def _half(scene: Scene) -> float:
    """Half the height of the sensor, metres."""
    return scene.camera.sensor_height_mm / 2000.0
