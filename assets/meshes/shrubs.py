"""Shrubs: a dog rose, and a branch for near the lens."""

import numpy as np
from chance import Chance
from clay import Clay, across, unit
from herbs import PETAL_ROSE, rosette
from leaves import GOLDEN_ANGLE, foliage, kite, oval, spiral, varied
from wood import UP, bark, shoot

BUSH_LEAF = np.array([0.105, 0.190, 0.070])
BRANCH_LEAF = np.array([0.180, 0.215, 0.040])


def bush() -> Clay:
    """A dog rose, a metre and a half: arching canes, small leaves, a few hips and late flowers."""
    chance, clay = Chance(71), Clay()
    bases, alongs, outs, tips = [], [], [], []
    for k in range(46):
        turn = k * GOLDEN_ANGLE
        lean = 0.10 + 0.85 * (k / 46)
        direction = np.array([np.cos(turn) * lean, 1.0, np.sin(turn) * lean])
        root = np.array([0.12 * np.cos(turn), 0.0, 0.12 * np.sin(turn)])
        length = chance.one(1.15, 1.65) * (1.0 - 0.18 * (k / 46))
        cane = shoot(
            chance,
            root,
            direction,
            float(length),
            (0.010, 0.004),
            nodes=9,
            wander=0.08,
            pull=np.array([0.5 * np.cos(turn), -0.45 - 0.2 * lean, 0.5 * np.sin(turn)]),
        )
        bark(clay, cane, np.array([0.12, 0.085, 0.055]), sides=3)
        twigs = [cane]
        for j in range(6):
            point, heading, _ = cane.at(0.35 + 0.6 * j / 6)
            way = spiral(heading[None], np.array([j * GOLDEN_ANGLE]), 0.9)[0] + 0.4 * UP
            twigs.append(
                shoot(
                    chance, point, way, chance.one(0.18, 0.42), (0.004, 0.003), nodes=4, wander=0.15
                )
            )
            bark(clay, twigs[-1], np.array([0.13, 0.12, 0.06]), sides=3)
        tips.extend(t.path[-1] for t in twigs[1:])
        for limb in twigs:
            m = 14 if limb is cane else 13
            where = np.linspace(0.35 if limb is cane else 0.15, 1.0, m)
            nodes = [limb.at(float(w)) for w in where]
            bases.append(np.array([q[0] for q in nodes]))
            heading = np.array([q[1] for q in nodes])
            alongs.append(spiral(heading, np.arange(m) * GOLDEN_ANGLE, np.linspace(1.2, 0.5, m)))
            outs.append(bases[-1] - [0.0, 0.35, 0.0])
    base, along, out = (np.concatenate(a) for a in (bases, alongs, outs))
    n = len(base)
    base = base + 0.02 * chance.normal((n, 3))
    face = unit(unit(out) + [0, 0.8, 0] + 0.5 * chance.normal((n, 3)))
    colour = varied(chance, BUSH_LEAF, n, 7.0, 0.18)
    size = chance.uniform(0.05, 0.092, n)
    foliage(clay, kite(0.62, 0.1, 0.12, 0.45), base, along, face, size, colour, outward=out)
    # Flowers open where the canes reach the light.
    high = [t for t in tips if t[1] > 0.62 and chance.one() < 0.26]
    for tip in high:
        rosette(chance, clay, tip, unit(tip - [0, 0.5, 0]), 5, 0.040, PETAL_ROSE, 1.15)
    return clay


def near_branch() -> Clay:
    """A bough that leaves the frame: its hand of leaves hangs from the upper left to the right."""
    chance, clay = Chance(89), Clay()
    bough = shoot(
        chance,
        np.array([-0.95, 0.86, 0.0]),
        np.array([1.0, 0.14, 0.06]),
        2.0,
        (0.022, 0.004),
        nodes=18,
        wander=0.07,
        pull=np.array([0.0, -1.15, 0.0]),
    )
    bark(clay, bough, np.array([0.085, 0.066, 0.052]), sides=8)
    twigs = [bough]
    for k in range(17):
        h = 0.06 + 0.90 * k / 17
        point, heading, r = bough.at(h)
        way = heading * 0.8 + np.array([0.1, -0.7 if k % 4 else 0.5, 0.5 * chance.one(-1, 1)])
        length = chance.one(0.30, 0.75) * (1.15 - 0.65 * h)
        twig = shoot(
            chance,
            point,
            way,
            length,
            (0.5 * r, 0.002),
            nodes=8,
            wander=0.13,
            pull=np.array([0.1, -0.8, 0.0]),
        )
        bark(clay, twig, np.array([0.10, 0.075, 0.055]), sides=5)
        twigs.append(twig)
    for limb in twigs:
        m = 26 if limb is bough else 15
        where = np.linspace(0.12, 1.0, m)
        nodes = [limb.at(float(w)) for w in where]
        heading = np.array([q[1] for q in nodes])
        side = np.cross(heading, across(heading, np.array([0.0, 0.35, 1.0])))
        hand = np.where(np.arange(m) % 2, 1.0, -1.0)[:, None]
        along = unit(heading * 0.7 + side * hand + [0.0, -0.55, 0.0] + 0.22 * chance.normal((m, 3)))
        face = unit(np.array([0.1, 0.5, 0.8]) + 0.6 * chance.normal((m, 3)))
        base = np.array([q[0] for q in nodes])
        colour = varied(chance, BRANCH_LEAF, m, 8.0, 0.16)
        size = chance.uniform(0.07, 0.135, m)
        foliage(clay, oval(0.54, 0.06, 0.16), base, along, face, size, colour, bend=0.0)
    return clay
