"""Parts of translucent things: round outlines, rims, what fills them, vesicles, grains, threads."""

import numpy as np
from canvas import Array, Canvas, band, inside, mix, smooth

WINE, PLUM, ROSE = (0.13, 0.008, 0.045), (0.30, 0.02, 0.13), (0.80, 0.10, 0.20)
CORAL, CREAM, CYAN = (1.0, 0.26, 0.15), (1.0, 0.80, 0.62), (0.10, 0.80, 0.92)
EMBER = (1.0, 0.15, 0.12)
LIGHT = 0.9  # radians: where the light stands behind them, up and to the right


class Blob:
    """A round outline that wavers.

    distance : (n, n) signed, negative inside. angle : (n, n) about its middle. depth : (n, n) share
    of its radius, 0 in the middle. facing : (n, n) 1 where the rim faces the light, 0 opposite.
    """

    def __init__(
        self, c: Canvas, at: tuple[float, float], radius: float, waver: float = 0.03
    ) -> None:
        x, y = c.x - at[0], c.y - at[1]
        self.angle = np.arctan2(y, x)
        outline = np.ones_like(x)
        for k, share in ((2, 1.0), (3, 0.6), (5, 0.25), (8, 0.1)):
            outline += waver * share * np.cos(k * self.angle + float(c.chance(0, 2 * np.pi)[0]))
        self.depth = np.hypot(x, y) / (radius * outline)
        self.distance = (self.depth - 1.0) * radius
        lean = (np.cos(LIGHT) * x + np.sin(LIGHT) * y) / (radius * outline)
        self.facing = 0.5 + 0.5 * np.clip(lean, -1.0, 1.0)


def bubble(c: Canvas, at: tuple[float, float], radius: float, colour: Array, power: float) -> None:
    """A small clear vesicle: a thin rim, a bead of light, a caustic opposite."""
    b = Blob(c, at, radius, 0.015)
    fine = max(0.055 * radius, 0.75 * c.pixel)
    c.lay(0.16 * power * inside(b.distance, 2 * c.pixel) * (0.3 + b.depth**3), colour)
    c.lay(power * (0.35 + 0.65 * b.facing) * band(b.distance + fine, fine), mix(colour, CREAM, 0.3))
    crescent = band(b.distance + 0.3 * radius, 0.14 * radius) * smooth(0.9 - 2.2 * b.facing)
    c.lay(0.5 * power * crescent, mix(colour, CREAM, 0.4))


def grains(c: Canvas, b: Blob, count: int, radii: tuple[float, float], power: float) -> None:
    """Granules in a blob, most of them small."""
    whole = float(-b.distance.min())
    for _ in range(count):
        far, turn = np.sqrt(c.chance()[0]) * 0.86, c.chance(0, 2 * np.pi)[0]
        chance = c.chance(0, 1, 2)
        radius = radii[0] * (radii[1] / radii[0]) ** (chance[0] ** 2.5)
        x, y = far * np.cos(turn), far * np.sin(turn)
        near = np.hypot(c.x - x * whole, c.y - y * whole)
        c.lay(power * (0.4 + 0.6 * chance[1]) * band(near, radius), mix(CORAL, CREAM, chance[1]))


def rims(c: Canvas, b: Blob, width: float, gap: float, power: float = 1.0) -> None:
    """A double membrane, beaded between its two lines, brighter towards the light."""
    lit = power * (0.22 + 0.78 * b.facing**1.5)
    film = mix(mix(ROSE, CORAL, b.facing), CYAN, 0.55 * band(b.facing - 0.28, 0.10))
    beads = 0.75 + 0.25 * np.cos(170 * b.angle + 2.0 * np.sin(5 * b.angle))
    c.lay(0.42 * lit * beads * band(b.distance + 0.5 * gap, 0.55 * gap), film)
    c.lay(
        0.85 * lit * band(b.distance + gap, 0.8 * width), mix(CORAL, CREAM, 0.35 + 0.3 * b.facing)
    )
    c.lay(lit * band(b.distance, width), mix(ROSE, CREAM, 0.45 + 0.55 * b.facing))
    # Light gathers on the far side, inside
    c.lay(0.18 * power * band(b.distance + 0.15, 0.09) * smooth(1 - 2.4 * b.facing), CORAL)
    # ... and spills over the near rim
    c.lay(0.22 * lit * band(b.distance, 0.055) * b.facing, CORAL)


def plasma(c: Canvas, b: Blob, dense: float, low: Array, high: Array, turns: float = 5.0) -> None:
    """What fills a cell: thicker to its rim, in clouds."""
    clouds = 0.5 + 0.22 * c.noise(turns) + 0.12 * c.noise(2.7 * turns)
    body = inside(b.distance, 3 * c.pixel)
    deep = np.clip(b.depth, 0, 1)
    thick = dense * (0.30 + 0.70 * deep**3) * (0.7 + 0.6 * clouds)
    lit = 0.10 + 0.85 * b.facing * deep**2 + 0.25 * (clouds - 0.5)
    c.lay(body * thick, mix(low, high, lit))


def threads(c: Canvas, where: Array, turns: float, power: float, colour: Array) -> None:
    """Fine curved threads: the zero lines of a noise, as thin everywhere."""
    n = c.noise(turns)
    step = 2.0 / len(n)
    slope = np.hypot(*np.gradient(n, step)) + 1e-6
    c.lay(power * where * band(n / slope, 0.8 * c.pixel) * smooth(slope / (2.2 * turns)), colour)
