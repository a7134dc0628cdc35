"""Glowcaps: mushrooms that are lamps, with gills that glow under their caps; and a firefly."""

from dataclasses import replace

import numpy as np
from chance import Chance
from clay import Array, Clay, unit
from leaves import GOLDEN_ANGLE, blend, varied
from stonework import boulder

from formats.files.glb import Node

UP = np.array([0.0, 1.0, 0.0])
STEM = np.array([0.560, 0.470, 0.340])
CROWN = np.array([0.110, 0.022, 0.026])
RIM = np.array([0.420, 0.120, 0.040])
WART = np.array([0.720, 0.640, 0.520])
GILL = np.array([0.800, 0.560, 0.300])
GLOW = {"gill": (1.5, 0.56, 0.13), "light": (7.0, 11.0, 2.2)}  # radiance, W/(m2 sr)
SMOOTH = 5  # points between two of a drawn profile


def curve(points: list[tuple[float, float]], each: int = SMOOTH) -> Array:
    """A smooth line (n, 2) through points of radius and height: a Catmull-Rom spline."""
    p = np.array([points[0], *points, points[-1]])
    s = (np.arange(each) / each)[:, None]
    a, b, c, d = (p[k : len(p) - 3 + k][:, None] for k in range(4))
    line = b + s / 2 * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)))
    return np.concatenate([line.reshape(-1, 2), p[-1:]])


def lathe(
    clay: Clay, part: str, profile: Array, colour: Array, *, sides: int, wave: Array | float = 0.0
) -> None:
    """Press a smooth solid of revolution, profile (n, 2) from the axis outwards or upwards, faces
    to the left of its way; colour (n, 3) a ring. wave : lowers points by (n, sides + 1) metres."""
    turn = np.arange(sides + 1) * (2 * np.pi / sides)
    r, y = profile[:, :1], profile[:, 1:]
    height = np.broadcast_to(y - wave, (len(profile), sides + 1))
    p = np.stack([r * np.cos(turn), height, r * np.sin(turn)], axis=-1)
    along = np.gradient(p, axis=0)
    around = np.roll(p[:, :-1], -1, axis=1) - np.roll(p[:, :-1], 1, axis=1)
    around = np.concatenate([around, around[:, :1]], axis=1)
    flat = np.linalg.norm(around, axis=-1, keepdims=True) < 1e-9
    tangent = np.stack([-np.sin(turn), 0 * turn, np.cos(turn)], axis=-1)
    around = np.where(flat, tangent, around)
    normals = unit(np.cross(along, around))
    i, j = np.meshgrid(np.arange(len(p) - 1), np.arange(sides), indexing="ij")
    a = (i * (sides + 1) + j).ravel()
    b = a + sides + 1
    faces = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    tones = np.repeat(colour[:, None], sides + 1, axis=1).reshape(-1, 3)
    clay.press(part, p.reshape(-1, 3), normals.reshape(-1, 3), tones, faces)


def glowcap(
    chance: Chance, tall: float, wide: float, bell: float, *, lean: Array, warts: int
) -> Clay:
    """One mushroom `tall` metres high with a cap of radius `wide`. bell : 0 flat .. 1 a bell.

    lean (2,) : how far its top leans, metres along x and z."""
    one = Clay()
    rise, sag = wide * (0.42 + 0.5 * bell), wide * 0.55 * bell
    rim = tall - rise
    # Cap: a low boss in the middle, shoulders, a rim that rolls in
    drawn = [(0.0, 1.0), (0.22, 0.965), (0.55, 0.78), (0.84, 0.43), (1.0, 0.06), (0.985, -0.03)]
    cap = curve([(wide * x, rim + rise * y - sag * x**3) for x, y in drawn])
    x = np.clip(cap[:, :1] / wide, 0, 1)
    lathe(one, "cap", cap[::-1], blend(CROWN, RIM, x**2.2)[::-1], sides=40)
    top = cap[np.linspace(2, 16, 60).astype(int)]
    for k in range(warts):
        at = top[int(chance.one(0, 60))]
        place = np.array(
            [at[0] * np.cos(k * GOLDEN_ANGLE), at[1], at[0] * np.sin(k * GOLDEN_ANGLE)]
        )
        _wart(one, chance, place, wide * chance.one(0.03, 0.075))
    # Gills: folds from the stem to the rim, deepest half way
    s = np.linspace(0, 1, 5)
    under = np.stack([wide * (0.12 + 0.85 * s), rim + wide * (0.16 - 0.19 * s) - sag * s**3], 1)
    folds = np.where(np.arange(73) % 2, 1.0, 0.0) * (np.sin(np.pi * s) * 0.05 * wide)[:, None]
    lathe(one, "gill", under, np.broadcast_to(GILL, (5, 3)), sides=72, wave=folds)
    # Stem: a bulb, a waist, a ring, and a flare into the cap
    foot = wide * 0.20
    line = [(1.9, 0.0), (1.65, 0.07), (1.1, 0.24), (0.85, 0.5), (0.78, 0.72), (1.0, 1.02)]
    stem = curve([(foot * q, (rim + 0.14 * wide) * h) for q, h in line], 4)
    t = (stem[:, 1:] / tall) ** 2
    lathe(one, "stem", stem, blend(STEM * 0.42, STEM, np.clip(2.2 * t + 0.1, 0, 1)), sides=20)
    skirt = curve([(foot * 0.8, rim * 0.80), (foot * 1.5, rim * 0.77), (foot * 2.0, rim * 0.68)], 3)
    lathe(one, "stem", skirt[::-1], np.broadcast_to(STEM * 0.9, (len(skirt), 3)), sides=24)
    bent = Clay()
    for part in one.parts:
        p, n, c, f = one.merged(part)
        h = (p[:, 1:2] / tall) ** 2
        bent.press(part, p + h * np.array([lean[0], 0.0, lean[1]]), n, c, f)
    return bent


def _wart(clay: Clay, chance: Chance, place: Array, size: float) -> None:
    """A low scale on the cap, five-sided."""
    turn = np.arange(5) * (2 * np.pi / 5) + chance.one(0, 6)
    ring = np.stack([np.cos(turn), 0 * turn - 0.5, np.sin(turn)], 1) * chance.uniform(
        0.7, 1, (5, 1)
    )
    out = unit(place * [1, 0, 1]) * 0.25
    p = place + size * np.concatenate([ring, ring * [0.6, 0, 0.6] + [0, 0.3, 0], [[0, 0.42, 0]]])
    n = unit(np.concatenate([ring + 0.9 * UP, ring * 0.4 + [0, 1, 0], [[0, 1, 0]]]) + out)
    k, after = np.arange(5), (np.arange(5) + 1) % 5
    faces = [np.stack(f, 1) for f in ((k, k + 5, after), (after, k + 5, after + 5))]
    faces.append(np.stack([k + 5, np.full(5, 10), after + 5], 1))
    clay.press("wart", p, n, varied(chance, WART, 11, 3.0, 0.08), np.concatenate(faces))


def glowing(nodes: list[Node]) -> list[Node]:
    """The same nodes; what is named in GLOW glows."""

    def lit(node: Node) -> Node:
        parts = []
        for part in node.primitives:
            assert part.material is not None
            glow = GLOW.get(part.material.name, (0.0, 0.0, 0.0))
            parts.append(replace(part, material=replace(part.material, emissive=glow)))
        return replace(node, primitives=tuple(parts))

    return [lit(node) for node in nodes]


class Glowing(Clay):
    """Clay of which the parts named in GLOW glow."""

    def nodes(self, name: str) -> list[Node]:
        """One node, its glowing parts emissive."""
        return glowing(super().nodes(name))


def parasol() -> Glowing:
    """A hand high and wide: one broad cap with scales. Its gills lie 0.118 m over the ground."""
    clay = Glowing()
    clay.parts = glowcap(
        Chance(151), 0.165, 0.085, 0.08, lean=np.array([0.012, 0.0]), warts=26
    ).parts
    return clay


def bell() -> Glowing:
    """Half a hand high: a slender bell."""
    clay = Glowing()
    clay.parts = glowcap(
        Chance(157), 0.125, 0.042, 0.55, lean=np.array([-0.014, 0.004]), warts=9
    ).parts
    return clay


def firefly() -> Glowing:
    """A ball of light of 4 mm radius that rests on its origin."""
    clay = Glowing()
    p, faces = boulder(2)
    clay.press("light", 0.004 * (p + UP), p, np.full(3, 0.05), faces)
    return clay
