"""A marble head, half-way between an idol and an egg; see plinth.py for what it stands on."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from clay import Array, Clay, unit
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from skimage.measure import marching_cubes

Indices = NDArray[np.int64]
Shape = Callable[[Array], Array]  # near distance in centimetres of points (..., 3)
MARBLE = np.array([0.69, 0.665, 0.62])
SCALE = 0.015  # metres a centimetre drawn: half as large again as life
TILT = np.radians(7.0)  # of the head, chin forward
PIVOT = np.array([0.0, 20.0, -1.0])  # about which it tilts
BLUNT = 0.45  # centimetres over which normals are taken: edges shine, and do not break
LOBES = 17  # of the hair, around the whole head


@dataclass(frozen=True)
class Drawn:
    """A curve through knots (height, value), constant beyond its ends."""

    knots: tuple[tuple[float, float], ...]

    def __call__(self, at: Array) -> Array:
        x, y = np.array(self.knots).T
        return np.asarray(CubicSpline(x, y, bc_type="clamped")(np.clip(at, x[0], x[-1])))


# The head, by height from the chin (-1) to the crown (1): factors on an egg's three radii
WIDTH = Drawn(((-1.0, 0.72), (-0.55, 0.84), (0.0, 0.97), (0.5, 1.05), (1.0, 1.0)))
FRONT = Drawn(((-1.0, 1.25), (-0.55, 1.16), (0.0, 1.0), (0.5, 0.93), (1.0, 0.9)))
BACK = Drawn(((-1.0, 0.45), (-0.5, 0.62), (0.0, 0.95), (0.4, 1.12), (1.0, 1.0)))
# The neck, by height: radius, and where its axis lies
NECK = Drawn(((0.0, 7.6), (5.0, 6.5), (12.0, 5.1), (19.0, 4.7), (26.0, 5.0)))
NAPE = Drawn(((0.0, -3.4), (8.0, -3.2), (20.0, -1.8), (26.0, -1.6)))
HAIRLINE = Drawn(((18.0, -7.0), (24.0, -5.6), (30.0, -1.6), (35.0, 2.6), (39.5, 7.4), (46.0, 10.0)))


def union(a: Array, b: Array, k: float) -> Array:
    """Smooth minimum of two distances, its fillet k wide."""
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * h * k / 6.0


def carve(a: Array, b: Array, k: float) -> Array:
    """Take b out of a, the edge rounded."""
    return -union(-a, b, k)


def ellipsoid(p: Array, centre: Array, radii: Array) -> Array:
    """Near distance of points (..., 3) to an ellipsoid; radii (3,) or (..., 3)."""
    q = (p - centre) / radii
    length = np.linalg.norm(q, axis=-1)
    slope = np.linalg.norm(q / radii, axis=-1)
    return np.asarray(length * (length - 1.0) / np.maximum(slope, 1e-9))


def egg(p: Array, grown: float = 0.0) -> Array:
    """The head without features, from 16 to 46 cm. grown : centimetres added all round."""
    v = (p[..., 1] - 31.0) / 15.0
    front = p[..., 2] > -1.0
    deep = np.where(front, 9.6 * FRONT(v), 12.2 * BACK(v))
    radii = np.stack([9.0 * WIDTH(v), np.full_like(v, 15.0), deep], axis=-1) + grown
    return ellipsoid(p, np.array([0.0, 31.0, -1.0]), radii)


def mirrored(p: Array) -> Array:
    """Both sides as the right one; the fold is rounded so that nothing creases."""
    return np.stack([np.sqrt(p[..., 0] ** 2 + 0.04), p[..., 1], p[..., 2]], axis=-1)


def face(p: Array, head: Array) -> Array:
    """Cut sockets under the brow, and set chin, nose, eyes and mouth."""
    q = mirrored(p)
    x, y, z = q[..., 0], q[..., 1], q[..., 2]
    chin = ellipsoid(q, np.array([0.0, 18.4, 4.2]), np.array([4.0, 2.7, 3.7]))
    head = union(head, chin, 3.6)
    socket = ellipsoid(q, np.array([4.2, 28.9, 10.0]), np.array([4.3, 3.9, 3.9]))
    head = carve(head, socket, 0.8)
    # Eyes: lids that meet in a ridge, pointed at both ends
    lids = [
        ellipsoid(q, np.array([3.9, 28.8 + s, 4.4]), np.array([3.2, 2.9, 3.3])) for s in (-1, 1)
    ]
    head = union(head, -union(-lids[0], -lids[1], 0.4), 0.5)
    # Nose: a wedge whose ridge runs on from the forehead
    s = (33.5 - y) / 10.0
    ridge = 8.3 + 3.1 * np.clip(s, -0.4, 1.2)
    behind = ridge - z
    side = (x - 0.5 - 0.3 * s - behind * (0.26 + 0.22 * s)) * 0.9
    ends = np.maximum((23.4 - 0.12 * behind) - y, y - 36.0)
    deep = np.maximum(np.maximum(-behind, behind - 4.5), ends)
    head = union(head, -union(-side, -deep, 1.1), 0.9)
    # Mouth: two small lips and the line between them
    raised = q - np.stack([0 * x, 0.03 * x * x, 0 * x], axis=-1)
    for height, out in ((21.0, 6.15), (19.65, 6.0)):
        lip = ellipsoid(raised, np.array([0.0, height, out]), np.array([2.6, 0.85, 2.3]))
        head = union(head, lip, 0.7)
    return head


def hair(p: Array, head: Array) -> Array:
    """A cap of lobes that run from the forehead to a knot at the nape."""
    q = mirrored(p)
    y, z = q[..., 1], q[..., 2]
    # Lobes are meridians about an axis from before the forehead to the knot
    front, knot = np.array([0.0, 35.0, 12.0]), np.array([0.0, 28.5, -14.5])
    axis = unit(knot - front)
    upward = np.array([0.0, -axis[2], axis[1]])
    aside, above = p[..., 0], (p - knot) @ upward
    fade = np.clip(np.hypot(aside, above) / 4.0, 0.0, 1.0)
    turn = np.arctan2(aside, above)
    lobes = fade * np.sqrt(np.cos(turn * LOBES / 2) ** 2 + 0.02)
    cap = egg(p, 0.75) - 0.65 * lobes
    # The hairline: a sheet that leans back from the forehead to the nape
    cut = (z - HAIRLINE(y)) * 0.85
    low = (22.5 - 0.35 * (z + 8.0)) - y
    cap = -union(-cap, union(-cut, -low, 5.0), 1.1)
    bun = ellipsoid(p, knot, np.array([4.6, 4.3, 4.0]))
    bun = bun - 0.35 * fade * np.sqrt(np.cos(turn * 4.5) ** 2 + 0.02)
    return union(union(head, cap, 0.8), bun, 0.6)


def sculpture(p: Array) -> Array:
    """Near distance in centimetres of points (..., 3) to the whole head."""
    c, s = np.cos(TILT), np.sin(TILT)
    q = p - PIVOT
    q = np.stack([q[..., 0], c * q[..., 1] + s * q[..., 2], c * q[..., 2] - s * q[..., 1]], -1)
    q = q + PIVOT
    neck = np.hypot(p[..., 0], (p[..., 2] - NAPE(p[..., 1])) / 1.08) - NECK(p[..., 1])
    neck = np.maximum(neck, p[..., 1] - 26.0)
    head = egg(q)
    head = face(q, union(head, neck, 2.2))
    return hair(q, head)


def gradient(p: Array, step: float = 0.02, shape: Shape = sculpture) -> Array:
    """Unit normals (n, 3) of the sculpture, from differences over `step` centimetres."""
    steps = np.eye(3) * step
    return unit(np.stack([shape(p + e) - shape(p - e) for e in steps], axis=-1))


def stepped(*spans: tuple[float, float, float]) -> Array:
    """Coordinates over spans of (start, step, end), centimetres."""
    return np.concatenate([np.arange(start, end - 0.1, step) for start, step, end in spans])


def polygonise(axes: list[Array], shape: Shape = sculpture) -> tuple[Array, Indices]:
    """Triangles of the sculpture over a grid of uneven steps, open at the lowest height."""
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    p, faces, _, _ = marching_cubes(shape(grid).astype(np.float32), 0.0)
    p = np.stack([np.interp(p[:, k], np.arange(len(a)), a) for k, a in enumerate(axes)], axis=1)
    return p.astype(np.float64), faces.astype(np.int64)


def relax(p: Array, faces: Indices, rounds: int = 6, shape: Shape = sculpture) -> Array:
    """Even out triangles along the surface and lay their corners onto it; the rim stays level."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    count = np.bincount(edges.ravel(), minlength=len(p))[:, None]
    rim = p[:, 1] < 1e-6
    for _ in range(rounds):
        total = np.zeros_like(p)
        np.add.at(total, edges[:, 0], p[edges[:, 1]])
        np.add.at(total, edges[:, 1], p[edges[:, 0]])
        step = 0.5 * (total / count - p)
        n = gradient(p, shape=shape)
        step -= n * np.sum(step * n, axis=1, keepdims=True)
        p = p + np.where(rim[:, None], 0.0, step)
        for _ in range(2):
            n = gradient(p, shape=shape)
            p = p - n * np.clip(shape(p), -0.3, 0.3)[:, None] * ~rim[:, None]
    return p


def rim_of(p: Array) -> Indices:
    """Corners of the open rim at the lowest height, in the order of their turn about +y."""
    rim = np.flatnonzero(p[:, 1] < 1e-6)
    middle = p[rim].mean(axis=0)
    return rim[np.argsort(np.arctan2(p[rim, 2] - middle[2], p[rim, 0] - middle[0]))]


def bust() -> Clay:
    """A head and neck 0.71 m high that look along +z, cut level; the neck is centred at 0."""
    side = stepped((0.0, 0.5, 3.0), (3.0, 0.8, 12.3))
    heights = stepped(
        (0.0, 2.0, 16.0),
        (16.0, 0.6, 18.4),
        (18.4, 0.42, 24.0),
        (24.0, 0.64, 30.0),
        (30.0, 0.84, 50.0),
    )
    depths = stepped((-20.5, 0.9, 1.0), (1.0, 0.64, 15.5))
    p, faces = polygonise([np.concatenate([-side[:0:-1], side]), heights, depths])
    p = relax(p, faces)
    clay, placed = Clay(), (p - [0.0, 0.0, NAPE(np.zeros(1))[0]]) * SCALE
    clay.press("marble", placed, gradient(p, BLUNT), MARBLE, faces)
    rim = rim_of(p)
    foot = np.concatenate([placed[rim], [[0.0, 0.0, 0.0]]])
    around = np.arange(len(rim))
    fan = np.stack([around, np.full_like(around, len(rim)), np.roll(around, 1)], axis=1)
    clay.press("marble", foot, np.broadcast_to([0.0, -1.0, 0.0], foot.shape), MARBLE, fan)
    return clay
