"""Conifers: a layered spruce and a slender cypress."""

import numpy as np
from chance import Chance
from clay import Array, Clay, across, unit
from leaves import GOLDEN_ANGLE, foliage, kite, varied
from wood import UP, Limb, bark, shoot

SPRUCE_NEEDLE = np.array([0.066, 0.132, 0.082])
CYPRESS_SPRAY = np.array([0.070, 0.125, 0.056])
RED_BARK = np.array([0.135, 0.080, 0.055])


def spruce() -> Clay:
    """Ten metres: whorls of boughs that sag and lift their tips, needles in hanging sprays."""
    chance, clay = Chance(59), Clay()
    t = np.linspace(0.0, 1.0, 30)
    bole = Limb(
        np.stack([0.05 * np.sin(5 * t), t * 10.0, 0.04 * np.sin(4 * t + 1)], 1),
        0.19 * (1 - t) + 0.008 + 0.09 * np.exp(-t * 10 / 0.2),
    )
    bark(clay, bole, varied(chance, RED_BARK, 30 * 10, 3.0, 0.2).reshape(30, 10, 3), sides=10)
    bases, alongs, faces, sizes, outs, depth = [], [], [], [], [], []
    height, k = 0.95, 0
    while height < 9.9:
        s = height / 10.0
        reach = 2.35 * (1 - s) ** 0.9 * (0.9 + 0.2 * (k % 2))
        for j in range(7 if s < 0.7 else 5):
            turn = (
                k * GOLDEN_ANGLE + j * 2 * np.pi / (7 if s < 0.7 else 5) + 0.15 * chance.one(-1, 1)
            )
            length = float(reach * chance.one(0.78, 1.12)) + 0.10
            rise = np.interp(s, [0.0, 0.6, 0.9, 1.0], [-0.30, 0.08, 0.7, 1.6])
            start = bole.at(min(s, 0.99))[0] + [0, chance.one(-0.08, 0.08), 0]
            direction = np.array([np.cos(turn), rise, np.sin(turn)])
            bough = shoot(
                chance,
                start,
                direction,
                length,
                (0.014 + 0.008 * length, 0.004),
                nodes=6,
                wander=0.03,
                pull=np.array([0.0, 0.55, 0.0]),
            )
            # Sag in the middle, lift at the tip.
            x = np.linspace(0, 1, 6)
            bough.path[:, 1] -= 0.20 * length * np.sin(np.pi * x**0.8)
            bark(clay, bough, RED_BARK * 0.8, sides=3)
            spray = _needles(chance, bough, length)
            for store, value in zip((bases, alongs, faces, sizes), spray, strict=True):
                store.append(value)
            outs.append(np.repeat([direction + 0.6 * UP], len(spray[0]), axis=0))
            depth.append(np.linalg.norm(spray[0][:, [0, 2]], axis=1) / max(reach, 0.1))
        height += 0.47 * (1 - 0.5 * s)
        k += 1
    base, along, face, size, out = (np.concatenate(a) for a in (bases, alongs, faces, sizes, outs))
    fresh = np.clip(np.concatenate(depth) - 0.45, 0, 1)[:, None]
    colour = varied(chance, SPRUCE_NEEDLE * (1 + fresh * [1.1, 0.9, 0.3]), len(base), 5.0, 0.18)
    blade = kite(0.26, 0.05, 0.12, 0.35)
    foliage(clay, blade, base, along, face, size, colour, outward=out, bend=0.35)
    return clay


def _needles(chance: Chance, bough: Limb, length: float) -> tuple[Array, Array, Array, Array]:
    """Sprays in a flat fishbone along a bough, the inner ones hanging."""
    m = 9 + int(length * 21)
    where = np.linspace(0.16, 1.0, m)
    nodes = [bough.at(float(w)) for w in where]
    point = np.array([q[0] for q in nodes])
    heading = np.array([q[1] for q in nodes])
    side = np.cross(heading, UP) * np.where(np.arange(m) % 2, 1.0, -1.0)[:, None]
    hang = (1.0 - where)[:, None] * np.array([0.0, -0.9, 0.0]) * chance.uniform(0.3, 1.0, (m, 1))
    along = unit(
        heading * 0.75 + side * (1.15 - 0.7 * where)[:, None] + hang + 0.15 * chance.normal((m, 3))
    )
    size = (0.17 + 0.20 * np.sqrt(length) * (1.15 - where)) * chance.uniform(0.8, 1.2, m)
    face = unit(UP + 0.45 * chance.normal((m, 3)))
    return point, along, face, size


def cypress() -> Clay:
    """Eight metres and slender: flames of upright sprays round a bare foot."""
    chance, clay = Chance(61), Clay()
    t = np.linspace(0, 1, 16)
    stem = np.stack([0.05 * np.sin(4 * t), t * 7.2, 0.04 * np.cos(3 * t) - 0.04], 1)
    bole = Limb(stem, 0.12 * (1 - t) + 0.012 + 0.07 * np.exp(-t * 7 / 0.2))
    bark(clay, bole, varied(chance, RED_BARK, 160, 3.0, 0.2).reshape(16, 10, 3), sides=10)
    flames = 84
    s = (np.arange(flames) + 0.5) / flames
    y = 0.40 + 6.5 * s**1.05
    profile = np.interp(
        y, [0.4, 1.0, 2.2, 3.6, 5.2, 6.6, 7.4, 8.0], [0.40, 0.62, 0.74, 0.70, 0.50, 0.22, 0.05, 0.0]
    )
    turn = np.arange(flames) * GOLDEN_ANGLE
    r = profile * chance.uniform(0.55, 1.0, flames)
    foot = np.stack([r * np.cos(turn), y, r * np.sin(turn)], 1)
    out = np.stack([np.cos(turn), np.zeros(flames), np.sin(turn)], 1)
    tall = np.interp(s, [0, 0.5, 1], [1.15, 1.35, 1.25]) * chance.uniform(0.75, 1.25, flames)
    # Each flame is a spindle of sprays: wide at a third, closing to a point.
    m = 82
    flame = np.repeat(np.arange(flames), m)
    n = len(flame)
    h = chance.uniform(0, 1, n) ** 0.8
    spindle = 0.27 * np.sin(np.pi * np.clip(h * 0.85 + 0.15, 0, 1)) * (1 - 0.45 * s[flame])
    around = unit(across(np.repeat(UP[None], n, 0), chance.sphere(n)))
    axis = unit(UP + 0.16 * out - 0.10 * foot * [1, 0, 1])
    base = foot[flame] + axis[flame] * (h * tall[flame])[:, None]
    base = base + around * (spindle * chance.uniform(0.4, 1.0, n))[:, None]
    along = unit(axis[flame] + 0.42 * around * (1 - h)[:, None] + 0.12 * chance.normal((n, 3)))
    outward = unit(out[flame] + 0.7 * around + [0, 0.2, 0])
    face = unit(outward + 0.3 * chance.normal((n, 3)))
    size = chance.uniform(0.16, 0.30, n) * (1.05 - 0.35 * h)
    tint = varied(chance, CYPRESS_SPRAY, flames, 6.0, 0.16)[flame] * (0.65 + 0.85 * h)[:, None]
    colour = varied(chance, tint, n, 4.0, 0.12)
    foliage(clay, kite(0.34, 0.08, 0.05, 0.4), base, along, face, size, colour, outward=outward)
    return clay
