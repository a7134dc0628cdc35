"""Pictures of several sets in one texture array, so that sprites of all of them are one draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

WASTE = 2.0  # texels of a sheet over texels of its pictures, at most


@dataclass(frozen=True, eq=False)
class Sheet:
    """Mip levels (layers, h, w, 4) that hold pictures `members`, each in a layer from the top left.

    members : numbers of the assets, in the order of the layers.
    """

    levels: tuple[Any, ...]
    members: tuple[int, ...]


def sheets(assets: list[Any]) -> list[Sheet]:
    """Lay pictures (formats.picture.Picture) out: alike in size together, the largest first."""
    area = [size[0] * size[1] for size in (asset.size for asset in assets)]
    order = sorted(range(len(assets)), key=lambda i: (-area[i], i))
    groups: list[list[int]] = []
    for i in order:
        if groups:
            last = groups[-1]
            w, h, _ = _extent([assets[k] for k in (*last, i)])
            if w * h * (len(last) + 1) <= WASTE * sum(area[k] for k in (*last, i)):
                last.append(i)
                continue
        groups.append([i])
    return [Sheet(_levels([assets[i] for i in group]), tuple(group)) for group in groups]


def _extent(assets: list[Any]) -> tuple[int, int, int]:
    """Width and height of a sheet for these, and its levels."""
    count = max(len(asset.levels) for asset in assets)
    step = 1 << (count - 1)
    w, h = (max(asset.size[axis] for asset in assets) for axis in (0, 1))
    return -(-w // step) * step, -(-h // step) * step, count


def _levels(assets: list[Any]) -> tuple[Any, ...]:
    if len(assets) == 1:
        return tuple(assets[0].levels)
    w, h, count = _extent(assets)
    levels = []
    for n in range(count):
        level = np.zeros((len(assets), h >> n, w >> n, 4), assets[0].levels[0].dtype)
        for layer, asset in enumerate(assets):
            if n < len(asset.levels):
                own = asset.levels[n][0]
                level[layer, : own.shape[0], : own.shape[1]] = own
        levels.append(level)
    return tuple(levels)
