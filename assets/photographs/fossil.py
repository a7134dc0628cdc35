"""A fossil in its slab: two ammonites of bronze-coloured pyrite in slate, as a height field.

Shells are logarithmic spirals (Raup 1966, Geometric Analysis of Shell Coiling): a whorl grows by a
constant factor each turn, its section is a half-ellipse, and ribs run across it and fork outside.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formats.mesh import Material, Mesh
from maths.noise import fbm

Array = NDArray[np.float64]

SIDE = 0.12  # metres of the slab
GRID = 641  # points along a side: two and a half to a pixel
SLATE, RUST = np.array([0.150, 0.168, 0.195]), np.array([0.31, 0.175, 0.085])
BRONZE, COPPER = np.array([0.72, 0.45, 0.14]), np.array([0.62, 0.23, 0.10])
VERDIGRIS = np.array([0.10, 0.34, 0.29])


@dataclass(frozen=True)
class Shell:
    """An ammonite. centre : (x, y) metres. radius : of the last whorl's middle. growth : a turn.
    turns : of the whole coil. start : angle of its mouth. ribs : a turn. sunk : metres."""

    centre: tuple[float, float]
    radius: float
    growth: float = 1.72
    turns: float = 5.6
    start: float = 0.0
    ribs: int = 34
    sunk: float = 0.0


SHELLS = (
    Shell((-0.006, 0.005), 0.0345, start=-0.55),
    Shell((0.0455, -0.0465), 0.0145, growth=1.85, start=2.6, ribs=26, sunk=0.0008),
)


def coiled(shell: Shell, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return height over the slab, metres (0 outside), how far out on its rib a point lies (0..1),
    and how deep in a seam (0..1)."""
    x, y = x - shell.centre[0], y - shell.centre[1]
    rate = np.log(shell.growth) / (2 * np.pi)
    radius = np.maximum(np.hypot(x, y), 1e-6)
    # Turns back from the mouth; whorls follow one another at whole turns
    angle = (np.arctan2(y, x) - shell.start) / (2 * np.pi) % 1.0
    along = np.log(radius / shell.radius) / (2 * np.pi * rate)
    whorl = np.round(along - angle)
    across = 2 * (along - angle - whorl)
    theta = angle + whorl  # turns from the mouth, negative inwards
    middle = shell.radius * np.exp(2 * np.pi * rate * theta)
    width = middle * (shell.growth**0.5 - shell.growth**-0.5) / 2
    section = np.sqrt(np.clip(1 - np.square(across), 0, 1))
    # Ribs sweep forward as they cross, and fork on the outer half
    phase = shell.ribs * (theta + 0.018 * across + 0.014 * np.square(across))
    single, double = (0.5 + 0.5 * np.cos(2 * np.pi * n * phase) for n in (1, 2))
    fork = np.clip((across - 0.15) / 0.4, 0, 1)
    rib = (single * (1 - fork) + double * fork) ** 1.4
    height = 0.92 * width * section**0.8 * (1 + 0.24 * (rib - 0.5) * np.sqrt(section))
    inside = (theta > -shell.turns) & (theta < 0)
    height = np.where(inside, height * np.clip(-theta * 110, 0, 1) ** 0.5, 0)
    # The first chamber is a bead
    bead = shell.radius * shell.growth ** (0.5 - shell.turns)
    height = np.maximum(height, np.sqrt(np.maximum(bead**2 - radius**2, 0)))
    return height - shell.sunk * (height > 0), rib * inside, np.where(inside, 1 - section, 0)


def slab(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return the sheets of split slate and the grain on them, metres, and rust (0..1)."""
    p = np.stack([x, y], axis=-1)
    # Slate splits in sheets: steps that wander, worn smooth
    field = 2.2 * fbm(p * 22 + [14.0, 7.0], 5, 11) + 21.0 * (0.45 * x - 0.85 * y)
    sheet = np.floor(field)
    edge = np.clip((field - sheet) / 0.16, 0, 1)
    sheets = 0.0013 * (sheet + edge * edge * (3 - 2 * edge))
    grain = 0.0011 * fbm(p * 70, 4, 23) + 0.0004 * fbm(p * 300, 2, 31)
    # A hairline crack from edge to edge
    line = y + 0.028 - 0.42 * x - 0.012 * (fbm(np.stack([x * 90, 0 * x], axis=-1), 5, 41) - 0.5)
    grain -= 0.0016 * np.exp(-np.square(line / 0.00045))
    rust = np.clip(2.6 * fbm(p * 34, 5, 53) - 1.25 + 0.5 * np.exp(-np.abs(line) / 0.004), 0, 1)
    return sheets, grain, rust


def fossil(grid: int = GRID) -> Mesh:
    """Model the slab as one mesh of grid x grid points that fills its picture, facing +z, its foot
    on y = 0."""
    ticks = (np.arange(grid) / (grid - 1) - 0.5) * SIDE
    x, y = np.meshgrid(ticks, ticks)
    p = np.stack([x, y], axis=-1)
    sheets, grain, rust = slab(x, y)
    colour = SLATE * (0.75 + 0.5 * fbm(p * 160, 3, 61))[..., None]
    colour += (RUST - colour) * (0.65 * rust)[..., None]
    away = [np.hypot(x - s.centre[0], y - s.centre[1]) / s.radius for s in SHELLS]
    levels = [float(np.median(sheets[d < 1])) for d in away]
    # The slab split where the shells lie: around each it is one sheet
    for distance, level in zip(away, levels, strict=True):
        share = np.clip((1.8 - distance + 0.8 * (fbm(p * 60, 3, 67) - 0.5)) / 0.6, 0, 1)
        sheets += (level - sheets) * share * share * (3 - 2 * share)
    height, metal = sheets + grain, np.zeros(x.shape, bool)
    for number, (shell, level) in enumerate(zip(SHELLS, levels, strict=True)):
        rise, rib, seam = coiled(shell, x, y)
        wear = fbm(p * 230, 4, 71 + number)
        top = level + 0.0008 + rise - 0.0036 * np.clip(wear - 0.55, 0, 1) * rib
        shown = (rise != 0) & (top > height)
        hue = np.clip(1.9 * fbm(p * 48 + 3, 4, 83 + number) - 0.45, 0, 1)[..., None]
        shine = BRONZE + (COPPER - BRONZE) * hue
        green = np.clip(1.7 * seam - 0.3 + 1.6 * (wear - 0.5), 0, 0.9)[..., None]
        shine = shine + (VERDIGRIS - shine) * green
        shine = shine * (0.62 + 0.38 * rib)[..., None]
        colour = np.where(shown[..., None], shine, colour)
        height = np.where(shown, top, height)
        metal |= shown & (seam < 0.75)
    return _meshed(x, y, height, np.clip(colour, 0, 1), metal)


def _meshed(x: Array, y: Array, height: Array, colour: Array, metal: NDArray[np.bool_]) -> Mesh:
    grid = len(x)
    step = SIDE / (grid - 1)
    dy, dx = np.gradient(height, step)
    normal = np.stack([-dx, -dy, np.ones_like(dx)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    i = np.arange(grid * grid).reshape(grid, grid)
    a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(
        vertices=np.stack([x, y + SIDE / 2, height - height.min()], axis=-1).reshape(-1, 3),
        faces=faces,
        normals=normal.reshape(-1, 3)[faces].astype(np.float32),
        material=np.tile(metal.ravel()[a], 2).astype(np.int32),
        materials=(
            Material("slate", (1.0, 1.0, 1.0), roughness=0.75),
            Material("pyrite", (1.0, 1.0, 1.0), roughness=0.5, metallic=0.85),
        ),
        colours=colour.reshape(-1, 3).astype(np.float32),
    )
