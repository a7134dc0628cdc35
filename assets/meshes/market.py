"""What hangs over a night market: paper lanterns and banners."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from clay import Array, Clay, unit
from glowcaps import curve, lathe
from leaves import blend
from wood import Limb, bark

from formats.files.glb import Node

# What the paper sends out, from the middle to the ends, and its hoops before it, W/(m2 sr)
GLOW = {
    "glow_heart": (1.55, 0.50, 0.090),
    "glow_near": (1.32, 0.38, 0.062),
    "glow": (1.02, 0.255, 0.038),
    "glow_far": (0.74, 0.155, 0.023),
    "glow_edge": (0.50, 0.088, 0.013),
    "glow_end": (0.30, 0.044, 0.007),
    "hoop": (0.34, 0.065, 0.010),
}
LEVELS = (0.16, 0.36, 0.56, 0.74, 0.90)  # where one gives way to the next, from middle to end
LACQUER = np.array([0.012, 0.008, 0.008])
SILK = np.array([0.50, 0.045, 0.025])
TASSEL = np.array([0.10, 0.010, 0.006])
PAPER = np.zeros(3)  # what it reflects drowns in what it sends out
CREAM = np.array([0.74, 0.62, 0.42])
HANG = 1.5  # metres from the end of the tassel to the top of the cord
BODY = (0.17, 0.55)  # heights of the paper
ROUND = 0.215  # radius of the paper where it is widest
HOOPS = 11
SIDES = 24


class Lit(Clay):
    """Clay of which the parts named in GLOW glow."""

    def nodes(self, name: str) -> list[Node]:
        """One node, its glowing parts emissive."""
        found = []
        for node in super().nodes(name):
            parts = []
            for part in node.primitives:
                assert part.material is not None
                glow = GLOW.get(part.material.name, (0.0, 0.0, 0.0))
                parts.append(replace(part, material=replace(part.material, emissive=glow)))
            found.append(replace(node, primitives=tuple(parts)))
        return found


def turned(clay: Clay, part: str, line: Array, colour: Array, sides: int = SIDES) -> None:
    """Press a solid of revolution of one colour."""
    lathe(clay, part, line, np.broadcast_to(colour, (len(line), 3)), sides=sides)


def paper_lantern() -> Lit:
    """A round lantern of ribbed paper, 0.38 m high, on a cord, with a tassel below."""
    clay, (low, high) = Lit(), BODY
    t = np.linspace(0.30, np.pi - 0.30, HOOPS + 1)
    y = 0.5 * (low + high - (high - low) * np.cos(t) / np.cos(0.30))
    rings = np.stack([ROUND * np.sin(t) ** 0.8, y], axis=1)
    section = 0.0035 * np.array([[-1.0, -0.7], [1.0, -0.6], [1.0, 0.6], [-1.0, 0.7]])
    for k, (a, b) in enumerate(pairwise(rings)):
        # Paper bulges between its hoops
        out = (a + b) / 2 + [0.006, 0.0]
        far = abs(2 * (k + 0.5) / HOOPS - 1)
        name = list(GLOW)[int(np.searchsorted(LEVELS, far))]
        turned(clay, name, curve([(p[0], p[1]) for p in (a, out, b)], 3), PAPER)
        turned(clay, "hoop", a + section, PAPER)
    r = float(rings[0, 0])
    for at in (low - 0.012, high + 0.012):
        drawn = [(0.001, -0.024), (0.8, -0.024), (1.04, -0.018), (1.04, 0.018), (0.8, 0.024)]
        cap = [(max(x * r, 0.001), at + rise) for x, rise in [*drawn, (0.001, 0.024)]]
        turned(clay, "lacquer", np.array(cap), LACQUER, 20)
    turned(clay, "lacquer", np.array([(0.005, high), (0.005, HANG)]), LACQUER, 5)
    silk = [(0.012, 0.001), (0.020, 0.02), (0.015, 0.09), (0.006, 0.115), (0.012, 0.128)]
    turned(clay, "silk", curve([*silk, (0.004, 0.145), (0.004, 0.16)], 3), TASSEL, 9)
    return clay


def banner() -> Clay:
    """A long cloth in the wind under a rod, vermilion with a pale moon, 1.5 m high."""
    clay, wide, tall, nx, ny = Clay(), 0.46, 1.4, 27, 70
    u, v = np.meshgrid(np.linspace(-1, 1, nx), np.linspace(0, 1, ny))
    swing = v**1.3
    x = wide / 2 * u * (1 - 0.10 * swing) + 0.05 * swing * np.sin(2.6 * v)
    y = 1.46 - tall * v - 0.035 * np.cos(np.pi * u) * (v > 0.99)
    z = 0.055 * swing * np.sin(5.2 * v - 1.1 * u + 0.5) + 0.03 * np.sin(3.1 * u + 2.4 * v)
    p = np.stack([x, y, z], axis=-1)
    n = unit(np.cross(np.gradient(p, axis=1), np.gradient(p, axis=0)))
    n = np.where(n[..., 2:] < 0, -n, n)
    moon = np.clip((0.155 - np.hypot(u * wide / 2, (v - 0.30) * tall)) / 0.02, 0, 1)
    stripe = np.clip(2.0 - np.abs(np.abs(v - 0.64) - 0.025) / 0.008, 0, 1)
    colour = blend(SILK, CREAM, np.maximum(moon, stripe))
    i, j = np.meshgrid(np.arange(ny - 1), np.arange(nx - 1), indexing="ij")
    a = (i * nx + j).ravel()
    b = a + nx
    faces = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    clay.press("paper", p.reshape(-1, 3), n.reshape(-1, 3), colour.reshape(-1, 3), faces)
    rod = np.array([[-0.30, 1.47, 0.0], [0.0, 1.472, 0.0], [0.30, 1.47, 0.0]])
    bark(clay, Limb(rod, np.full(3, 0.012)), LACQUER, sides=6)
    return clay
