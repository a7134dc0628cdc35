"""A plinth of dark stone, and a wall to stand before: flat faces with bevelled edges."""

from itertools import pairwise

import numpy as np
from clay import Array, Clay, unit

STONE = np.array([0.115, 0.110, 0.105])
DRUM = np.array([0.050, 0.046, 0.042])
PLASTER = np.array([0.37, 0.352, 0.335])
BEVEL = 0.006


def square(half: float) -> Array:
    """A square (8, 2) with bevelled corners, x and z, counter-clockwise from above."""
    a, b = half, half - BEVEL
    turn = [(a, b), (a, -b), (b, -a), (-b, -a), (-a, -b), (-a, b), (-b, a), (b, a)]
    return np.array(turn)


def circle(radius: float, sides: int = 48) -> Array:
    """A circle (sides, 2), counter-clockwise from above."""
    t = -np.arange(sides) * (2 * np.pi / sides)
    return radius * np.stack([np.cos(t), np.sin(t)], axis=1)


def stack(clay: Clay, rings: list[tuple[Array, float]], colour: Array, smooth: bool) -> None:
    """Close rings (n, 2) of rising heights to a solid. smooth : round about, else flat faces."""
    solid = [np.insert(ring, 1, height, axis=1) for ring, height in rings]
    n = len(solid[0])
    for low, high in pairwise(solid):
        for i in range(n):
            j = (i + 1) % n
            quad = np.stack([low[i], low[j], high[j], high[i]])
            normal = np.cross(quad[1] - quad[0], quad[3] - quad[0])
            if np.linalg.norm(normal) < 1e-12:
                normal = np.cross(quad[2] - quad[1], quad[3] - quad[1])
            normals = np.broadcast_to(unit(normal), (4, 3))
            if smooth:
                out = unit(quad * [1.0, 0.0, 1.0])
                slope = np.hypot(normals[0, 0], normals[0, 2])
                normals = out * [slope, 0, slope] + [0.0, normals[0, 1], 0.0]
            clay.press("stone", quad, normals, colour, np.array([[0, 1, 2], [0, 2, 3]]))
    for ring, y in ((solid[0], -1.0), (solid[-1], 1.0)):
        k = np.arange(1, n - 1)
        fan = np.stack([np.zeros_like(k), k, k + 1] if y > 0 else [np.zeros_like(k), k + 1, k], 1)
        clay.press("stone", ring, np.broadcast_to([0.0, y, 0.0], ring.shape), colour, fan)


def plinth() -> Clay:
    """A square plinth 0.62 m high with a foot and a cap, and on it a low drum, top at 0.65 m."""
    clay = Clay()
    # Half-width and height of each ring, from the floor upwards
    line = [
        (0.210, 0.0),
        (0.210, 0.064),
        (0.204, 0.070),
        (0.168, 0.070),
        (0.160, 0.570),
        (0.182, 0.580),
        (0.186, 0.586),
        (0.186, 0.614),
        (0.180, 0.620),
    ]
    stack(clay, [(square(w), y) for w, y in line], STONE, smooth=False)
    drum = [(0.134, 0.620), (0.134, 0.646), (0.130, 0.650)]
    stack(clay, [(circle(r), y) for r, y in drum], DRUM, smooth=True)
    return clay


def wall() -> Clay:
    """A wall 12 m wide and 5 m high whose face lies at z = 0, with a skirting board."""
    clay = Clay()
    rings = []
    for deep, y in ((0.02, 0.0), (0.02, 0.12), (0.0, 0.14), (0.0, 5.0)):
        box = [[6.0, deep], [6.0, -0.2], [-6.0, -0.2], [-6.0, deep]]
        rings.append((np.array(box), y))
    stack(clay, rings, PLASTER, smooth=False)
    return clay
