"""Leaves: folded and curved blades of a few triangles, set in phyllotaxis, coloured one by one."""

from dataclasses import dataclass

import numpy as np
from chance import Chance
from clay import Array, Clay, across, unit
from numpy.typing import NDArray

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True)
class Blade:
    """A leaf of unit length: points (n, 3), x across, y from stalk to tip, z out of its face."""

    points: Array
    triangles: NDArray[np.int64]


def kite(width: float, fold: float = 0.12, droop: float = 0.1, widest: float = 0.42) -> Blade:
    """Two triangles that share the midrib."""
    points = [[0, 0, 0], [width / 2, widest, fold], [0, 1, -droop], [-width / 2, widest, fold]]
    return Blade(np.array(points, dtype=np.float64), np.array([[0, 1, 2], [0, 2, 3]]))


def oval(width: float, fold: float = 0.1, droop: float = 0.2) -> Blade:
    """Six triangles: two across the fold at the stalk, two in the middle, two at the tip."""
    w = width / 2
    points = [
        [0, 0, 0],
        [w * 0.92, 0.3, fold],
        [0, 0.34, 0],
        [-w * 0.92, 0.3, fold],
        [w * 0.8, 0.66, fold * 0.7 - droop * 0.35],
        [-w * 0.8, 0.66, fold * 0.7 - droop * 0.35],
        [0, 1, -droop],
    ]
    faces = [[0, 1, 2], [0, 2, 3], [1, 4, 2], [2, 5, 3], [2, 4, 6], [2, 6, 5]]
    return Blade(np.array(points, dtype=np.float64), np.array(faces))


def blend(inner: Array, outer: Array, amount: Array | float) -> Array:
    """Linear mixture of two colours or vectors, amount 0..1 broadcast over the last axis."""
    mix = np.asarray(amount, dtype=np.float64)[..., None]
    return np.asarray(inner) * (1.0 - mix) + np.asarray(outer) * mix


def varied(
    chance: Chance, colour: Array, count: int, hue: float = 7.0, value: float = 0.18
) -> Array:
    """Colours (count, 3) round a linear one: hue in degrees and relative value, one sigma each."""
    turn = np.radians(hue) * chance.normal(count)[:, None]
    grey = np.ones(3) / np.sqrt(3.0)
    base = np.broadcast_to(np.asarray(colour, dtype=np.float64), (count, 3))
    # Rodrigues' rotation about the grey axis.
    turned = (
        base * np.cos(turn)
        + np.cross(grey, base) * np.sin(turn)
        + grey * (base @ grey)[:, None] * (1.0 - np.cos(turn))
    )
    return np.clip(turned * np.exp(value * chance.normal(count))[:, None], 0.004, 0.95)


def spiral(directions: Array, turns: Array, open_angle: Array | float) -> Array:
    """Directions (n, 3) turned by `turns` radians round unit `directions`, opened from them."""
    side = across(directions, np.array([0.0, 1.0, 0.0]))
    other = np.cross(directions, side)
    out = side * np.cos(turns)[:, None] + other * np.sin(turns)[:, None]
    angle = np.broadcast_to(np.asarray(open_angle, dtype=np.float64), turns.shape)[:, None]
    return directions * np.cos(angle) + out * np.sin(angle)


def foliage(
    clay: Clay,
    blade: Blade,
    base: Array,
    along: Array,
    face: Array,
    size: Array,
    colour: Array,
    *,
    outward: Array | None = None,
    bend: float = 0.4,
    tip: float = 1.15,
    part: str = "leaf",
) -> None:
    """Press leaves: base (n, 3), along and face directions (n, 3), length (n,), colour (n, 3).

    `outward` (n, 3): the crown's outward directions; normals lean that way by `bend` (0..1).
    `tip` brightens the leaf from stalk to tip."""
    along = unit(along)
    z = across(along, face)
    x = np.cross(along, z)
    local = blade.points * np.asarray(size, dtype=np.float64)[:, None, None]
    positions = base[:, None] + (
        local[..., :1] * x[:, None] + local[..., 1:2] * along[:, None] + local[..., 2:] * z[:, None]
    )
    # A vertex normal is the mean of its faces' normals, turned to the leaf's own side.
    corners = positions[:, blade.triangles]
    flat = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    normals = np.zeros_like(positions)
    for f, triangle in enumerate(blade.triangles):
        for vertex in triangle:
            normals[:, vertex] += flat[:, f]
    normals = unit(normals)
    turned = np.zeros(len(positions), dtype=bool)
    if outward is not None:
        out = unit(outward)[:, None]
        # Turn the whole leaf, winding and normals, to show its upper side outwards.
        turned = np.sum(normals * out, axis=(1, 2)) < 0.0
        normals = np.where(turned[:, None, None], -normals, normals)
        normals = unit(blend(normals, np.broadcast_to(out, normals.shape), bend))
    shade = 1.0 + (tip - 1.0) * (2.0 * blade.points[:, 1] - 1.0)
    colours = np.clip(colour[:, None] * shade[None, :, None], 0.0, 1.0)
    n, v = positions.shape[:2]
    winding = np.where(turned[:, None, None], blade.triangles[:, ::-1], blade.triangles)
    triangles = winding + (np.arange(n) * v)[:, None, None]
    # Pieces stay small enough to share a primitive of 65,535 vertices.
    for s in range(0, n, 2000):
        e = min(n, s + 2000)
        clay.press(
            part,
            positions[s:e].reshape(-1, 3),
            normals[s:e].reshape(-1, 3),
            colours[s:e].reshape(-1, 3),
            (triangles[s:e] - s * v).reshape(-1, 3),
        )
