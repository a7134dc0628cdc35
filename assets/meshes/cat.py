"""A cat that sits upright, half-way between a bronze of Bastet and an animal by Pompon: few masses,
drawn by their curves in profile, and a tail that hangs down from what it sits on."""

import numpy as np
from bust import Drawn, carve, ellipsoid, gradient, polygonise, relax, stepped, union
from clay import Array, Clay, unit
from leaves import blend
from stonework import boulder
from wood import Limb, bark

FUR = np.array([0.62, 0.585, 0.53])
DARK = np.array([0.15, 0.125, 0.115])
RED = np.array([0.52, 0.030, 0.018])
BRASS = np.array([0.62, 0.36, 0.09])
SCALE = 0.0125  # metres a centimetre drawn: a quarter larger than life
SEAT = 22.0  # centimetres from the lowest point of the tail to what it sits on

HEAD = 0.55  # turn of the head about the neck, radians: to its right
NAPE, LARGER = np.array([0.0, 36.0, 4.0]), 1.13  # the head is drawn smaller than it is

# The trunk, by height over the seat: where its back and its front run, and half its width
BACK = Drawn(
    (
        (0.0, -14.6),
        (4.0, -16.2),
        (10.0, -15.2),
        (18.0, -9.8),
        (26.0, -3.4),
        (32.0, 0.4),
        (38.0, 1.4),
    )
)
FRONT = Drawn(
    ((0.0, 5.0), (6.0, 5.4), (14.0, 8.8), (21.0, 11.2), (26.0, 11.0), (32.0, 9.4), (38.0, 9.8))
)
WIDTH = Drawn(
    ((0.0, 8.6), (5.0, 9.0), (11.0, 7.9), (18.0, 6.3), (25.0, 5.7), (32.0, 4.1), (38.0, 4.0))
)
# The tail: forward, height, to its right, radius
TAIL = np.array(
    [
        (-11.0, 3.4, 0.0, 2.4),
        (-16.4, 2.6, 2.0, 2.2),
        (-18.0, 2.1, 6.4, 2.0),
        (-16.4, 0.6, 10.6, 1.9),
        (-14.4, -4.0, 12.6, 1.8),
        (-13.6, -10.0, 12.6, 1.75),
        (-13.4, -15.4, 12.6, 1.7),
        (-10.8, -19.4, 12.6, 1.6),
        (-6.8, -19.4, 12.6, 1.45),
        (-5.2, -16.0, 12.6, 1.2),
    ]
)


def folded(p: Array) -> Array:
    """Both sides as the right one; the fold is rounded so that nothing creases."""
    return np.stack([np.sqrt(p[..., 0] ** 2 + 0.04), p[..., 1], p[..., 2]], axis=-1)


def rod(p: Array, a: Array, b: Array, r: float, s: float) -> Array:
    """Near distance to a cone from a to b with round ends of radii r and s."""
    along = b - a
    t = np.clip((p - a) @ along / (along @ along), 0.0, 1.0)
    return np.asarray(np.linalg.norm(p - a - t[..., None] * along, axis=-1) - (r + (s - r) * t))


def trunk(p: Array) -> Array:
    """The body from haunches to neck, an ellipse at each height."""
    y = p[..., 1]
    back, front = BACK(y), FRONT(y)
    deep, middle = (front - back) / 2, (front + back) / 2
    x, z = p[..., 0] / WIDTH(y), (p[..., 2] - middle) / deep
    length = np.sqrt(x * x + z * z + 1e-12)
    slope = np.hypot(x / WIDTH(y), z / deep) / length
    level = (length - 1.0) / np.maximum(slope, 1e-6) * 0.8
    return np.maximum(-union(-level, 38.5 - y, 4.0), 0.3 - y)


def legs(p: Array, q: Array) -> Array:
    """Straight fore legs, the haunches folded beside them, and four paws."""
    fore = rod(q, np.array([3.0, 20.0, 7.6]), np.array([2.5, 2.6, 10.2]), 2.9, 1.75)
    paw = ellipsoid(q, np.array([2.6, 1.6, 11.6]), np.array([2.2, 1.7, 3.1]))
    fore = union(fore, paw, 1.2)
    thigh = ellipsoid(q, np.array([6.4, 8.2, -3.6]), np.array([3.7, 8.0, 8.6]))
    foot = ellipsoid(q, np.array([7.0, 1.5, 5.2]), np.array([2.2, 1.6, 5.2]))
    return union(fore, union(thigh, foot, 1.6), 0.5)


def head(p: Array, q: Array) -> Array:
    """Skull, cheeks, muzzle and ears; a face of few cuts."""
    skull = ellipsoid(q, np.array([0.0, 40.6, 6.6]), np.array([5.3, 4.9, 5.9]))
    cheek = ellipsoid(q, np.array([2.9, 38.8, 7.8]), np.array([3.1, 2.7, 3.5]))
    muzzle = ellipsoid(q, np.array([0.7, 38.2, 11.6]), np.array([2.2, 1.8, 2.6]))
    nose = rod(q, np.array([0.0, 42.2, 10.8]), np.array([0.0, 39.2, 13.6]), 1.3, 0.75)
    found = union(union(skull, cheek, 2.2), union(muzzle, nose, 1.0), 1.4)
    socket = ellipsoid(q, np.array([3.3, 41.0, 12.2]), np.array([1.9, 1.3, 1.6]))
    found = carve(found, socket, 0.5)
    eye = ellipsoid(q, np.array([2.9, 41.0, 10.5]), np.array([1.5, 1.15, 1.0]))
    found = union(found, eye, 0.2)
    return union(found, ear(q), 1.1)


def ear(q: Array) -> Array:
    """A tall shell, wide at its foot, hollow towards the front and the side."""
    foot, tip = np.array([3.3, 42.6, 4.6]), np.array([5.0, 51.6, 3.4])
    along = tip - foot
    t = np.clip((q - foot) @ along / (along @ along), 0.0, 1.0)
    d = q - foot - t[..., None] * along
    turn = 0.6
    wide = d[..., 0] * np.cos(turn) - d[..., 2] * np.sin(turn)
    thick = d[..., 0] * np.sin(turn) + d[..., 2] * np.cos(turn)
    half = 3.1 * (1.0 - t) ** 0.8 + 0.30
    shell = np.hypot(np.hypot(wide, d[..., 1] * 0.6), thick * (0.45 + 0.9 * (1 - t)) * 1.9) - half
    hollow = ellipsoid(q, foot + 0.42 * along + [0.9, 0.0, 1.9], np.array([1.9, 4.6, 1.5]))
    return carve(shell * 0.7, hollow, 0.4)


def _spline(points: Array, each: int = 5) -> Array:
    """Catmull and Rom's curve through points (n, k)."""
    p = np.concatenate([points[:1], points, points[-1:]])
    s = (np.arange(each) / each)[:, None]
    a, b, c, d = (p[k : len(p) - 3 + k][:, None] for k in range(4))
    line = b + s / 2 * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)))
    return np.asarray(line.reshape(-1, points.shape[1]))


def turned(p: Array, angle: float) -> Array:
    """Points turned about the neck by `angle` radians, to the cat's left as it is seen."""
    c, s = np.cos(angle), np.sin(angle)
    x, z = p[..., 0], p[..., 2] - 4.0
    return np.stack([c * x + s * z, p[..., 1], c * z - s * x + 4.0], axis=-1)


def cat(p: Array) -> Array:
    """Near distance in centimetres of points (..., 3) over the seat."""
    q = folded(p)
    body = union(trunk(q), legs(p, q), 1.5)
    h = (turned(p, HEAD) - NAPE) / LARGER + NAPE
    found = union(body, head(h, folded(h)) * LARGER, 3.2)
    band = (
        np.hypot(
            np.hypot(p[..., 0], p[..., 2] - 5.3) - 5.0,
            (p[..., 1] - 33.4 - 0.12 * (p[..., 2] - 5.3)) * 0.8,
        )
        - 0.75
    )
    found = union(found, band, 0.3)
    bell = np.linalg.norm(p - [0.0, 32.4, 11.2], axis=-1) - 1.25
    return union(found, bell, 0.2)


def colours(p: Array) -> Array:
    """Albedo (n, 3): pale fur, darker towards tail, ears and paws, a red collar, a bell."""
    y, z = p[:, 1], p[:, 2]
    dark = np.clip((y - 46.5) / 4.0, 0, 1)
    dark = np.maximum(dark, np.clip((-2.0 - y) / 12.0, 0, 1))
    found = blend(FUR, DARK, 0.75 * dark)
    height = 33.4 + 0.12 * (z - 5.3)
    collar = (np.abs(y - height) < 1.0) & (np.hypot(p[:, 0], z - 5.3) > 4.6)
    found = np.where(collar[:, None], RED, found)
    bell = np.linalg.norm(p - [0.0, 32.4, 11.2], axis=1) < 1.45
    return np.where(bell[:, None], BRASS, found)


def tail(clay: Clay) -> None:
    """A tail that leaves over the edge on the right, hangs, and curls up at its end."""
    points = np.concatenate([_spline(TAIL), TAIL[-1:]])
    path = np.stack([-points[:, 2], points[:, 1], points[:, 0]], axis=-1)
    radius = points[:, 3]
    # Its end is round
    ends = np.sqrt(1.0 - np.array([0.35, 0.7, 0.9, 0.999]) ** 2) * radius[-1]
    onward = unit(path[-1] - path[-2]) * radius[-1]
    path = np.concatenate([path, path[-1] + onward * np.array([[0.35], [0.7], [0.9], [1.0]])])
    radius = np.concatenate([radius, ends])
    dark = np.clip((-1.0 - path[:, 1:2]) / 12.0, 0.0, 1.0)[:, 0]
    tone = blend(FUR, DARK, 0.8 * dark)
    bark(clay, Limb(_set_down(path), radius * SCALE), tone, sides=12, part="fur")


def face(clay: Clay) -> None:
    """Closed eyes, each a thin dark line, and a nose."""
    t = np.linspace(-1.0, 1.0, 11)
    for side in (-1.0, 1.0):
        turn, rise = (
            np.radians(34.0 + 19.0 * t) * side,
            np.radians(5.0 - 9.0 * (1.0 - t * t) + 3.0 * t),
        )
        out = np.stack([np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)], -1)
        line = on_surface(np.array([0.0, 40.4, 7.0]) + 6.0 * out)
        width = (0.10 + 0.28 * np.sqrt(1.0 - 0.98 * t * t)) * SCALE
        bark(clay, Limb(_set_down(line), width), DARK * 0.5, sides=6, part="fur")
    p, faces = boulder(1)
    tip = on_surface(np.array([[0.0, 39.3, 14.6]]))
    clay.press("fur", _set_down(tip + p * [0.85, 0.55, 0.6]), p, DARK * 0.6, faces)


def on_surface(head_points: Array) -> Array:
    """Points (n, 3) of the head as drawn, taken to where it is and onto the surface."""
    p = turned((head_points - NAPE) * LARGER + NAPE, -HEAD)
    for _ in range(8):
        p = p - gradient(p, shape=cat) * cat(p)[:, None] * 0.8
    return p


def _set_down(p: Array) -> Array:
    """Centimetres over the seat as metres over the lowest point."""
    return np.asarray((p + np.array([0.0, SEAT, 0.0])) * SCALE)


def sitting_cat() -> Clay:
    """A cat 0.65 m high from seat to ears that looks along +z; its seat lies at SEAT * SCALE."""
    side = stepped((-11.6, 1.4, -7.6), (-7.6, 1.05, 7.4), (7.4, 1.4, 11.6))
    heights = stepped((-1.0, 0.7, 1.0), (1.0, 1.95, 30.5), (30.5, 0.85, 57.0))
    depths = stepped((-19.0, 1.8, -3.0), (-3.0, 1.05, 18.0))
    p, faces = polygonise([side, heights, depths], cat)
    p = relax(p, faces, shape=cat)
    clay = Clay()
    clay.press("fur", _set_down(p), gradient(p, 0.35, cat), colours(p), faces)
    tail(clay)
    face(clay)
    return clay
