"""Which sprites stand in the shadow of others: the share of a sun that reaches each.

The same body of revolution that throws a shadow on the ground hides the sun from what stands in it;
without it, undergrowth would shine in the middle of a tree's shadow. A caster's coverage is looked
up at a coarse level, so that shares change smoothly as the sun moves.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PAIRS = 500_000  # of receiver and caster at most: where there are more, the tallest casters count
SLICES = (0.125, 0.375, 0.625, 0.875)  # of the part of a body that a ray crosses
STEEPEST = 20.0  # tangent of the sun's elevation
PARTS = np.array([0.2, 0.5, 0.8])  # of a receiver's height
ROWS = 24  # of the coarse coverage, at most
OPAQUE = 0.97  # of a sun that full coverage hides: light finds a way round leaves


def shares(sets: list[Any], to_light: Array) -> list[Array]:
    """Return the share (n,), 0..1, of a sun that reaches the sprites of each set.

    sets : runtime.sprites.SpriteSet, those with `shadow` cast. to_light : (3,) unit.
    """
    level = float(np.hypot(to_light[0], to_light[2]))
    if to_light[1] <= 0:
        return [np.ones(len(s.positions)) for s in sets]
    # A sun straight above has no direction on the ground: any one will do
    towards = to_light[[0, 2]] / level if level > 1e-6 else np.array([0.0, -1.0])
    tangent = min(float(to_light[1] / max(level, 1e-6)), STEEPEST)
    positions = np.concatenate([np.empty((0, 3)), *(s.positions for s in sets)])
    heights = np.concatenate([np.empty(0), *(s.asset.height * s.scale for s in sets)])
    ends = np.cumsum([0] + [len(s.positions) for s in sets])
    share = np.ones(len(positions))
    for casters, chosen, first in zip(sets, _tallest(sets), ends[:-1], strict=True):
        if len(chosen):
            selves = first + chosen
            share *= _let_through(positions, heights, selves, casters, chosen, towards, tangent)
    return np.split(share, ends[1:-1])


def _tallest(sets: list[Any]) -> list[NDArray[np.int64]]:
    """Return the numbers of the sprites of each set that cast, tallest first over all sets."""
    receivers = max(1, sum(len(s.positions) for s in sets))
    heights = [s.asset.height * s.scale if s.shadow else np.empty(0) for s in sets]
    every = np.sort(np.concatenate([np.empty(0), *heights]))[::-1]
    kept = every[: max(1, PAIRS // receivers)]
    least = kept[-1] if len(kept) else 0.0
    return [np.flatnonzero(h >= least) for h in heights]


def _let_through(
    positions: Array,
    heights: Array,
    selves: NDArray[np.int64],
    casters: Any,
    chosen: NDArray[np.int64],
    towards: Array,
    tangent: float,
) -> Array:
    """Return the share (n,) that the chosen casters, receivers number `selves`, let through."""
    n = len(positions)
    size = casters.scale[chosen]
    # A texel more: bilinear coverage fades beyond the outline
    radius = (casters.crown + casters.coarse_texel) * size
    height = (casters.asset.height + casters.coarse_texel) * size
    # Where the casters stand as seen from the receivers: along the light and beside it
    offset = casters.positions[chosen][None, :, ::2] - positions[:, None, ::2]
    along = offset @ towards
    beside = np.abs(offset @ np.array([-towards[1], towards[0]]))
    near = (beside < radius) & (along > -radius) & (along < height / tangent + radius)
    near[selves, np.arange(len(chosen))] = False
    which, caster = np.nonzero(near)
    if not len(which):
        return np.ones(n)
    along, beside = along[which, caster], beside[which, caster]
    size, radius, height = size[caster], radius[caster], height[caster]
    base = casters.positions[chosen][caster, 1]
    total = np.zeros(n)
    for part in PARTS:
        start = positions[:, 1] + part * heights
        # Distances before and behind the body's axis between which the ray is as high as the body
        foot = start[which] - base
        low = np.maximum(-radius, along - (height - foot) / tangent)
        high = np.minimum(np.minimum(radius, along), along + foot / tangent)
        hidden = np.zeros(len(which))
        for part_of_slices in SLICES:
            across = low + part_of_slices * np.maximum(high - low, 0.0)
            rise = foot + (along - across) * tangent
            cover = _coverage(casters, np.hypot(beside, across) / size, rise / size)
            hidden = np.maximum(hidden, np.where(high > low, cover, 0.0))
        blocked = np.log1p(-OPAQUE * np.clip(hidden, 0, 1))
        total += np.exp(np.bincount(which, weights=blocked, minlength=n))
    return total / len(PARTS)


def _coverage(casters: Any, right: Array, up: Array) -> Array:
    """Coverage (n,) of view 0 at metres from the pivot (scale 1), bilinear, 0 outside."""
    padded, texel = casters.coarse, casters.coarse_texel
    h, w = padded.shape[0] - 2, padded.shape[1] - 2
    x = casters.asset.pivot[0] * casters.asset.metres_per_texel / texel + right / texel - 0.5
    y = casters.asset.pivot[1] * casters.asset.metres_per_texel / texel - up / texel - 0.5
    inside = (x > -1) & (x < w) & (y > -1) & (y < h)
    x, y = np.where(inside, x, 0.0), np.where(inside, y, 0.0)
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = x - column, y - row
    found = np.zeros(len(x))
    for dy, wy in ((0, 1 - fy), (1, fy)):
        for dx, wx in ((0, 1 - fx), (1, fx)):
            found += padded[row + 1 + dy, column + 1 + dx] * wx * wy
    return np.where(inside, found, 0.0)


def coarse_coverage(asset: Any) -> tuple[Array, float]:
    """Return coverage of view 0 at the first level of ROWS rows or less, a border of zeros about it
    (h + 2, w + 2), and its texel in metres."""
    n = next((i for i, lv in enumerate(asset.levels) if lv.shape[1] <= ROWS), len(asset.levels) - 1)
    level = asset.levels[n]
    cover = level[0, ..., 3].astype(np.float64) * asset.scales[0, 3]
    cover = cover / 255 if level.dtype == np.uint8 else cover
    return np.pad(cover, 1), asset.metres_per_texel * asset.size[1] / level.shape[1]
