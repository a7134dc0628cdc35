"""Bloom: a share of the light of each pixel, spread by a chain of half-size pictures.

A level halves the one before by [1 5 10 10 5 1] / 32 along each axis, and comes back by doublings:
bilinear between means of four texels, [3 4 1] / 8 and mirrored. The first counts every texel by a
quarter, the second makes four of one: light is neither added nor lost, but at the border, which
goes on beyond it. The spread picture is a mean of the levels. Level i has the variance 4^i - 1
texels^2 along each axis. Shorter filters flicker: where a bright texel lies among those of a coarse
level moves the light of a level by 1 % of its peak here, by 4 % with [1 3 3 1] / 8, by half with
means of four texels.

Weights grow by sqrt(2) an octave up to the widest, so that light falls off by r^-1.5, somewhat
slower than glare in an eye (r^-2, Vos), and a picture of more lines looks as one of fewer does.

References
----------
Williams 1983, Pyramidal Parametrics.  Burt 1981, Fast Filter Transforms for Image Processing.
Jimenez 2014, Next Generation Post Processing in Call of Duty: Advanced Warfare (levels by levels).
Vos 1984, Disability glare: a state of the art report, CIE Journal 3(2).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
GROWTH = 2.0**0.5  # of weights an octave
HALVING = np.array([1.0, 5.0, 10.0, 10.0, 5.0, 1.0]) / 32.0  # texels 2i - 2 to 2i + 3
DOUBLING = np.array([3.0, 4.0, 1.0]) / 8.0  # texels i - 1 to i + 1 of an even one, mirrored of odd


def bright_share(rgb: ArrayLike, threshold: float) -> Array:
    """Share of a colour that lies over the threshold: its hue stays.

    rgb : (..., 3) from 0. threshold : of the largest channel, from 0. Returns (...) in [0, 1].

    >>> bright_share([[4.0, 1.0, 0.0], [0.5, 0.5, 0.5]], 1.0).tolist()
    [0.75, 0.0]
    """
    largest = np.max(np.asarray(rgb, np.float64), axis=-1)
    over = largest > threshold
    return np.asarray(np.where(over, 1.0 - threshold / np.where(over, largest, 1.0), 0.0))


def weights(radius: float) -> Array:
    """Weights (n,) of levels 1 to n, which sum to 1; nothing jumps as the radius grows.

    radius : standard deviation of the widest octave along an axis, pixels. At least one level.

    >>> weights(np.sqrt(15)).round(4).tolist()
    [0.4142, 0.5858]
    """
    octaves = max(float(np.log2(1.0 + radius * radius)) / 2.0, 1.0)
    # A rounded logarithm starts no octave
    whole = int(octaves + 1e-9)
    found = GROWTH ** (np.arange(1, whole + 1) - octaves)
    if octaves - whole > 1e-9:
        found = np.append(found, octaves - whole)
    return np.asarray(found / found.sum())


def mixtures(share: ArrayLike) -> Array:
    """How much of what comes from coarser levels each level takes, (n,) for weights (n,).

    Level i becomes (1 - m) of itself and m of i + 1; the last keeps to itself, m = 0.

    >>> mixtures([0.5, 0.25, 0.25]).tolist()
    [0.5, 0.5, 0.0]
    """
    w = np.asarray(share, np.float64)
    tail = np.cumsum(w[::-1])[::-1]
    return np.append(tail[1:] / tail[:-1], 0.0)


def halve(picture: ArrayLike) -> Array:
    """Picture (h, w, ...) at half the size, rounded up."""
    found = np.asarray(picture, np.float64)
    for axis in (0, 1):
        n = found.shape[axis]
        first = 2 * np.arange((n + 1) // 2) - 2
        found = sum(
            weight * np.take(found, np.clip(first + k, 0, n - 1), axis=axis)
            for k, weight in enumerate(HALVING)
        )
    return found


def double(picture: ArrayLike, size: tuple[int, int]) -> Array:
    """Picture (h, w, ...) at twice the size, or a texel less: size (height, width)."""
    found = np.asarray(picture, np.float64)
    for axis in (0, 1):
        fine, n = np.arange(size[axis]), found.shape[axis]
        shape = [-1 if a == axis else 1 for a in range(found.ndim)]
        found = sum(
            np.where(fine % 2 == 0, DOUBLING[k], DOUBLING[2 - k]).reshape(shape)
            * np.take(found, np.clip(fine // 2 + k - 1, 0, n - 1), axis=axis)
            for k in range(3)
        )
    return found


def spread(picture: ArrayLike, share: ArrayLike) -> Array:
    """Picture (h, w, ...) spread by levels of the given weights (n,)."""
    levels = [np.asarray(picture, np.float64)]
    for _ in np.asarray(share):
        levels.append(halve(levels[-1]))
    found = levels[-1]
    for level, mixture in zip(levels[-2:0:-1], mixtures(share)[-2::-1], strict=True):
        found = (1.0 - mixture) * level + mixture * double(found, level.shape[:2])
    return double(found, levels[0].shape[:2])


def bloom(picture: ArrayLike, strength: float, threshold: float, radius: float) -> Array:
    """Radiance (h, w, 3) with a share of what is over the threshold spread.

    strength : that share, 0..1. radius : as `weights`, pixels.
    """
    before = np.asarray(picture, np.float64)
    bright = bright_share(before, threshold)[..., None] * before if threshold > 0.0 else before
    return before + strength * (spread(bright, weights(radius)) - bright)
