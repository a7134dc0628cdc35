"""Draw the sprites of the scene `cells`: translucent things as a microscope shows them, backlit.

    python assets/pictures/cells.py [FOLDER] [NAME ...]

Each is a closed form of its seed: an outline of a few harmonics, its rims as bells over the signed
distance, grains and threads of a noise. Linear colours; alpha is low inside and dense at the rim.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from blobs import (
    CORAL,
    CREAM,
    CYAN,
    EMBER,
    PLUM,
    ROSE,
    WINE,
    Blob,
    bubble,
    grains,
    plasma,
    rims,
    threads,
)
from canvas import Canvas, band, inside, mix, smooth


def nucleus_in(c: Canvas, at: tuple[float, float], radius: float) -> None:
    """A nucleus: wine, mottled, with its own rim and a bright nucleolus."""
    b = Blob(c, at, radius, 0.03)
    body = inside(b.distance, 4 * c.pixel)
    mottle = 0.5 + 0.25 * c.noise(9.0 / radius * 0.3) + 0.2 * c.noise(22.0)
    c.lay(
        body * (0.62 + 0.2 * b.depth),
        mix(WINE, ROSE, 0.22 + 0.5 * b.facing * b.depth + 0.30 * (mottle - 0.5)),
    )
    threads(c, body, 14.0, 0.30, np.array(ROSE))
    c.lay(0.7 * (0.3 + 0.7 * b.facing) * band(b.distance + 0.012, 0.009), mix(ROSE, CREAM, 0.4))
    c.lay(0.28 * (0.2 + 0.8 * b.facing) * band(b.distance + 0.045, 0.03), CORAL)
    spot = np.hypot(c.x - at[0] - 0.30 * radius, c.y - at[1] - 0.22 * radius)
    c.lay(
        0.9 * inside(spot - 0.24 * radius, 0.10 * radius),
        mix(CORAL, CREAM, inside(spot - 0.13 * radius, 0.2 * radius)),
    )


def cell(c: Canvas) -> None:
    """The subject: membrane, plasma, threads, nucleus, vesicles."""
    b = Blob(c, (0.0, 0.0), 0.84, 0.022)
    plasma(c, b, 0.34, np.array(WINE), np.array(EMBER))
    body = inside(b.distance + 0.10, 0.10)
    threads(c, body * (0.35 + 0.65 * b.facing), 6.0, 0.22, np.array(CORAL))
    threads(c, body * b.facing, 13.0, 0.12, np.array(CREAM))
    grains(c, b, 90, (0.004, 0.016), 0.75)
    nucleus_in(c, (-0.17, -0.10), 0.31)
    for x, y, r in (
        (0.38, 0.30, 0.11),
        (0.50, 0.08, 0.06),
        (0.16, 0.52, 0.075),
        (-0.44, 0.40, 0.09),
        (0.30, -0.46, 0.10),
        (-0.58, 0.10, 0.045),
        (0.04, -0.62, 0.05),
        (0.57, -0.24, 0.05),
    ):
        bubble(c, (x, y), r, np.array(CREAM if r > 0.1 else CORAL), 0.62)
    for x, y, r in ((0.30, 0.12, 0.042), (0.23, 0.20, 0.024), (0.37, 0.155, 0.016)):
        bubble(c, (x, y), r, np.array(CYAN), 1.0)
    rims(c, b, 0.0075, 0.042)


def ring(c: Canvas) -> None:
    """An empty ring: a ghost of a cell."""
    b = Blob(c, (0.0, 0.0), 0.84, 0.03)
    c.lay(0.07 * inside(b.distance, 0.02) * (0.3 + b.depth**4), ROSE)
    rims(c, b, 0.014, 0.075, 0.9)


def disc(c: Canvas) -> None:
    """A disc hollow on both sides, as blood has them."""
    b = Blob(c, (0.0, 0.0), 0.84, 0.014)
    body = inside(b.distance, 0.03)
    thick = 0.30 + 0.55 * smooth(b.depth / 0.75) - 0.15 * smooth((b.depth - 0.7) / 0.3)
    c.lay(body * thick, mix(PLUM, CORAL, 0.15 + 0.75 * b.facing * smooth(b.depth * 1.1)))
    c.lay(0.45 * band(b.distance + 0.045, 0.05) * (0.15 + 0.85 * b.facing), mix(CORAL, CREAM, 0.5))
    c.lay(0.35 * band(b.depth - 0.42, 0.12) * smooth(1.0 - 1.7 * b.facing), CORAL)


def vacuole(c: Canvas) -> None:
    """A pale cell full of bubbles, without a nucleus."""
    b = Blob(c, (0.0, 0.0), 0.84, 0.035)
    plasma(c, b, 0.34, np.array(PLUM), mix(CORAL, CREAM, 0.35), 4.0)
    taken: list[tuple[float, float, float]] = []
    for _ in range(400):
        far, turn = 0.70 * np.sqrt(c.chance()[0]), c.chance(0, 2 * np.pi)[0]
        r = 0.035 * (7.0 ** (c.chance()[0] ** 1.6))
        x, y = far * np.cos(turn), far * np.sin(turn)
        if np.hypot(x, y) + r < 0.77 and all(np.hypot(x - p, y - q) > r + s for p, q, s in taken):
            taken.append((float(x), float(y), float(r)))
            bubble(c, (float(x), float(y)), float(r), mix(ROSE, CREAM, c.chance()[0]), 0.55)
    rims(c, b, 0.012, 0.06)


def cluster(c: Canvas) -> None:
    """A handful of cells that have just parted, those behind first."""
    for i in range(11):
        turn, far = 2.39996 * i + 0.4, 0.50 * np.sqrt((10 - i) / 10.5)
        at = float(far * np.cos(turn)), float(far * np.sin(turn))
        b = Blob(c, at, 0.29, 0.03)
        body = inside(b.distance, 3 * c.pixel)
        c.lay(body * (0.38 + 0.35 * b.depth**2), mix(PLUM, CORAL, 0.1 + 0.8 * b.facing * b.depth))
        spot = np.hypot(c.x - at[0] + 0.03, c.y - at[1] + 0.02)
        c.lay(0.6 * inside(spot - 0.09, 0.05), mix(WINE, ROSE, 0.5))
        c.lay(
            (0.15 + 0.75 * b.facing) * band(b.distance + 0.014, 0.014), mix(ROSE, CREAM, b.facing)
        )


def torn(c: Canvas) -> None:
    """A ring that has opened; its ends fray."""
    b = Blob(c, (0.0, 0.05), 0.78, 0.06)
    fray = 0.25 * c.noise(9.0) + 0.12 * c.noise(30.0)
    whole = smooth((np.abs(np.angle(np.exp(1j * (b.angle + 2.0)))) - 0.75 + fray) / 0.35)
    for shift, width, power in (
        (0.0, 0.013, 0.95),
        (0.06, 0.010, 0.7),
        (0.115, 0.008, 0.45),
        (0.16, 0.006, 0.3),
    ):
        wave = 0.02 * np.sin(3 * b.angle + 30 * shift) * (1 - whole)
        line = band(b.distance + shift + wave, width) * whole
        c.lay(power * (0.3 + 0.7 * b.facing) * line, mix(CORAL, CREAM, 0.8 * b.facing))
    c.lay(0.20 * band(b.distance + 0.08, 0.09) * whole, ROSE)


def filaments(c: Canvas) -> None:
    """A bundle of fibres that splay at both ends."""
    along = np.clip(c.x, -0.95, 0.95)
    ends = smooth((0.93 - np.abs(c.x)) / 0.5)
    for i in range(15):
        t, phase = (i - 7) / 7, float(c.chance(0, 2 * np.pi)[0])
        spread = 0.05 + 0.30 * along**2 + 0.10 * np.maximum(along, 0) ** 3
        y = 0.22 * np.sin(2.1 * along + 0.4) + t * spread + 0.015 * np.sin(9 * along + phase)
        lit, width = float(c.chance(0.25, 1.0)[0]), float(c.chance(0.006, 0.014)[0])
        c.lay(0.8 * lit * ends * band(c.y - y, width), mix(ROSE, CREAM, lit**2))
    c.lay(0.16 * ends * band(c.y - 0.22 * np.sin(2.1 * along + 0.4), 0.16), CORAL)


def vesicle(c: Canvas) -> None:
    """The accent: a small sphere of cold light."""
    b = Blob(c, (0.0, 0.0), 0.46, 0.008)
    body = inside(b.distance, 0.03)
    c.lay(body * (0.22 + 0.45 * b.depth**3), mix((0.02, 0.20, 0.34), CYAN, 0.3 + 0.5 * b.facing))
    c.lay(0.24 * band(np.maximum(b.distance, 0.0), 0.17), CYAN)
    c.lay(0.6 * band(b.distance + 0.13, 0.07) * smooth(1 - 2 * b.facing), CYAN)
    c.lay(
        (0.35 + 0.65 * b.facing) * band(b.distance + 0.02, 0.022),
        mix(CYAN, (0.85, 1.0, 1.0), b.facing),
    )
    spark = np.hypot(c.x - 0.15, c.y - 0.19)
    c.lay(0.95 * inside(spark - 0.06, 0.06), (0.9, 1.0, 1.0))


def lamp(c: Canvas) -> None:
    """The light behind everything: cream, coral, rose, wine, and never quite black."""
    r = np.hypot(c.x, c.y)
    found = np.full((*r.shape, 3), 0.13) * WINE
    glow = ((0.085, CREAM, 0.42), (0.175, CORAL, 0.40), (0.32, ROSE, 0.30), (0.62, WINE, 0.55))
    for width, colour, power in glow:
        found += power * band(r, width)[..., None] * np.array(colour)
    c.lay(np.ones_like(r), np.minimum(found, 1.0))


SPRITES: dict[str, tuple[Callable[[Canvas], None], int, int]] = {
    "cell": (cell, 480, 7),
    "ring": (ring, 192, 1),
    "disc": (disc, 128, 2),
    "vacuole": (vacuole, 256, 3),
    "cluster": (cluster, 192, 4),
    "torn": (torn, 256, 5),
    "filaments": (filaments, 256, 6),
    "vesicle": (vesicle, 128, 8),
    "lamp": (lamp, 128, 10),
}


def main() -> None:
    """Draw all of them, or those that are named."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for name in sys.argv[2:] or SPRITES:
        draw, size, seed = SPRITES[name]
        canvas = Canvas(size, seed)
        draw(canvas)
        canvas.save(folder / f"{name}.png")


if __name__ == "__main__":
    main()
