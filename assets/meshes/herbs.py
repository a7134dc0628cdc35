"""Herbs: fern, umbellifer and meadow flowers."""

import numpy as np
from chance import Chance
from clay import Array, Clay, across, unit
from leaves import GOLDEN_ANGLE, Blade, foliage, kite, oval, spiral, varied
from wood import UP, Limb, bark, shoot

FERN_LEAF = np.array([0.150, 0.260, 0.045])
STALK = np.array([0.170, 0.210, 0.070])
PETAL_ROSE = np.array([0.720, 0.170, 0.260])
PETAL_CREAM = np.array([0.820, 0.760, 0.620])


def fern() -> Clay:
    """Bracken of the wood: fifteen arching fronds, each a plume of folded pinnae."""
    chance, clay = Chance(73), Clay()
    for k in range(15):
        turn = k * GOLDEN_ANGLE
        young = k / 15
        rise = 3.0 + 3.4 * (1 - young)
        length = chance.one(0.72, 1.0) * (0.85 + 0.15 * young)
        direction = np.array([np.cos(turn), rise, np.sin(turn)])
        rachis = shoot(
            chance,
            np.array([0.03 * np.cos(turn), 0, 0.03 * np.sin(turn)]),
            direction,
            float(length),
            (0.006, 0.0015),
            nodes=14,
            wander=0.02,
            pull=np.array([0.95 * np.cos(turn), -2.1, 0.95 * np.sin(turn)]),
        )
        bark(clay, rachis, STALK, sides=3)
        m = 25
        where = 0.16 + 0.84 * (np.arange(m) / m) ** 0.9
        nodes = [rachis.at(float(w)) for w in where]
        point = np.repeat(np.array([q[0] for q in nodes]), 2, axis=0)
        heading = np.repeat(np.array([q[1] for q in nodes]), 2, axis=0)
        up = across(heading, UP)
        side = np.cross(heading, up) * np.tile([1.0, -1.0], m)[:, None]
        w = np.repeat(where, 2)
        # A plume: pinnae longest at a third of the frond, swept towards the tip.
        size = 0.26 * length * np.interp(w, [0.16, 0.38, 0.7, 1.0], [0.45, 1.0, 0.66, 0.06])
        along = unit(side + heading * (0.35 + 0.5 * w)[:, None] + 0.06 * chance.normal((2 * m, 3)))
        colour = varied(chance, FERN_LEAF * (0.75 + 0.4 * chance.one()), 2 * m, 4.0, 0.1)
        face = unit(up + 0.18 * chance.normal((2 * m, 3)))
        foliage(
            clay, _pinna(), point, along, face, size, colour, outward=up + 0.3 * side, bend=0.25
        )
    return clay


def _pinna() -> Blade:
    """A toothed pinna: five pairs of lobes on one midrib."""
    points: list[list[float]] = []
    faces: list[list[int]] = []
    lobes = 5
    for k in range(lobes):
        y0, y1 = k / lobes, (k + 1) / lobes
        w = 0.20 * (1 - y0) ** 0.8 + 0.012
        sag = -0.16 * y0 * y0
        i = len(points)
        points += [
            [0, y0, sag],
            [w, y0 + 0.17, sag + 0.02],
            [-w, y0 + 0.17, sag + 0.02],
            [0, y1, -0.16 * y1 * y1],
        ]
        faces += [[i, i + 1, i + 3], [i, i + 3, i + 2]]
    return Blade(np.array(points), np.array(faces))


def umbellifer() -> Clay:
    """Cow parsley, a metre and a half: ribbed stalks that fork, flat umbels of cream florets."""
    chance, clay = Chance(79), Clay()
    for s, (lean, tall) in enumerate([(0.05, 1.42), (-0.2, 1.1), (0.28, 0.9)]):
        root = np.array([0.05 * s - 0.05, 0.0, 0.04 * (s % 2)])
        stem = shoot(
            chance, root, np.array([lean, 1.0, 0.1 * s]), tall, (0.011, 0.005), nodes=9, wander=0.05
        )
        bark(clay, stem, STALK, sides=5)
        _umbel(chance, clay, stem.path[-1], unit(stem.path[-1] - stem.path[-2]), 0.17)
        for j, h in enumerate((0.42, 0.58, 0.74)):
            point, heading, _ = stem.at(h)
            way = spiral(heading[None], np.array([j * 2.4 + s]), 0.62)[0]
            arm = shoot(
                chance, point, way, 0.42 * tall * (1.15 - h), (0.006, 0.004), nodes=6, pull=0.5
            )
            bark(clay, arm, STALK, sides=4)
            _umbel(chance, clay, arm.path[-1], unit(arm.path[-1] - arm.path[-2] + 0.4 * UP), 0.105)
        # Lacy leaves low on the stalk: small ferns.
        for j in range(5):
            point, heading, _ = stem.at(0.04 + 0.13 * j)
            _lace(
                chance,
                clay,
                point,
                spiral(heading[None], np.array([j * 2.4 + s]), 1.0)[0],
                0.34 - 0.04 * j,
            )
    return clay


def _umbel(chance: Chance, clay: Clay, centre: Array, axis: Array, size: float) -> None:
    """Rays to a flat dome; each ray ends in a small dome of florets."""
    rays = 17
    k = np.arange(rays)
    open_angle = 1.05 * np.sqrt((k + 0.5) / rays)
    ways = spiral(np.repeat(axis[None], rays, 0), k * GOLDEN_ANGLE, open_angle)
    for way, a in zip(ways, open_angle, strict=True):
        ray = Limb(
            np.stack([centre, centre + way * size * (0.62 + 0.25 * a)]), np.array([0.0022, 0.0016])
        )
        bark(clay, ray, STALK * 1.1, sides=3)
        n = 13
        j = np.arange(n)
        axes = np.repeat(unit(way + 0.6 * axis)[None], n, 0)
        spread = spiral(axes, j * GOLDEN_ANGLE, 1.15 * np.sqrt((j + 0.5) / n))
        base = ray.path[-1] + spread * 0.17 * size
        colour = varied(chance, PETAL_CREAM, n, 3.0, 0.06)
        along = spiral(axes, chance.uniform(0, 6.28, n), 1.2)
        foliage(
            clay,
            kite(0.95, 0.1, 0.0, 0.5),
            base,
            along,
            axes,
            np.full(n, 0.115 * size),
            colour,
            outward=axes,
            bend=0.4,
        )


def _lace(chance: Chance, clay: Clay, point: Array, way: Array, length: float) -> None:
    rib = shoot(chance, point, way, length, (0.003, 0.001), nodes=6, pull=np.array([0, -0.7, 0]))
    bark(clay, rib, STALK, sides=3)
    m = 9
    nodes = [rib.at(float(w)) for w in np.linspace(0.3, 1.0, m)]
    base = np.repeat(np.array([q[0] for q in nodes]), 2, axis=0)
    heading = np.repeat(np.array([q[1] for q in nodes]), 2, axis=0)
    up = across(heading, UP)
    side = np.cross(heading, up) * np.tile([1.0, -1.0], m)[:, None]
    size = length * np.repeat(np.linspace(0.42, 0.12, m), 2)
    colour = varied(chance, FERN_LEAF * 0.9, 2 * m, 5.0, 0.12)
    foliage(
        clay, _pinna(), base, unit(side + 0.7 * heading), up, size, colour, outward=up, bend=0.25
    )


def flowers() -> Clay:
    """A drift of meadow flowers, half a metre: rose and cream heads over thin leaves."""
    chance, clay = Chance(83), Clay()
    for k in range(30):
        r, turn = 0.30 * np.sqrt((k + 0.5) / 30), k * GOLDEN_ANGLE
        root = np.array([r * np.cos(turn), 0.0, r * np.sin(turn)])
        tall = chance.one(0.30, 0.58) * (1.1 - 0.8 * r)
        stem = shoot(
            chance,
            root,
            np.array([0.5 * r * np.cos(turn), 1.0, 0.5 * r * np.sin(turn)]),
            tall,
            (0.0035, 0.002),
            nodes=6,
            wander=0.08,
        )
        bark(clay, stem, STALK, sides=3)
        axis = unit(stem.path[-1] - stem.path[-2] + 0.5 * chance.sphere(1)[0] + [0, 0.3, 0.25])
        rose = chance.one() < 0.62
        rosette(
            chance,
            clay,
            stem.path[-1],
            axis,
            7 if rose else 11,
            chance.one(0.030, 0.046),
            PETAL_ROSE if rose else PETAL_CREAM,
            1.15 if rose else 1.4,
        )
        m = 7
        nodes = [stem.at(float(w)) for w in np.linspace(0.02, 0.7, m)]
        heading = np.array([q[1] for q in nodes])
        along = spiral(heading, np.arange(m) * GOLDEN_ANGLE, 0.7)
        colour = varied(chance, STALK * [0.9, 1.05, 0.8], m, 6.0, 0.15)
        base = np.array([q[0] for q in nodes])
        size = chance.uniform(0.07, 0.15, m)
        foliage(clay, oval(0.16, 0.03, 0.3), base, along, np.repeat(UP[None], m, 0), size, colour)
    return clay


def rosette(
    chance: Chance,
    clay: Clay,
    centre: Array,
    axis: Array,
    petals: int,
    size: float,
    colour: Array,
    opening: float,
) -> None:
    """Petals round an axis and a small yellow heart."""
    turns = np.arange(petals) * (2 * np.pi / petals) + chance.one(0, 6.28)
    axes = np.repeat(axis[None], petals, axis=0)
    along = spiral(axes, turns, opening)
    hue = varied(chance, colour, petals, 4.0, 0.08)
    blade = kite(0.85, 0.12, -0.05, 0.62)
    foliage(
        clay,
        blade,
        np.repeat(centre[None], petals, 0),
        along,
        axes,
        np.full(petals, size),
        hue,
        outward=axes,
        bend=0.3,
        tip=1.1,
    )
    heart = spiral(axes[:3], np.arange(3) * 2.09, 0.7)
    foliage(
        clay,
        kite(0.9, 0.1, 0.0, 0.5),
        np.repeat((centre + 0.1 * size * axis)[None], 3, 0),
        heart,
        axes[:3],
        np.full(3, 0.36 * size),
        varied(chance, np.array([0.62, 0.40, 0.05]), 3),
    )
