"""A few colours for many pictures, and a dither that stands still where the picture does.

Colours are codes (..., 3) of 0..255. Floyd and Steinberg's dither passes its error on from pixel to
pixel, so that one pixel that changes moves all that follow: an animation crawls. Here a pixel takes
one of two colours of the palette by a threshold that depends on its place alone.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

Codes = NDArray[np.uint8]
BITS = 6
"""Of a channel, by which the table of `pairs` is looked up."""
NEIGHBOURS = 8
"""Colours of the palette among which the second of a pair is looked for."""
SPREAD = 0.1
"""How much the distance between the colours of a pair counts beside the error of their mixture."""
ROUNDS = 6


def choose(samples: NDArray[np.uint8], count: int) -> Codes:
    """Return (k, 3), k <= count, that stand for samples (n, 3): median cut, then Lloyd's rounds.

    Each cut halves the box of largest squared error (Heckbert 1982; Wu 1991), each round moves
    colours to the mean of what is nearest to them (Lloyd 1982).
    """
    from scipy.spatial import cKDTree

    colours, weight = np.unique(samples.reshape(-1, 3), axis=0, return_counts=True)
    if len(colours) <= count:
        return np.asarray(colours, np.uint8)
    points, mass = colours.astype(np.float64), weight.astype(np.float64)
    boxes = [_box(points, mass, np.arange(len(points)), 0)]
    while len(boxes) < count and boxes[0][0] < 0:
        _, _, axis, inside = heapq.heappop(boxes)
        rising = inside[np.argsort(points[inside, axis], kind="stable")]
        half = np.searchsorted(np.cumsum(mass[rising]), 0.5 * mass[rising].sum())
        cut = int(np.clip(half, 1, len(rising) - 1))
        for number, part in enumerate((rising[:cut], rising[cut:])):
            heapq.heappush(boxes, _box(points, mass, part, 2 * len(boxes) + number))
    means = [np.average(points[inside], axis=0, weights=mass[inside]) for *_, inside in boxes]
    centres = np.array(means)
    for _ in range(ROUNDS):
        nearest = cKDTree(centres).query(points)[1]
        total = np.bincount(nearest, mass, len(centres))
        sums = [np.bincount(nearest, mass * points[:, c], len(centres)) for c in range(3)]
        moved = np.stack(sums, axis=1) / np.maximum(total, 1.0)[:, None]
        centres = np.where(total[:, None] > 0, moved, centres)
    return np.asarray(np.unique(np.rint(centres).astype(np.uint8), axis=0))


def pairs(palette: Codes) -> NDArray[np.intp]:
    """Return (64, 64, 64, 2): for every colour, by its upper 6 bits, two of the palette to mix.

    The first is the nearest; the second is that of its neighbours whose mixture with it comes
    nearest, which is dearer the farther it lies.
    """
    from scipy.spatial import cKDTree

    points = palette.astype(np.float64)
    levels = (np.arange(1 << BITS) + 0.5) * (256 >> BITS) - 0.5
    cells = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), -1).reshape(-1, 3)
    k = min(NEIGHBOURS, len(points))
    near = cKDTree(points).query(cells, k=k)[1].reshape(len(cells), k)
    first = points[near[:, 0]]
    best, second = np.full(len(cells), np.inf), near[:, 0].copy()
    for other in near.T:
        along = points[other] - first
        square = np.maximum((along * along).sum(axis=1), 1e-9)
        share = np.clip(((cells - first) * along).sum(axis=1) / square, 0.0, 1.0)
        missed = cells - first - share[:, None] * along
        error = (missed * missed).sum(axis=1) + SPREAD * share * (1 - share) * square
        better = error < best
        best[better], second[better] = error[better], other[better]
    side = 1 << BITS
    return np.stack([near[:, 0], second], axis=1).reshape(side, side, side, 2)


def dither(picture: Codes, palette: Codes, table: NDArray[np.intp]) -> Codes:
    """Return the indices (h, w) into the palette that stand for a picture (h, w, 3).

    table : of `pairs`. The share of the second colour is that of the mixture nearest to the pixel;
    thresholds are Bayer's 8 x 8 (1973), so that shares of 1/64 show.
    """
    cell = picture >> (8 - BITS)
    chosen = table[cell[..., 0], cell[..., 1], cell[..., 2]]
    points = palette.astype(np.float32)
    first, second = points[chosen[..., 0]], points[chosen[..., 1]]
    along = second - first
    square = np.maximum(np.einsum("hwc,hwc->hw", along, along), 1e-9)
    share = np.einsum("hwc,hwc->hw", picture.astype(np.float32) - first, along) / square
    height, width = picture.shape[:2]
    limit = np.tile(thresholds(), (height // 8 + 1, width // 8 + 1))[:height, :width]
    return np.asarray(np.where(share > limit, chosen[..., 1], chosen[..., 0]), np.uint8)


def thresholds() -> NDArray[np.float64]:
    """Return Bayer's (8, 8): every (i + 1/2) / 64 once, near ones far apart."""
    ordered = np.zeros((1, 1))
    for _ in range(3):
        ordered = np.block([[4 * ordered, 4 * ordered + 2], [4 * ordered + 3, 4 * ordered + 1]])
    return np.asarray((ordered + 0.5) / 64)


def _box(
    points: NDArray[np.float64], mass: NDArray[np.float64], inside: NDArray[np.intp], number: int
) -> tuple[float, int, int, NDArray[np.intp]]:
    """Return minus the squared error along the widest axis, a number, that axis, and what is in."""
    mean = np.average(points[inside], axis=0, weights=mass[inside])
    error = (mass[inside, None] * (points[inside] - mean) ** 2).sum(axis=0)
    return -float(error.max()), number, int(error.argmax()), inside
