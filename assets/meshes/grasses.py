"""Grasses: three tufts and a reed, every blade a tapered ribbon that bends under its own weight."""

import numpy as np
from chance import Chance
from clay import Array, Clay, across, unit
from leaves import GOLDEN_ANGLE, Blade, foliage, kite, varied
from wood import UP, bark, shoot

GREEN = np.array([0.150, 0.230, 0.045])
STRAW = np.array([0.460, 0.340, 0.130])
SEDGE = np.array([0.095, 0.175, 0.055])


def ribbon(bow: float, width: float, segments: int = 5) -> Blade:
    """A blade of unit arc length whose tangent turns by `bow` radians towards +z."""
    s = np.linspace(0.0, 1.0, segments + 1)
    angle = bow * s**1.6
    step = np.stack([np.zeros(segments), np.cos(angle[:-1]), np.sin(angle[:-1])], 1) / segments
    spine = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])
    half = 0.5 * width * np.interp(s, [0, 0.25, 1.0], [0.6, 1.0, 0.0])
    left, right = spine[:-1] - half[:-1, None] * [1, 0, 0], spine[:-1] + half[:-1, None] * [1, 0, 0]
    points = np.concatenate([np.stack([left, right], 1).reshape(-1, 3), spine[-1:]])
    faces = []
    for k in range(segments - 1):
        a = 2 * k
        faces += [[a, a + 1, a + 3], [a, a + 3, a + 2]]
    last = 2 * (segments - 1)
    faces.append([last, last + 1, last + 2])
    return Blade(points, np.array(faces))


def _tuft(
    chance: Chance,
    clay: Clay,
    count: int,
    spread: float,
    height: tuple[float, float],
    lean: float,
    bow: tuple[float, float],
    width: float,
    green: Array,
    tip: Array,
) -> None:
    """Blades from a small disc, opening outwards; dry ones lean further."""
    for sheaf in range(9):
        n = count // 9
        k = sheaf + 9 * np.arange(n)
        r, turn = spread * np.sqrt((k + 0.5) / count), k * GOLDEN_ANGLE
        out = np.stack([np.cos(turn), np.zeros(n), np.sin(turn)], 1)
        out = unit(out + 0.7 * chance.normal((n, 3)) * [1, 0, 1])
        open_ = lean * (0.25 + r / spread * chance.uniform(0.5, 1.3, n))
        along = unit(UP * np.cos(open_)[:, None] + out * np.sin(open_)[:, None])
        size = chance.uniform(*height, n) * (1.1 - 0.35 * r / spread)
        dry = (chance.uniform(size=n) < 0.2)[:, None]
        colour = varied(chance, np.where(dry, tip, green), n, 5.0, 0.16)
        blade = ribbon(bow[0] + (bow[1] - bow[0]) * sheaf / 8.0, width)
        base = r[:, None] * np.stack([np.cos(turn), np.zeros(n), np.sin(turn)], 1)
        foliage(
            clay, blade, base, along, out, size, colour, outward=0.6 * out + UP, bend=0.45, tip=1.45
        )


def meadow_grass() -> Clay:
    """Half a metre: upright, dense, the floor of the clearing."""
    chance, clay = Chance(101), Clay()
    _tuft(chance, clay, 198, 0.16, (0.26, 0.52), 0.55, (0.3, 1.6), 0.022, GREEN, STRAW)
    return clay


def sedge() -> Clay:
    """Seventy centimetres: a fountain of long arching blades."""
    chance, clay = Chance(103), Clay()
    _tuft(chance, clay, 162, 0.10, (0.55, 0.95), 0.75, (0.9, 2.5), 0.016, SEDGE, GREEN)
    return clay


def seeded_grass() -> Clay:
    """A metre: thin straw stalks with nodding panicles above a low green foot."""
    chance, clay = Chance(107), Clay()
    _tuft(chance, clay, 126, 0.14, (0.25, 0.50), 0.6, (0.5, 1.9), 0.018, GREEN, STRAW)
    for k in range(26):
        turn = k * GOLDEN_ANGLE
        r = 0.10 * np.sqrt((k + 0.5) / 26)
        way = np.array([np.cos(turn) * 3.2 * r, 1.0, np.sin(turn) * 3.2 * r])
        nod = 0.65 * unit(way * [1, 0, 1]) + [0.12, -0.25, 0]
        stalk = shoot(
            chance,
            np.array([r * np.cos(turn), 0, r * np.sin(turn)]),
            way,
            chance.one(0.72, 1.05),
            (0.0028, 0.0012),
            nodes=10,
            wander=0.02,
            pull=nod,
        )
        bark(clay, stalk, STRAW * 0.85, sides=3)
        m = 34
        where = np.linspace(0.70, 1.0, m)
        nodes = [stalk.at(float(w)) for w in where]
        heading = np.array([q[1] for q in nodes])
        side = across(heading, chance.sphere(m))
        plume = np.interp(where, [0.70, 0.80, 1.0], [0.3, 1.0, 0.35])
        base = (
            np.array([q[0] for q in nodes])
            + side * (0.022 * plume * chance.uniform(0, 1, m))[:, None]
        )
        along = unit(heading + 0.7 * side + [0, -0.25, 0])
        colour = varied(chance, STRAW * [1.1, 1.0, 0.95], m, 5.0, 0.14)
        foliage(clay, kite(0.28, 0.05, 0.1, 0.45), base, along, side, 0.028 + 0.018 * plume, colour)
    return clay


def reeds() -> Clay:
    """Two metres of reed: stiff stalks, sword leaves and dark plumes."""
    chance, clay = Chance(109), Clay()
    for k in range(19):
        turn, r = k * GOLDEN_ANGLE, 0.30 * np.sqrt((k + 0.5) / 19)
        root = np.array([r * np.cos(turn), 0.0, r * np.sin(turn)])
        tall = chance.one(1.35, 2.05)
        stalk = shoot(
            chance,
            root,
            UP + 0.22 * chance.normal(3) * [1, 0, 1],
            tall,
            (0.008, 0.003),
            nodes=9,
            wander=0.02,
            pull=np.array([0.22, 0, 0]),
        )
        bark(clay, stalk, STRAW * [0.8, 0.95, 0.8], sides=4)
        m = 7
        nodes = [stalk.at(float(w)) for w in np.linspace(0.15, 0.82, m)]
        out = unit(chance.sphere(m) * [1, 0, 1] + [0.25, 0, 0])
        along = unit(np.array([q[1] for q in nodes]) + 0.45 * out)
        base = np.array([q[0] for q in nodes])
        colour = varied(chance, GREEN * [0.95, 0.95, 1.1], m, 5.0, 0.14)
        size = chance.uniform(0.40, 0.62, m)
        foliage(clay, ribbon(1.5, 0.045), base, along, out, size, colour, tip=1.35, bend=0.0)
        _plume(chance, clay, stalk.path[-1], unit(stalk.path[-1] - stalk.path[-2]))
    return clay


def _plume(chance: Chance, clay: Clay, tip: Array, heading: Array) -> None:
    m = 70
    h = np.linspace(0, 1, m)
    lean = heading * (0.30 * h)[:, None] + np.array([0.09, -0.05, 0.0]) * (h**2)[:, None]
    side = across(np.repeat(heading[None], m, 0), chance.sphere(m))
    base = tip - 0.05 * heading + lean
    along = unit(heading + 0.55 * side + [0.35, -0.2, 0])
    size = np.interp(h, [0, 0.3, 1], [0.06, 0.10, 0.035])
    colour = varied(chance, np.array([0.30, 0.20, 0.145]), m, 5.0, 0.18)
    foliage(clay, kite(0.16, 0.04, 0.15, 0.5), base, along, side, size, colour, outward=side)
