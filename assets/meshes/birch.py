"""A birch: white bole, thin limbs, hanging twigs with small golden leaves."""

import numpy as np
from chance import Chance
from clay import Array, Clay, unit
from leaves import GOLDEN_ANGLE, foliage, kite, spiral, varied
from wood import Limb, bark, shoot, thinned

BIRCH_LEAF = np.array([0.520, 0.365, 0.060])


def birch() -> Clay:
    """Eleven metres: a white bole with dark scars, thin limbs, hanging golden twigs."""
    chance, clay = Chance(23), Clay()
    t = np.linspace(0.0, 1.0, 132)
    bend = np.stack(
        [0.30 * np.sin(2.3 * t) - 0.10 * np.sin(7 * t), t * 10.9, 0.2 * np.sin(3 * t)], 1
    )
    width = 0.165 * (1 - t) ** 0.85 + 0.010 + 0.10 * np.exp(-t * 10.9 / 0.22)
    bole = Limb(bend, width)
    boughs = _birch_boughs(chance, bole)
    _white_bark(chance, clay, bole, [b.path[0] for b in boughs])
    bases, alongs, sizes, outs = [], [], [], []
    for bough in boughs:
        shade = (
            np.array([0.16, 0.12, 0.10]) if bough.radius[0] < 0.03 else np.array([0.42, 0.38, 0.33])
        )
        bark(clay, bough, shade)
        length = np.linalg.norm(np.diff(bough.path, axis=0), axis=1).sum()
        for k in range(3 + int(length * 4.2)):
            # Twigs leave the outer part of a bough, then hang.
            point, heading, _ = bough.at(chance.one(0.22, 1.0))
            away = spiral(heading[None], np.array([k * GOLDEN_ANGLE]), 0.9)[0]
            drop = chance.one(0.35, 1.05)
            twig = shoot(
                chance,
                point,
                away,
                drop,
                (0.006, 0.004),
                nodes=5,
                wander=0.08,
                pull=np.array([0.0, -2.6, 0.0]),
            )
            bark(clay, thinned(twig, 2), np.array([0.13, 0.085, 0.07]), sides=3)
            m = 6 + int(drop * 15)
            where = (np.arange(m) + 0.6) / m
            nodes = [twig.at(float(w)) for w in where]
            along = spiral(
                np.array([q[1] for q in nodes]), np.arange(m) * np.pi + chance.one(0, 6.28), 0.95
            )
            bases.append(np.array([q[0] for q in nodes]))
            alongs.append(unit(along + [0.0, -0.45, 0.0] + 0.3 * chance.normal((m, 3))))
            sizes.append(chance.uniform(0.085, 0.135, m))
            axis = np.interp(point[1], bend[:, 1], bend[:, 0])
            outs.append(np.repeat([point - [axis, point[1] - 0.15, 0.0]], m, axis=0))
    base, along, size, out = (np.concatenate(a) for a in (bases, alongs, sizes, outs))
    n = len(base)
    face = unit(unit(out) + 0.9 * chance.normal((n, 3)))
    # Low leaves are still green, high ones have turned.
    ripe = np.clip((base[:, 1:2] - 3.0) / 5.0 + 0.25 * chance.normal((n, 1)), 0, 1)
    colour = varied(
        chance, np.array([0.36, 0.37, 0.06]) * (1 - ripe) + BIRCH_LEAF * ripe, n, 6.0, 0.15
    )
    foliage(
        clay, kite(0.72, 0.08, 0.1, 0.36), base, along, face, size, colour, outward=out, bend=0.35
    )
    return clay


def _birch_boughs(chance: Chance, bole: Limb) -> list[Limb]:
    """Limbs by the golden angle along the bole: a narrow egg, widest below the middle."""
    boughs = []
    heights = np.linspace(0.23, 0.985, 44) + 0.006 * chance.normal(44)
    for k, h in enumerate(heights):
        point, _, r = bole.at(float(np.clip(h, 0, 0.99)))
        egg = np.interp(h, [0.2, 0.32, 0.45, 0.65, 0.85, 1.0], [0.9, 2.1, 2.5, 2.0, 1.15, 0.35])
        length = float(egg * chance.one(0.78, 1.18))
        turn = k * GOLDEN_ANGLE
        rise = np.interp(h, [0.2, 1.0], [0.75, 1.6])
        direction = np.array([np.cos(turn), rise, np.sin(turn)])
        boughs.append(
            shoot(
                chance,
                point,
                direction,
                length,
                (min(0.5 * r, 0.03), 0.006),
                nodes=7,
                wander=0.07,
                pull=np.array([0.0, -0.9 if h < 0.8 else -0.4, 0.0]),
            )
        )
    return boughs


def _white_bark(chance: Chance, clay: Clay, bole: Limb, scars: list[Array]) -> None:
    """Chalk white with lenticels, a black eye under each bough and a dark cracked foot."""
    n, sides = len(bole.path), 18
    white = varied(chance, np.array([0.74, 0.69, 0.62]), n * sides, 2.0, 0.05).reshape(n, sides, 3)
    t = np.arange(sides) * 2 * np.pi / sides
    y = bole.path[:, 1]
    # Lenticels: short dark arcs at random heights.
    for _ in range(190):
        row, start, wide = int(chance.one(4, n)), chance.one(0, 2 * np.pi), chance.one(0.3, 1.1)
        arc = np.abs((t - start + np.pi) % (2 * np.pi) - np.pi) < wide
        white[row, arc] *= chance.one(0.18, 0.6)
    for scar in scars:
        row = int(np.argmin(np.abs(y - scar[1] + 0.08)))
        centre = bole.path[row]
        toward = np.arctan2(scar[2] - centre[2], scar[0] - centre[0] + 1e-6)
        arc = np.abs((t + toward + np.pi) % (2 * np.pi) - np.pi) < 0.75
        white[max(0, row - 1) : row + 2, arc] *= 0.22
    foot = np.clip(1.0 - y[:, None] / 1.3 + 0.35 * chance.normal((n, sides)), 0, 1)[..., None]
    foot = np.where(y[:, None, None] < 1.6, foot, 0.0)
    colour = white * (1 - foot) + np.array([0.055, 0.048, 0.042]) * foot
    top = np.clip((y - 8.5) / 2.0, 0, 1)[:, None, None]
    colour = colour * (1 - 0.75 * top)
    ridges = 1.0 + 0.06 * foot[..., 0] * chance.normal((n, sides))
    bark(clay, bole, colour, sides=sides, ridges=ridges)
