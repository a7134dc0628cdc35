"""A branch of plum in blossom, for near the lens."""

import numpy as np
from chance import Chance
from clay import Array, Clay, across, unit
from leaves import Blade, blend, foliage, spiral, varied
from wood import UP, bark, shoot

BARK = np.array([0.070, 0.048, 0.042])
PETAL = np.array([0.86, 0.56, 0.60])
BUD = np.array([0.55, 0.06, 0.12])
STAMEN = np.array([0.80, 0.55, 0.16])
# Where twigs leave the branch, and whether upwards
TWIGS = ((0.12, -1), (0.22, 1), (0.34, -1), (0.45, 1), (0.56, -1), (0.66, 1), (0.78, -1), (0.88, 1))


def plum_branch() -> Clay:
    """A crooked branch that comes in from the left, a metre long, and droops to the right."""
    chance, clay = Chance(233), Clay()
    limb = shoot(
        chance,
        np.array([-0.55, 0.36, 0.0]),
        np.array([1.0, 0.30, 0.0]),
        1.02,
        (0.013, 0.004),
        nodes=14,
        wander=0.20,
        pull=np.array([0.2, -0.85, 0.0]),
    )
    bark(clay, limb, varied(chance, BARK, 14, 3.0, 0.15), sides=8)
    bearers = [(limb, 24)]
    for h, up in TWIGS:
        point, heading, r = limb.at(h)
        twig = shoot(
            chance,
            point,
            heading * 0.75 + np.array([0.0, 0.85 * up, 0.55 * chance.one(-1, 1)]),
            chance.one(0.14, 0.34) * (1.1 - 0.4 * h),
            (0.6 * r, 0.0022),
            nodes=8,
            wander=0.16,
            pull=np.array([0.3, 0.30 * up - 0.2, 0.0]),
        )
        bark(clay, twig, BARK, sides=5)
        bearers.append((twig, 14))
    for bearer, count in bearers:
        for h in np.linspace(0.16, 0.99, count):
            if chance.one() < 0.30:
                continue
            point, heading, r = bearer.at(float(min(h + 0.03 * chance.one(-1, 1), 1.0)))
            way = spiral(heading[None], chance.uniform(0, 6.28), 1.25)[0]
            axis = unit(way + np.array([0.0, 0.1, 0.55]))
            centre = point + way * (r + 0.007)
            if chance.one() < 0.62:
                blossom(chance, clay, centre, axis, chance.one(0.0155, 0.0205))
            else:
                bud(clay, centre, axis, chance.one(0.005, 0.0085))
    return clay


def petal() -> Blade:
    """A round petal of eight triangles, cupped."""
    edge = [[0, 0, 0], [0.34, 0.34, 0.05], [0.47, 0.68, 0.12], [0.24, 0.97, 0.20], [0, 1.0, 0.20]]
    edge += [[-0.24, 0.97, 0.20], [-0.47, 0.68, 0.12], [-0.34, 0.34, 0.05]]
    k = np.arange(8)
    points = np.array([*edge, [0, 0.55, 0.0]], dtype=np.float64)
    return Blade(points, np.stack([np.full(8, 8), k, (k + 1) % 8], 1))


def blossom(chance: Chance, clay: Clay, centre: Array, axis: Array, size: float) -> None:
    """Five petals round a tuft of stamens."""
    axes = np.repeat(axis[None], 5, axis=0)
    turns = np.arange(5) * (2 * np.pi / 5) + chance.one(0, 6.28)
    along = spiral(axes, turns, chance.one(0.85, 1.35))
    base = centre + along * 0.08 * size
    tone, sizes = varied(chance, PETAL, 5, 5.0, 0.06), np.full(5, size)
    foliage(clay, petal(), base, along, axes, sizes, tone, outward=axes, bend=0.3, tip=1.1)
    m = 9
    ways = spiral(np.repeat(axis[None], m, 0), np.arange(m) * 2.4, np.linspace(0.1, 0.75, m))
    points = np.array([[-0.05, 0, 0], [0.05, 0, 0], [0.10, 1, 0], [-0.10, 1, 0]])
    thread = Blade(points, np.array([[0, 1, 2], [0, 2, 3]]))
    roots, tone = np.repeat(centre[None], m, 0), np.repeat(STAMEN[None], m, 0)
    foliage(clay, thread, roots, ways, across(ways, UP), np.full(m, 0.62 * size), tone, bend=0.0)


def bud(clay: Clay, centre: Array, axis: Array, size: float) -> None:
    """A round bud."""
    t, turn = np.linspace(0.15, np.pi - 0.15, 4), np.arange(6) * (np.pi / 3)
    side = across(axis, UP)
    out = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(axis, side)
    n = (np.sin(t)[:, None, None] * out - np.cos(t)[:, None, None] * axis).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(3), np.arange(6), indexing="ij")
    a, b = (i * 6 + j).ravel(), (i * 6 + (j + 1) % 6).ravel()
    faces = np.concatenate([np.stack([a, b, b + 6], 1), np.stack([a, b + 6, a + 6], 1)])
    clay.press("bud", centre + size * n, n, blend(BUD, PETAL, np.linspace(0, 0.6, 24)), faces)
