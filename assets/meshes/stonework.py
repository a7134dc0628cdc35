"""Stonework: a standing lantern with paper panes, mossy stones, and mushrooms turned like pots."""

from itertools import pairwise

import numpy as np
from chance import Chance
from clay import Array, Clay, unit
from leaves import GOLDEN_ANGLE, blend, varied
from numpy.typing import NDArray

UP = np.array([0.0, 1.0, 0.0])
GRANITE = np.array([0.235, 0.225, 0.215])
MOSS = np.array([0.085, 0.115, 0.030])
PAPER = np.array([0.930, 0.880, 0.780])
CAP = np.array([0.300, 0.085, 0.030])
CREAM = np.array([0.700, 0.620, 0.480])


def hexagon(turn: Array) -> Array:
    """Radius of a hexagon with corners at distance one, flats towards +z and -z."""
    sector = (turn % (np.pi / 3)) - np.pi / 6
    radius: Array = np.cos(np.pi / 6) / np.cos(sector)
    return radius


def turned(
    clay: Clay,
    profile: Array,
    colour: Array,
    *,
    sides: int = 36,
    shape: float = 0.0,
    lift: float = 0.0,
    chance: Chance | None = None,
    part: str = "stone",
) -> None:
    """Press a solid of revolution: profile (n, 2) of radius and height from the foot upwards.

    shape : 0 round .. 1 hexagonal. lift : how far the corners of wide rings curl up, in metres.
    Each ring of the profile is a strip of its own, so that edges stay crisp."""
    turn = np.arange(sides + 1) * (2 * np.pi / sides)
    round_ = 1.0 + shape * (hexagon(turn) - 1.0)
    corner = ((hexagon(turn) - np.cos(np.pi / 6)) / (1 - np.cos(np.pi / 6))) ** 2
    widest = profile[:, 0].max()
    for low, high in pairwise(profile):
        rings = []
        for r, y in (low, high):
            curl = lift * corner * (r / widest) ** 3
            rings.append(
                np.stack([r * round_ * np.cos(turn), y + curl, r * round_ * np.sin(turn)], axis=-1)
            )
        grid = np.array(rings)
        around = np.gradient(grid, axis=1)
        around[:, [0, -1]] = (around[:, [0]] + around[:, [-1]]) / 2
        normals = unit(np.cross(np.broadcast_to(grid[1] - grid[0], grid.shape), around))
        tone = np.broadcast_to(colour, (2 * (sides + 1), 3))
        if chance is not None:
            tone = varied(chance, colour, 2 * (sides + 1), 3.0, 0.10)
            moss = np.clip(
                normals.reshape(-1, 3)[:, 1] * 0.9 - 0.35 + 0.2 * chance.normal(len(tone)), 0, 0.75
            )
            tone = blend(tone, MOSS, moss)
        j = np.arange(sides)
        quads = np.concatenate(
            [np.stack([j, j + sides + 1, j + sides + 2], 1), np.stack([j, j + sides + 2, j + 1], 1)]
        )
        clay.press(part, grid.reshape(-1, 3), normals.reshape(-1, 3), tone, quads)


def lantern() -> Clay:
    """A stone lantern as tall as a man; panes of paper to the front, open at the back.

    A light behind its firebox shines through the paper and leaves the stone dark."""
    chance, clay = Chance(113), Clay()
    foot = [[0.36, 0.0], [0.36, 0.09], [0.33, 0.10], [0.30, 0.13], [0.22, 0.21], [0.17, 0.23]]
    turned(clay, np.array(foot), GRANITE, shape=1.0, chance=chance)
    post = [
        [0.125, 0.23],
        [0.108, 0.40],
        [0.102, 0.60],
        [0.130, 0.615],
        [0.130, 0.655],
        [0.102, 0.67],
        [0.108, 0.86],
        [0.122, 1.00],
    ]
    turned(clay, np.array(post), GRANITE, sides=24, chance=chance)
    table = [[0.15, 1.00], [0.24, 1.07], [0.315, 1.11], [0.315, 1.17], [0.24, 1.185], [0.0, 1.185]]
    turned(clay, np.array(table), GRANITE, shape=1.0, chance=chance)
    # Six pillars, and a collar under the roof.
    for k in range(6):
        turn = k * np.pi / 3
        pillar = Clay()
        turned(pillar, np.array([[0.036, 1.18], [0.036, 1.50]]), GRANITE, sides=8, chance=chance)
        p, n, c, t = pillar.merged("stone")
        clay.press(
            "stone", p + np.array([0.225 * np.cos(turn), 0.0, 0.225 * np.sin(turn)]), n, c, t
        )
    turned(
        clay,
        np.array([[0.255, 1.185], [0.255, 1.225], [0.215, 1.23]]),
        GRANITE,
        shape=1.0,
        chance=chance,
    )
    _panes(clay)
    roof = [
        [0.20, 1.455],
        [0.265, 1.455],
        [0.265, 1.50],
        [0.42, 1.505],
        [0.515, 1.475],
        [0.525, 1.51],
        [0.44, 1.565],
        [0.34, 1.61],
        [0.24, 1.67],
        [0.16, 1.74],
        [0.11, 1.80],
        [0.095, 1.82],
    ]
    turned(clay, np.array(roof), GRANITE, sides=48, shape=1.0, lift=0.09, chance=chance)
    jewel = [
        [0.07, 1.82],
        [0.12, 1.84],
        [0.12, 1.86],
        [0.065, 1.88],
        [0.10, 1.93],
        [0.105, 1.965],
        [0.08, 2.01],
        [0.035, 2.06],
        [0.0, 2.10],
    ]
    turned(clay, np.array(jewel), GRANITE, sides=20, chance=chance)
    return clay


def _panes(clay: Clay) -> None:
    """Three panes of paper towards the viewer, each with a wooden cross."""
    for k in (0, 1, 2):
        a, b = k * np.pi / 3, (k + 1) * np.pi / 3
        left, right = (0.215 * np.array([np.cos(t), 0.0, np.sin(t)]) for t in (b, a))
        out = unit(left + right)
        _sheet(clay, "paper", left, right, 1.225, 1.46, out, PAPER)
        for h in (1.30, 1.38):
            _sheet(
                clay, "wood", left * 1.02, right * 1.02, h - 0.005, h + 0.005, out, GRANITE * 0.25
            )
        for x in (1 / 3, 2 / 3):
            middle = left + (right - left) * x
            step = (right - left) * 0.02
            _sheet(
                clay,
                "wood",
                (middle - step) * 1.02,
                (middle + step) * 1.02,
                1.225,
                1.46,
                out,
                GRANITE * 0.25,
            )


def _sheet(
    clay: Clay,
    part: str,
    left: Array,
    right: Array,
    low: float,
    high: float,
    out: Array,
    colour: Array,
) -> None:
    corners = np.array([left + low * UP, right + low * UP, right + high * UP, left + high * UP])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    clay.press(part, corners, np.repeat(out[None], 4, 0), colour, faces)


def boulder(level: int) -> tuple[Array, NDArray[np.int64]]:
    """A sphere of unit radius cut from an octahedron, 4^level * 8 triangles."""
    points = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = np.array(
        [[0, 2, 4], [4, 2, 1], [1, 2, 5], [5, 2, 0], [4, 3, 0], [1, 3, 4], [5, 3, 1], [0, 3, 5]]
    )
    for _ in range(level):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, which = np.unique(edges, axis=0, return_inverse=True)
        mid = which.reshape(-1, 3) + len(points)
        points = np.concatenate([points, unit(points[unique].mean(axis=1))])
        a, b, c = faces.T
        ab, bc, ca = mid.T
        faces = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return points, faces


def stones() -> Clay:
    """Three stones, the largest half a metre, split by frost and mossy above."""
    chance, clay = Chance(127), Clay()
    placed = [
        ((0.0, 0.0), (0.52, 0.36, 0.42)),
        ((0.58, 0.16), (0.27, 0.20, 0.24)),
        ((-0.46, 0.26), (0.19, 0.12, 0.17)),
    ]
    for (x, z), size in placed:
        sphere, faces = boulder(4)
        p = sphere.copy()
        # Frost splits a stone along planes: cut it flat, then roughen it.
        for way, depth in zip(
            unit(chance.normal((9, 3)) * [1, 0.8, 1]), chance.uniform(0.62, 0.86, 9), strict=True
        ):
            p -= np.maximum(p @ way - depth, 0.0)[:, None] * way * 0.92
        rough = sum(
            np.sin(p @ w * f + s) / f
            for f in (5.0, 9.0, 17.0)
            for w, s in zip(chance.sphere(3), chance.uniform(0, 6.28, 3), strict=True)
        )
        p = p * (1 + 0.11 * np.asarray(rough))[:, None] * size
        flat = np.cross(p[faces[:, 1]] - p[faces[:, 0]], p[faces[:, 2]] - p[faces[:, 0]])
        normals = np.zeros_like(p)
        for corner in range(3):
            np.add.at(normals, faces[:, corner], flat)
        normals = unit(normals)
        normals = np.where(np.sum(normals * sphere, axis=1, keepdims=True) < 0, -normals, normals)
        tone = varied(chance, GRANITE * [1.0, 1.0, 1.04], len(p), 3.0, 0.12)
        moss = np.clip(
            1.5 * normals[:, 1] - 0.55 + 1.6 * np.asarray(rough) + 0.15 * chance.normal(len(p)),
            0,
            0.9,
        )
        p = p + np.array([x, 0.62 * size[1], z])
        p[:, 1] = np.maximum(p[:, 1], 0.0)
        clay.press("stone", p, normals, blend(tone, MOSS, moss), faces)
    return clay


def mushrooms() -> Clay:
    """A family of seven, the tallest a hand high, rust caps over cream stems."""
    chance, clay = Chance(131), Clay()
    for k in range(7):
        r, turn = 0.115 * np.sqrt(k / 7), k * GOLDEN_ANGLE
        tall, wide = chance.one(0.07, 0.17) * (1 - 0.4 * k / 7), chance.one(0.75, 1.15)
        pot = Clay()
        s = np.linspace(0, 1, 6)
        stem = np.stack([0.013 * (1.35 - 0.6 * s + 0.15 * s**3), s * tall], 1)
        turned(pot, stem, CREAM, sides=12)
        a = np.linspace(0, 1, 9)
        dome = np.stack(
            [0.058 * wide * np.cos(a * np.pi / 2), tall - 0.014 + 0.058 * np.sin(a * np.pi / 2)], 1
        )
        turned(
            pot,
            np.array([[0.012, tall - 0.002], [0.056 * wide, tall - 0.017], dome[0]]),
            CREAM * 0.75,
            sides=18,
        )
        cap = Clay()
        turned(cap, dome, CAP * np.exp(0.12 * chance.normal(1)), sides=18)
        p, n, c, t = cap.merged("stone")
        pot.press("stone", p, unit(p - [0.0, tall - 0.04, 0.0]), c, t)
        p, n, c, t = pot.merged("stone")
        lean = np.array([np.cos(turn), 0, np.sin(turn)]) * 0.22
        p = p + lean * p[:, 1:2] + [r * np.cos(turn), 0, r * np.sin(turn)]
        clay.press("stone", p, n, c, t)
    return clay
