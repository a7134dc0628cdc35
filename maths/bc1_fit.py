"""Endpoints of BC1 blocks: cluster fit along the principal axis, then exact integer refinement.

Arrays keep the block as the last axis. All sums are integers and all else is one operation an
element, so that a block's result depends on nothing but the block. Error is the sum of squares
over red, green and blue of 8-bit codes, as the decoder rounds them.

A block's `steps` are 3 (four colours) or 2 (three colours): level s of 0..steps lies that share of
the way from endpoint A to endpoint B.

References
----------
Brown 2006, DXT Compression Techniques (cluster fit: all ways to cut the order along an axis).
Geldreich 2020, rgbcx.h (refinement against quantised endpoints; single-colour tables).
"""

from functools import cache
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

Int = NDArray[np.int32]
Float = NDArray[np.float32]

PARTITIONS = 2  # best cuts that are carried on
CUT_TOGETHER = 64  # blocks: 969 cuts of each make 0.7 MB, which stays in the cache
ROUNDS = 1  # of refinement after each cut
# Endpoints of 5, 6 and 5 bits as 8-bit codes, the high bits repeated below
_FIVE = np.arange(32, dtype=np.int32) << 3 | np.arange(32, dtype=np.int32) >> 2
_SIX = np.arange(64, dtype=np.int32) << 2 | np.arange(64, dtype=np.int32) >> 4
CODES = (_FIVE, _SIX, _FIVE)
TOPS = np.array([31, 63, 31], np.int32)


def expand(ends: Int) -> Int:
    """Return 8-bit codes of endpoint components (3, ...) of 5, 6 and 5 bits."""
    return np.stack([codes[ends[i]] for i, codes in enumerate(CODES)])


def between(a: Int, b: Int, level: int, steps: int) -> Int:
    """Return the colour that the decoder makes at a level: the nearest code, a half up."""
    if level in (0, steps):
        return b if level else a
    if steps == 2:
        return np.asarray((a + b + 1) >> 1)
    return np.asarray(((3 - level) * a + level * b + 1) // 3)


def assign(ends: Int, x: Int, steps: int) -> tuple[NDArray[np.uint8], Int]:
    """Return the nearest level (n, N) of texels x (n, 3, N), and the error (N,).

    ends : (2, 3, N) endpoints A and B in 5, 6 and 5 bits. Of equal ones the lowest level counts.
    """
    a, b = expand(ends[0]), expand(ends[1])
    levels = np.zeros((len(x), x.shape[2]), np.uint8)
    least = np.empty(levels.shape, np.int32)
    for level in range(steps + 1):
        p = between(a, b, level, steps)
        distance = (x[:, 0] - p[0]) ** 2
        for i in (1, 2):
            distance += (x[:, i] - p[i]) ** 2
        if level:
            levels[distance < least] = level
            np.minimum(least, distance, out=least)
        else:
            least = distance
    return levels, least.sum(axis=0, dtype=np.int32)


def fit(x: Int, steps: int, *, black: bool = False) -> tuple[Int, Int]:
    """Return endpoints (2, 3, N) of least error for texels x (n, 3, N), and the error (N,).

    black : B stays zero. Otherwise the error is at most that of the best single colour for the
    mean, and 0 where the texels have two colours that endpoints can hold.
    """
    order = _order(x, _axis(x, black))
    along = np.take_along_axis(x, order[:, None], axis=0)
    ends = np.stack([_quantised(along[0]), _quantised(along[-1])])
    if black:
        ends[1] = 0
    best = _Best(x, steps, black, ends)
    if not black:
        mean = (2 * x.sum(axis=0, dtype=np.int32) + len(x)) // (2 * len(x))
        best.offer(flat(mean, steps))
    for _ in range(2):
        for levels in _cuts(along, steps, black):
            best.refine(levels, along)
        # Order once more along the line that was found
        line = expand(best.ends[0]) - expand(best.ends[1])
        order = _order(x, line.astype(np.float32))
        along = np.take_along_axis(x, order[:, None], axis=0)
    best.perturb()
    return best.ends, best.error


class _Best:
    """The best endpoints so far, and ways to improve them."""

    def __init__(self, x: Int, steps: int, black: bool, ends: Int) -> None:
        self.x, self.steps, self.black, self.ends = x, steps, black, ends
        self.levels, self.error = assign(ends, x, steps)

    def offer(self, ends: Int) -> None:
        """Take endpoints wherever they are better."""
        levels, error = assign(ends, self.x, self.steps)
        better = error < self.error
        self.ends = np.where(better, ends, self.ends)
        self.levels = np.where(better, levels, self.levels)
        self.error = np.where(better, error, self.error)

    def refine(self, levels: NDArray[np.uint8], x: Int) -> None:
        """Offer the best endpoints for given levels (n, N), then again for the nearest levels."""
        self.offer(_endpoints(levels, x, self.ends, self.steps, self.black))
        for _ in range(ROUNDS):
            self.offer(_endpoints(self.levels, self.x, self.ends, self.steps, self.black))

    def perturb(self) -> None:
        """Offer each endpoint component one step up and down."""
        for end in range(1 if self.black else 2):
            for i in range(3):
                for step in (-1, 1):
                    moved = self.ends.copy()
                    moved[end, i] = np.clip(moved[end, i] + step, 0, TOPS[i])
                    self.offer(moved)


def flat(colour: Int, steps: int) -> Int:
    """Return the endpoints (2, 3, N) whose colour at level 1 is nearest to 8-bit codes (3, N)."""
    pairs = [_nearest_pairs(i == 1, steps)[:, colour[i]] for i in range(3)]
    return np.stack(pairs, axis=1)


@cache
def _nearest_pairs(six: bool, steps: int) -> Int:
    """Return (2, 256) endpoints that give each code at level 1; of equal ones the closest pair."""
    codes = _SIX if six else _FIVE
    a, b = (m.ravel() for m in np.meshgrid(range(len(codes)), range(len(codes)), indexing="ij"))
    made = between(codes[a], codes[b], 1, steps)
    cost = np.abs(made[None] - np.arange(256)[:, None]) * 4096 + np.abs(a - b)
    chosen = cost.argmin(axis=1)
    return np.stack([a[chosen], b[chosen]]).astype(np.int32)


def _axis(x: Int, through_zero: bool) -> Float:
    """Return the principal axis (3, N) of texels about their mean, or about zero; any length."""
    n = len(x)
    total = x.sum(axis=0, dtype=np.int64)
    M = np.empty((3, 3, x.shape[2]))
    for i in range(3):
        for j in range(i + 1):
            products = (x[:, i] * x[:, j]).sum(axis=0, dtype=np.int64)
            M[i, j] = M[j, i] = products if through_zero else n * products - total[i] * total[j]
    # Square it until the largest eigenvalue outweighs the others; no start vector can miss it
    for _ in range(6):
        M /= np.maximum(M[0, 0] + M[1, 1] + M[2, 2], 1e-300)
        rows = [[sum(M[i, k] * M[k, j] for k in range(3)) for j in range(3)] for i in range(3)]
        M = np.stack([np.stack(row) for row in rows])
    largest = np.stack([M[0, 0], M[1, 1], M[2, 2]]).argmax(axis=0)
    axis = np.take_along_axis(M, largest[None, None], axis=0)[0]
    # Powers underflow together with what they outweigh
    longest = np.maximum(np.abs(axis).max(axis=0), 1e-300)
    return np.asarray(axis / longest, np.float32)


def _order(x: Int, axis: Float) -> NDArray[np.intp]:
    """Return the texels' order (n, N), falling along the axis; equal ones as they lie."""
    along = x[:, 0] * axis[0] + x[:, 1] * axis[1] + x[:, 2] * axis[2]
    return np.argsort(-along, axis=0, kind="stable")


@cache
def _partitions(n: int, steps: int, black: bool) -> tuple[NDArray[np.intp], Float]:
    """Return where to cut n texels in order into levels (K, steps), and the weight of each cut.

    Texel t has the level that says how many of the cuts are at or before t. A has weight w = steps
    - level, B the rest v: minimising sum (steps x - w A - v B)^2 leaves the total minus a square
    of s = sum w x times 1 / (ww vv - wv^2) about the mean, or 1 / ww where B is zero.
    """
    cuts = np.array(list(combinations_with_replacement(range(n + 1), steps)), np.intp)
    level = (np.arange(n) >= cuts[:, :, None]).sum(axis=1)
    w, v = steps - level, level
    ww, vv, wv = (w * w).sum(axis=1), (v * v).sum(axis=1), (w * v).sum(axis=1)
    weight = ww if black else ww * vv - wv * wv
    sound = weight > 0
    return cuts[sound], (1 / weight[sound]).astype(np.float32)


def _cuts(along: Int, steps: int, black: bool) -> list[NDArray[np.uint8]]:
    """Return the levels (n, N) of the best ways to cut texels in order (n, 3, N)."""
    n = len(along)
    cuts, weight = _partitions(n, steps, black)
    centred = along if black else n * along - along.sum(axis=0, dtype=np.int32)
    sums = np.zeros((n + 1, 3, along.shape[2]), np.float32)
    np.cumsum(centred, axis=0, out=sums[1:])
    best = np.empty((min(PARTITIONS, len(cuts)), along.shape[2]), np.intp)
    for start in range(0, along.shape[2], CUT_TOGETHER):
        part = np.ascontiguousarray(sums[:, :, start : start + CUT_TOGETHER])
        s = part[cuts[:, 0]]
        for column in range(1, steps):
            s += part[cuts[:, column]]
        score = s[:, 0] ** 2 + s[:, 1] ** 2 + s[:, 2] ** 2
        score *= weight[:, None]
        for row in best[:, start : start + CUT_TOGETHER]:
            row[:] = score.argmax(axis=0)
            score[row, np.arange(len(row))] = -1
    texels = np.arange(n)[:, None, None]
    return [(texels >= cuts[row].T).sum(axis=1, dtype=np.uint8) for row in best]


def _quantised(codes: NDArray[np.number]) -> Int:
    """Return the nearest endpoint components to 8-bit codes (3, N) of any number type."""
    scale = TOPS[:, None] / np.float32(255)
    return np.asarray(np.clip(np.rint(codes * scale), 0, TOPS[:, None]), np.int32)


def _endpoints(levels: NDArray[np.uint8], x: Int, ends: Int, steps: int, black: bool) -> Int:
    """Return good endpoints (2, 3, N) for given levels (n, N); `ends` where they say nothing.

    The least squares solution is rounded; then each end is moved a step with the other one solved
    anew, and the best pair of each channel kept, with the decoder's rounding.
    """
    count = np.stack([(levels == s).sum(axis=0, dtype=np.int32) for s in range(steps + 1)])
    total = np.stack(
        [(x * (levels == s)[:, None]).sum(axis=0, dtype=np.int32) for s in range(steps + 1)]
    )
    w = np.arange(steps, -1, -1, dtype=np.int32)
    ww = sum(w[s] ** 2 * count[s] for s in range(steps + 1))
    vv = sum(w[steps - s] ** 2 * count[s] for s in range(steps + 1))
    wv = sum(w[s] * w[steps - s] * count[s] for s in range(steps + 1))
    wx = steps * sum(w[s] * total[s] for s in range(steps + 1))
    vx = steps * sum(w[steps - s] * total[s] for s in range(steps + 1))
    if black:
        a = _quantised(wx / np.maximum(ww, 1))
        moved = [np.stack([_moved(a, step), np.zeros_like(a)]) for step in (0, -1, 1)]
    else:
        det = ww * vv - wv * wv
        known, det = det > 0, np.maximum(det, 1)
        a = np.where(known, _quantised((vv * wx - wv * vx) / det), ends[0])
        b = np.where(known, _quantised((ww * vx - wv * wx) / det), ends[1])
        moved = [np.stack([a, b])]
        for step in (0, -1, 1):
            a2, b2 = _moved(a, step), _moved(b, step)
            other = _quantised((vx - wv * expand(a2)) / np.maximum(vv, 1))
            moved.append(np.stack([a2, other]))
            other = _quantised((wx - wv * expand(b2)) / np.maximum(ww, 1))
            moved.append(np.stack([other, b2]))
    best, least = moved[0], _error(moved[0], count, total, steps)
    for pair in moved[1:]:
        error = _error(pair, count, total, steps)
        better = error < least
        best, least = np.where(better, pair, best), np.where(better, error, least)
    return best


def _moved(end: Int, step: int) -> Int:
    return np.asarray(np.clip(end + np.int32(step), 0, TOPS[:, None]))


def _error(ends: Int, count: Int, total: Int, steps: int) -> Int:
    """Return the error (3, N) of each channel, less the sum of squares of the texels."""
    a, b = expand(ends[0]), expand(ends[1])
    error = np.zeros_like(a)
    for s in range(steps + 1):
        p = between(a, b, s, steps)
        error += p * (count[s] * p - 2 * total[s])
    return error
