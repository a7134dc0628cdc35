"""Broad-leaved trees: an oak, a bare one and a sapling."""

import numpy as np
from chance import Chance
from clay import Array, Clay, unit
from leaves import GOLDEN_ANGLE, foliage, kite, oval, spiral, varied
from wood import UP, Limb, bark, colonise, limbs_of, pipe_radii, shoot, smoothed, thinned

OAK_LEAVES = 8200
OAK_BARK = np.array([0.115, 0.092, 0.070])
OAK_LEAF = np.array([0.185, 0.265, 0.052])
SAPLING_LEAF = np.array([0.240, 0.330, 0.060])
GREY_WOOD = np.array([0.200, 0.175, 0.150])


def oak() -> Clay:
    """Nine metres, as broad as high: a short bole, sinuous limbs, leaves in separate clouds."""
    chance, clay = Chance(11), Clay()
    clouds, reach = _oak_clouds(chance)
    cloud = np.repeat(np.arange(len(clouds)), 52)
    ball = chance.sphere(len(cloud)) * chance.uniform(0.25, 1.0, (len(cloud), 1)) ** 0.5
    attractors = clouds[cloud] + ball * reach[cloud]
    # A bole that leans, then space colonisation through the clouds.
    bole = np.array(
        [[0, 0, 0], [0.02, 0.5, 0], [0.08, 1.0, 0.03], [0.1, 1.5, 0.05], [0.05, 1.95, 0]]
    )
    points, parent = colonise(chance, bole, attractors, step=0.26, kill=0.42, influence=3.4)
    radii = pipe_radii(parent, 0.009, 0.40)
    radii *= 1.0 + 0.75 * np.exp(-points[:, 1] / 0.28)
    for limb in limbs_of(points, parent, radii):
        if limb.radius[0] > 0.016:
            _rough_bark(chance, clay, smoothed(limb), OAK_BARK)
    # Rosettes at the ends of the twigs, where an oak keeps its leaves.
    heading = unit(points - points[np.maximum(parent, 0)])
    ends = np.flatnonzero((radii < 0.021) & (points[:, 1] > 2.2))
    n = OAK_LEAVES
    node = ends[np.arange(n) * len(ends) // n]
    nearest = np.argmin(
        np.linalg.norm((points[node][:, None] - clouds[None]) / reach[None], axis=-1), axis=1
    )
    outward = unit(points[node] - clouds[nearest] + [0.0, 0.25, 0.0])
    along = spiral(heading[node], np.arange(n) * GOLDEN_ANGLE, chance.uniform(0.5, 1.35, n))
    along = unit(along + 0.45 * outward + 0.25 * chance.normal((n, 3)))
    face = unit(outward + [0.0, 0.25, 0.0] + 0.7 * chance.normal((n, 3)))
    base = points[node] + 0.09 * chance.normal((n, 3))
    # Clouds differ a little in hue; sunlit tops are yellower.
    tint = varied(chance, OAK_LEAF, len(clouds), 5.0, 0.10)[nearest]
    tint *= np.array([1.0, 1.0, 1.0]) + np.clip(outward[:, 1:2], 0, 1) * np.array([0.30, 0.14, 0.0])
    colour = varied(chance, tint, n, 5.0, 0.16)
    size = chance.uniform(0.165, 0.24, n)
    foliage(clay, kite(0.72, 0.10, 0.14, 0.55), base, along, face, size, colour, outward=outward)
    return clay


def _oak_clouds(chance: Chance) -> tuple[Array, Array]:
    """Centres and half axes of the leaf masses, on a drawn profile: wide shoulders, flat base."""
    height = np.array([2.9, 3.5, 4.4, 4.6, 5.5, 5.9, 6.6, 7.0, 7.5, 8.3])
    radius = np.array([2.7, 3.5, 3.8, 1.6, 3.6, 1.5, 2.9, 1.0, 1.9, 0.6])
    count = np.array([5, 8, 9, 4, 9, 4, 8, 3, 6, 2])
    centres, reach = [], []
    for y, r, k in zip(height, radius, count, strict=True):
        turn = np.arange(k) * (2 * np.pi / k) + chance.one(0, 6.28) + 0.25 * chance.normal(k)
        out = r * chance.uniform(0.80, 1.05, k)
        lean = 0.35 * (y - 2.5) / 6.0
        centres.append(
            np.stack(
                [out * np.cos(turn) + lean, y + 0.28 * chance.normal(k), out * np.sin(turn)], axis=1
            )
        )
        spread = chance.uniform(0.80, 1.18, k)
        reach.append(np.stack([spread, spread * 0.56, spread], axis=1))
    return np.concatenate(centres), np.concatenate(reach)


def _rough_bark(chance: Chance, clay: Clay, limb: Limb, colour: Array) -> None:
    """Thick limbs get furrows; thin ones lose every second node."""
    if limb.radius[0] < 0.09:
        bark(clay, thinned(limb, 2), varied(chance, colour, 1, 3.0, 0.1)[0])
        return
    n, sides = len(limb.path), 16
    furrow = (
        1.0
        + 0.10 * np.sin(np.arange(sides) * np.pi * 0.75)[None]
        + 0.05 * chance.normal((n, sides))
    )
    shade = varied(chance, colour, n * sides, 3.0, 0.18).reshape(n, sides, 3)
    bark(clay, limb, shade * (furrow**3)[..., None], sides=sides, ridges=furrow)


def bare_tree() -> Clay:
    """Seven metres of dead oak: a twisted bole, one broken limb, twigs like lace."""
    chance, clay = Chance(47), Clay()
    bole = shoot(
        chance, np.zeros(3), np.array([0.06, 1.0, 0.0]), 3.0, (0.30, 0.20), nodes=13, wander=0.07
    )
    foot = Limb(bole.path, bole.radius * (1 + 0.8 * np.exp(-bole.path[:, 1] / 0.25)))
    _rough_bark(chance, clay, foot, GREY_WOOD)
    tip, heading, _ = bole.at(1.0)
    forks = [
        (-0.95, 0.85, 0.1, 3.5),
        (0.28, 1.0, -0.45, 4.2),
        (0.95, 0.7, 0.4, 3.1),
        (-0.25, 1.0, 0.6, 3.2),
        (0.5, 0.8, -0.9, 2.6),
    ]
    for x, y, z, length in forks:
        limb = shoot(
            chance,
            tip - 0.12 * heading,
            np.array([x, y, z]),
            length,
            (0.15, 0.018),
            nodes=14,
            wander=0.17,
            pull=0.3,
            taper=0.7,
        )
        _fork(chance, clay, limb, 0)
    point, _, _ = bole.at(0.62)
    _fork(
        chance,
        clay,
        shoot(
            chance,
            point,
            np.array([1.0, 0.35, 0.2]),
            1.9,
            (0.095, 0.02),
            nodes=10,
            wander=0.2,
            pull=0.5,
        ),
        1,
    )
    # The broken limb: short, blunt, pale inside.
    point, _, _ = bole.at(0.48)
    stub = shoot(chance, point, np.array([-1.0, 0.5, 0.3]), 0.75, (0.10, 0.07), nodes=6, wander=0.1)
    bark(clay, stub, GREY_WOOD, sides=8)
    spike = shoot(
        chance, stub.path[-1], stub.path[-1] - stub.path[-2], 0.25, (0.07, 0.004), nodes=3
    )
    bark(clay, spike, np.array([0.42, 0.33, 0.22]), sides=8)
    return clay


def _fork(chance: Chance, clay: Clay, limb: Limb, depth: int) -> None:
    """Press a limb, then its children in alternate kinks, to the third order."""
    bark(clay, limb, varied(chance, GREY_WOOD, 1, 3.0, 0.1)[0])
    if depth == 3:
        return
    length = np.linalg.norm(np.diff(limb.path, axis=0), axis=1).sum()
    count = (11, 7, 5)[depth]
    for k in range(count):
        where = 0.22 + 0.78 * (k + chance.one(0.2, 0.9)) / count
        point, heading, r = limb.at(min(where, 0.98))
        along = spiral(
            heading[None], np.array([k * 2.4 + chance.one(0, 0.8)]), chance.one(0.55, 0.95)
        )[0]
        reach = length * chance.one(0.34, 0.56) * (1.2 - 0.5 * where)
        child = shoot(
            chance,
            point,
            along,
            float(reach),
            (max(0.62 * r, 0.006), 0.004 if depth else 0.009),
            nodes=(8, 5, 3)[depth],
            wander=0.22,
            pull=0.4,
            taper=0.8,
        )
        _fork(chance, clay, child, depth + 1)


def sapling() -> Clay:
    """Two metres and a half: one whip, few shoots, large leaves that can be counted."""
    chance, clay = Chance(31), Clay()
    stem = shoot(chance, np.zeros(3), UP, 2.25, (0.021, 0.006), nodes=14, wander=0.07, pull=0.5)
    bark(clay, stem, np.array([0.15, 0.105, 0.075]), sides=6)
    shoots = [stem]
    for k in range(15):
        h = 0.26 + 0.7 * k / 15
        point, _, r = stem.at(h)
        turn = k * GOLDEN_ANGLE + 0.6
        direction = np.array([np.cos(turn), 0.9, np.sin(turn)])
        length = float(np.interp(h, [0.2, 0.45, 1.0], [0.75, 0.95, 0.3]) * chance.one(0.8, 1.15))
        shoots.append(
            shoot(
                chance, point, direction, length, (0.5 * r, 0.004), nodes=7, wander=0.08, pull=0.25
            )
        )
        bark(clay, shoots[-1], np.array([0.17, 0.12, 0.08]), sides=5)
    bases, alongs, outs = [], [], []
    for limb in shoots:
        length = np.linalg.norm(np.diff(limb.path, axis=0), axis=1).sum()
        m = 5 + int(length * (22 if limb is not stem else 9))
        where = np.linspace(0.25 if limb is not stem else 0.4, 1.0, m)
        nodes = [limb.at(float(w)) for w in where]
        heading = np.array([q[1] for q in nodes])
        bases.append(np.array([q[0] for q in nodes]))
        alongs.append(spiral(heading, np.arange(m) * GOLDEN_ANGLE, np.linspace(1.15, 0.35, m)))
        outs.append(bases[-1] - [0.0, 1.1, 0.0])
    base, along, out = (np.concatenate(a) for a in (bases, alongs, outs))
    n = len(base)
    along = unit(along + [0.0, -0.15, 0.0] + 0.15 * chance.normal((n, 3)))
    face = unit(np.array([0.0, 1.0, 0.0]) + 0.4 * chance.normal((n, 3)))
    colour = varied(chance, SAPLING_LEAF, n, 8.0, 0.14)
    size = chance.uniform(0.10, 0.19, n)
    foliage(clay, oval(0.55, 0.07, 0.22), base, along, face, size, colour, outward=out, bend=0.2)
    return clay
