"""Cameras, rotations and the lat-long map. Matrices are target_from_source and multiply columns.

Right-handed, +y up, a camera looks along -z; metres and radians.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

AXES = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}


def normalise(vectors: ArrayLike) -> NDArray[np.float64]:
    """Scale vectors to unit length; any finite non-zero length works, 1e-300 as well as 1e300.

    vectors : (..., 3). Returns (..., 3). Raises ValueError for zero, NaN or infinite vectors.

    >>> normalise([0.0, 3e-200, 4e-200]).round(12).tolist()
    [0.0, 0.6, 0.8]
    """
    v = np.asarray(vectors, np.float64)
    largest = np.max(np.abs(v), axis=-1, keepdims=True)
    # Written so that a NaN fails it too
    if not np.all((largest > 0) & np.isfinite(largest)):
        raise ValueError("A direction is a finite vector that is not zero.")
    v = v / largest
    return np.asarray(v / np.sqrt(np.sum(v * v, axis=-1, keepdims=True)))


def unit_directions(directions: ArrayLike) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """`normalise`, and a warning where lengths say that the vectors may not be directions at all.

    directions : (..., 3). Returns (..., 3) unit, and warnings: one where a length is outside [0.5,
    2] (positions? degrees?), else none. Raises ValueError as `normalise`.

    >>> unit_directions([[0.0, 30.0, 40.0]])[1]
    ('lengths of directions from 50 to 50, not 1: scaled to unit length',)
    """
    unit = normalise(directions)
    lengths = np.sum(unit * np.asarray(directions, np.float64), axis=-1)
    if lengths.size == 0 or (lengths.min() >= 0.5 and lengths.max() <= 2.0):
        return unit, ()
    span = f"from {lengths.min():.3g} to {lengths.max():.3g}"
    return unit, (f"lengths of directions {span}, not 1: scaled to unit length",)


def look_at(
    position: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)
) -> NDArray[np.float64]:
    """view_from_world of a camera at `position` that looks at `target`.

    position, target, up : (3,) world, metres. Where the view is along `up`, the picture's top is -z
    (looking down) or +z (looking up). Returns (4, 4). Raises ValueError where both points coincide.

    >>> (look_at([1, 2, 3], [1, 2, 0]) @ [1, 2, 0, 1]).tolist()
    [0.0, 0.0, -3.0, 1.0]
    """
    eye = np.asarray(position, np.float64)
    offset = np.asarray(target, np.float64) - eye
    if not np.any(offset):
        raise ValueError("A camera looks at a point other than its own position.")
    back = -normalise(offset)
    side = np.cross(normalise(up), back)
    # 1e-6 rad: nearer to `up` than that, the side vector is rounding error of float32 scene data
    if np.linalg.norm(side) < 1e-6:
        side = np.cross([0.0, 0.0, -1.0] if back[1] > 0 else [0.0, 0.0, 1.0], back)
    right = normalise(side)
    view_from_world = np.eye(4)
    view_from_world[:3, :3] = np.stack([right, np.cross(back, right), back])
    view_from_world[:3, 3] = -view_from_world[:3, :3] @ eye
    return view_from_world


def perspective(
    focal_length: float, sensor_height: float, aspect: float, near: float, far: float
) -> NDArray[np.float64]:
    """clip_from_view of a pinhole, depth -1 at `near` to 1 at `far` (OpenGL).

    focal_length, sensor_height : in one unit.  aspect : width / height.  near, far : metres,
    0 < near < far <= infinity. Returns (4, 4). Raises ValueError for lengths that are none.

    >>> p = perspective(0.05, 0.024, 1.0, 1.0, np.inf) @ [0.0, 0.24, -1.0, 1.0]
    >>> (p[:3] / p[3]).round(12).tolist()
    [0.0, 1.0, -1.0]
    """
    if not (focal_length > 0 and sensor_height > 0 and aspect > 0 and 0 < near < far):
        raise ValueError("A perspective needs lengths above 0 and a near plane before the far one.")
    scale = 2.0 * focal_length / sensor_height
    ratio = near / far
    clip_from_view = np.zeros((4, 4))
    clip_from_view[0, 0], clip_from_view[1, 1] = scale / aspect, scale
    clip_from_view[2, 2] = -(1.0 + ratio) / (1.0 - ratio)
    clip_from_view[2, 3] = -2.0 * near / (1.0 - ratio)
    clip_from_view[3, 2] = -1.0
    return clip_from_view


def orthographic(width: float, height: float, near: float, far: float) -> NDArray[np.float64]:
    """clip_from_view of a parallel projection of a box around the view axis, metres.

    near, far : metres along -z, near < far. Returns (4, 4). Raises ValueError for an empty box.
    """
    if not (width > 0 and height > 0 and near < far):
        raise ValueError("A parallel projection needs a box that is not empty.")
    depth = far - near
    clip_from_view = np.diag([2.0 / width, 2.0 / height, -2.0 / depth, 1.0])
    clip_from_view[2, 3] = -(far + near) / depth
    return clip_from_view


def vector_area(corners: ArrayLike) -> NDArray[np.float64]:
    """Area (3,) of a flat polygon (k, 3), towards where it turns counter-clockwise (Newell's sum).

    >>> vector_area([[0, 0, 0], [1, 0, 0], [1, 1, 0]]).tolist()
    [0.0, 0.0, 0.5]
    """
    outline = np.asarray(corners, np.float64)
    outline = outline - outline.mean(axis=0)
    return np.asarray(0.5 * np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0))


def rotation(axis: str, angle: float) -> NDArray[np.float64]:
    """Rotation by `angle` radians about "x", "y" or "z", right-handed: `target_from_source` (3, 3).

    About +y it turns +z towards +x.

    >>> (rotation("y", np.pi / 2) @ [0, 0, 1]).round(12).tolist()
    [1.0, 0.0, 0.0]
    """
    if axis not in AXES:
        raise ValueError("An axis of rotation is x, y or z.")
    i, j = AXES[axis]
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(3)
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def euler(angles: ArrayLike) -> NDArray[np.float64]:
    """Rotation about x, then y, then z, all fixed axes: `Rz Ry Rx`.

    angles : (3,) radians. Returns (3, 3).
    """
    x, y, z = np.asarray(angles, np.float64)
    return np.asarray(rotation("z", z) @ rotation("y", y) @ rotation("x", x))


def affine(
    linear: ArrayLike | None = None,
    translation: ArrayLike = (0.0, 0.0, 0.0),
    scale: ArrayLike = 1.0,
) -> NDArray[np.float64]:
    """Matrix (4, 4) that scales, then applies `linear` (3, 3), then translates (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if linear is None else np.asarray(linear)) * np.asarray(scale)
    matrix[:3, 3] = translation
    return matrix


def latlong_direction(uv: ArrayLike) -> NDArray[np.float64]:
    """Direction that a lat-long map shows at uv: its centre is -z, u grows to +x, v = 0 is +y.

    uv : (..., 2), u in [0, 1] over the width, v in [0, 1] from the top. Returns (..., 3) unit.

    >>> latlong_direction([[0.5, 0.5], [0.75, 0.5], [0.1, 0.0]]).round(12).tolist()
    [[0.0, 0.0, -1.0], [1.0, 0.0, -0.0], [-0.0, 1.0, 0.0]]
    """
    uv = np.asarray(uv, np.float64)
    phi, theta = 2.0 * np.pi * (uv[..., 0] - 0.5), np.pi * uv[..., 1]
    ring = np.sin(theta)
    return np.stack([ring * np.sin(phi), np.cos(theta), -ring * np.cos(phi)], axis=-1)


def latlong_uv(directions: ArrayLike) -> NDArray[np.float64]:
    """Inverse of `latlong_direction`; u = 0.5 at the poles.

    directions : (..., 3), any non-zero length. Returns (..., 2), u in [0, 1], v in [0, 1].
    """
    x, y, z = np.moveaxis(normalise(directions), -1, 0)
    # + 0.0 turns a negative zero into zero, so that a pole has one longitude
    u = 0.5 + np.arctan2(x + 0.0, np.where((x == 0) & (z == 0), 1.0, -z)) / (2.0 * np.pi)
    return np.stack([u, np.arctan2(np.hypot(x, z), y) / np.pi], axis=-1)


def latlong_solid_angles(height: int, width: int) -> NDArray[np.float64]:
    """Exact solid angle of a texel of each row of a lat-long map; the map sums to 4 pi.

    Returns (height,) steradians. Raises ValueError for an empty map.

    >>> round(float(8 * latlong_solid_angles(4, 8).sum() / np.pi), 12)
    4.0
    """
    if height < 1 or width < 1:
        raise ValueError("A lat-long map has one texel or more.")
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return np.asarray((edges[:-1] - edges[1:]) * (2.0 * np.pi / width))
