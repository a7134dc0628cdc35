"""Everywhere that a scene's camera may be: boxes of its keys, which hold every moment.

A keyed value stays between two neighbouring keys, a component at a time, and never turns back on
the way. So between any two moments without a key in between it stays in the box of its values
there, and what is shown for the boxes of all such spans is shown for every moment.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.keyed import Keyed
from formats.meshes import KINDS
from formats.scene import NEAR, Camera, Scene
from maths import transforms

Array = NDArray[np.float64]
WIDEST = 2.4  # width over height of a picture: nothing seen in cinema's widest is left out
SPANS = 256  # about as many boxes
LONGEST = 2048  # keys; more, as of a short loop in a long animation, count as one box


@dataclass(frozen=True)
class Pose:
    """A camera that may be anywhere in a box.

    start : s, of the span. position : middle of the box (3,). shift : most metres from it. view :
    view_from_world (4, 4) of the middle. turn : most radians of the axis from that of the middle.
    focal_length, focus : (least, most) metres, f_number the least; focus is (inf, inf), f_number
    inf without a lens.
    """

    start: float
    position: Array
    shift: float
    view: Array
    turn: float
    focal_length: tuple[float, float]
    f_number: float
    focus: tuple[float, float]

    def depths(self, middles: Array, radii: Array, half: float) -> tuple[Array, Array, Array]:
        """Say of balls (n, 3), (n,) which may be seen (n,), and from and to which depths (n,).

        half : of the sensor's height, metres.
        """
        slope = half / self.focal_length[0]
        eye = middles @ self.view[:3, :3].T + self.view[:3, 3]
        if self.shift == self.turn == 0.0:
            seen = -eye[:, 2] + radii > NEAR
            for axis, side in ((0, slope * WIDEST), (1, slope)):
                outside = np.abs(eye[:, axis]) + side * eye[:, 2]
                seen &= outside <= radii * np.hypot(1.0, side)
            low, high = -eye[:, 2] - radii, -eye[:, 2] + radii
        else:
            # A cone about the axis holds the picture
            corner = np.arctan(np.hypot(slope, slope * WIDEST))
            away, reach = np.linalg.norm(eye, axis=1), radii + self.shift
            off = np.arctan2(np.hypot(eye[:, 0], eye[:, 1]), -eye[:, 2])
            wide = np.where(
                away > reach, np.arcsin(np.minimum(reach / np.maximum(away, 1e-30), 1.0)), np.pi
            )
            seen = off <= corner + self.turn + wide
            low, high = np.maximum(away - reach, 0.0) * np.cos(corner), away + reach
        return np.asarray(seen), np.maximum(low, NEAR), np.maximum(high, NEAR)


def poses(scene: Scene) -> list[Pose]:
    """Boxes that hold the camera at every moment of the animation; one for a still camera."""
    camera = scene.camera
    keyed = [camera.position, camera.target, camera.focal_length_mm]
    if camera.lens is not None:
        keyed += [camera.lens.f_number, camera.lens.focus_distance]
    return [_pose(camera, a, b) for a, b in spans(keyed, scene.time.duration)]


def spans(keyed: list[Keyed], duration: float) -> list[tuple[float, float]]:
    """Cut the animation where any of these has a key, and further into about SPANS parts."""
    moving = [each for each in keyed if not each.constant]
    if not moving or duration == 0.0:
        return [(0.0, 0.0)]
    times = np.concatenate([[0.0, duration], *(_keys(each, duration) for each in moving)])
    times = np.unique(times[(times >= 0.0) & (times <= duration)])
    if len(times) > LONGEST:
        return [(0.0, duration)]
    parts = max(1, SPANS // len(times))
    share = np.arange(parts) / parts
    cuts = np.append((times[:-1, None] + np.diff(times)[:, None] * share).ravel(), duration)
    return list(zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True))


def box(keyed: Keyed, start: float, end: float) -> tuple[Array, Array]:
    """Lowest and highest value (size,) or () between two moments without a key in between."""
    if start == end or keyed.constant:
        value = np.asarray(keyed.at(start))
        return value, value
    turns = _keys(keyed, end)
    between = (turns > start) & (turns < end)
    jumps = keyed.loop and not np.array_equal(keyed.values[0], keyed.values[-1])
    if jumps or keyed.interpolation == "step" or between.any():
        low, high = keyed.extremes
        return np.asarray(low), np.asarray(high)
    ends = np.stack([keyed.at(start), keyed.at(end)])
    return ends.min(axis=0), ends.max(axis=0)


def still(scene: Scene) -> bool:
    """Whether camera and target never move."""
    return scene.camera.position.constant and scene.camera.target.constant


def rays(scene: Scene) -> tuple[float, float] | None:
    """World y of the lowest and the highest ray of length 1 along the axis; None if it moves."""
    camera = scene.camera
    if not still(scene):
        return None
    view = transforms.look_at(camera.position.at(0.0), camera.target.at(0.0))
    half = 0.5 * camera.sensor_height_mm / camera.focal_length_mm.extremes[0]
    # +x of the picture is level: only its rows differ
    return (
        float(-view[2, 1] - half * abs(view[1, 1])),
        float(-view[2, 1] + half * abs(view[1, 1])),
    )


def _pose(camera: Camera, start: float, end: float) -> Pose:
    low, high = box(camera.position, start, end)
    aim_low, aim_high = box(camera.target, start, end)
    position, target = 0.5 * (low + high), 0.5 * (aim_low + aim_high)
    shift = 0.5 * float(np.linalg.norm(high - low))
    spread = shift + 0.5 * float(np.linalg.norm(aim_high - aim_low))
    far = float(np.linalg.norm(target - position))
    turn = float(np.arcsin(spread / far)) if spread < far else np.pi
    aim = target if far > 1e-9 else position + np.array([0.0, 0.0, -1.0])
    near, long = box(camera.focal_length_mm, start, end)
    number, focus = np.inf, (np.inf, np.inf)
    if camera.lens is not None:
        number = float(box(camera.lens.f_number, start, end)[0])
        focus = tuple(float(v) for v in box(camera.lens.focus_distance, start, end))  # type: ignore[assignment]
    lengths = float(near) / 1000.0, float(long) / 1000.0
    view = transforms.look_at(position, aim)
    return Pose(start, position, shift, view, turn, lengths, number, focus)


def _keys(keyed: Keyed, end: float) -> Array:
    """Keys up to a moment, those of a loop again and again; LONGEST + 1 at most."""
    if not keyed.loop or len(keyed.times) < 2:
        return keyed.times
    period = float(keyed.times[-1] - keyed.times[0])
    first = np.floor(-keyed.times[0] / period)
    turns = first + np.arange(min(np.ceil(end / period) + 2.0, LONGEST + 1.0))
    return np.asarray((keyed.times + turns[:, None] * period).ravel())


def mesh_balls(
    scene: Scene, reports: Mapping[str, Mapping[str, Any]], unknown: float
) -> Iterator[tuple[str, Array, float]]:
    """Yield (name, middle (3,), radius) of balls that hold each mesh at every moment.

    unknown : metres from the origin at scale 1 of a mesh that no report measures.
    """
    for mesh in scene.meshes:
        report = reports.get(f"{KINDS[mesh.lighting]}/{mesh.name}", {})
        low, high = mesh.position.extremes
        corners = np.abs(report.get("bounds", [[unknown, 0.0, 0.0]])).max(axis=0)
        reach = mesh.scale * float(np.linalg.norm(corners))
        yield mesh.name, 0.5 * (low + high), reach + 0.5 * float(np.linalg.norm(high - low))


def cube_ball(
    scene: Scene, reports: Mapping[str, Mapping[str, Any]], unknown: float
) -> Iterator[tuple[Array, float]]:
    """Yield (middle (3,), radius) of the ball that holds the world of cubes, where one is drawn.

    unknown : metres from the middle of its underside where no report measures it.
    """
    world = scene.voxels
    if world is None or scene.force.get("voxels") is False:
        return
    layout = reports.get("voxels/world", {}).get("layout")
    base = np.asarray(world.position, np.float64)
    if layout is None:
        yield base, unknown
        return
    half = 0.5 * layout["cell_size"] * np.asarray(layout["size"], np.float64)
    yield base + np.array([0.0, half[1], 0.0]), float(np.linalg.norm(half))
