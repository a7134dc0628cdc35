"""Pictures under a dome of lights become sixteen numbers a pixel, relit by sixteen constants.

Some thousand pixels are fitted with smooth hemispherical harmonics; the few colours that keep most
of their series' energy become the channels, and every pixel is fitted with these, then brought to
mip levels and codes. Where the pictures have coverage, they are premultiplied, and pixels without
any have no say. Sums are taken in double precision and rounded once, so that codes do not depend on
the kernel of BLAS. What the report tells is in bake/dome_report.py.

References
----------
Ponchio, Corsini, Scopigno 2018, A Compact Representation of Relightable Images for the Web (PCA).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bake import dome_knobs, dome_report, dome_solve, mips, workers
from bake.dome_knobs import Knobs
from bake.photographs import Photographs
from formats import dome as kind
from formats.dome import Dome
from formats.errors import InputError
from maths import hemispherical_harmonics as harmonics
from maths.principal_components import principal_components

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

TILE = 2048  # pixels
WEIGHTED_TILE = 256  # pixels that have a normal matrix each
SAMPLE = 1024  # pixels that choose the knobs
LEARNT = 1 << 14  # pixels that choose the channels
# Fits with weights are dear, and channels of so many pixels are as good to .003 dB
WEIGHTED_LEARNT = 1 << 12
DARKEST = 0.05  # of the usual size of a pixel's series, below which darker ones count no more
FEWEST_LIGHTS = 6  # a polynomial texture map has as many unknowns a colour
SAME = 1e-3  # radians: two lights that near are one, for the count


@dataclass(frozen=True)
class Params:
    """Knobs. held_out : indices of photographs that no fit sees. bands, penalty : of the harmonics,
    0 chooses by held-out error inside the other photographs. channels : numbers a pixel, four a
    plane, coverage among them. coverage : keep one, in alpha; pictures that have one always do.
    filter, max_lod : of the mip levels, as in bake.mips; without coverage, max_lod 0 makes one
    level without a border."""

    held_out: tuple[int, ...] = ()
    bands: int = 0
    penalty: float = 0.0
    channels: int = 16
    coverage: bool = False
    filter: str = "kaiser"
    max_lod: float = 0.0

    def check(self, directions: Array) -> None:
        """Raise InputError for the first knob out of its range, and for too few lights."""
        ranges = {"bands": (0, 8), "channels": (2, 64), "penalty": (0, 100)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError("dome", name, value, f"choose from {low} to {high}")
        mips.Params(filter=self.filter, max_lod=self.max_lod).check()
        lights = len(directions)
        if not all(0 <= n < lights for n in self.held_out):
            raise InputError("dome", "held_out", list(self.held_out), f"there are {lights} lights")
        left = distinct(np.delete(directions, sorted(set(self.held_out)), axis=0))
        if left < FEWEST_LIGHTS:
            remedy = f"a dome needs {FEWEST_LIGHTS} or more, in different places, to fit"
            raise InputError("dome", "lights", left, remedy)


def distinct(directions: Array) -> int:
    """Return how many of the unit directions (n, 3) stand apart from all before them."""
    near = directions @ directions.T > np.cos(SAME)
    return int(np.count_nonzero(~np.tril(near, -1).any(axis=1)))


def fit(
    photographs: Photographs, *, params: Params, progress: workers.Progress = workers.silent
) -> Dome:
    """Fit, compress and quantise. InputError for knobs out of range, broken arrays and too few
    photographs."""
    photographs = photographs.checked("dome")
    lights = photographs.directions
    params.check(lights)
    held = np.array(sorted(set(params.held_out)), np.int64)
    train = np.setdiff1d(np.arange(len(lights)), held)
    covered = covered_of(photographs)
    samples = sample_of(photographs.pictures, train, covered)
    knobs = dome_knobs.choose(
        samples, lights[train], photographs.space, params.bands, params.penalty
    )
    some = spread(photographs, covered, WEIGHTED_LEARNT if knobs.exponent else LEARNT)
    C = series_of(photographs, train, knobs, some)
    learnt = for_channels(C.reshape(len(C), -1), photographs.space)
    components = principal_components(learnt, params.channels)
    vectors = components.vectors.reshape(params.channels, -1, 3)
    count = params.channels - (params.coverage or covered is not None)
    pixels = np.arange(photographs.pictures[0].size // 3) if covered is None else covered
    scores = scores_of(photographs, train, knobs, vectors[:count], pixels, progress)
    asset = packed(photographs, scores, vectors[:count], covered, params)
    fitted = dome_report.Fitted(photographs, train, held, covered, knobs, components)
    kept = scores[some if covered is None else np.searchsorted(covered, some)]
    # With coverage, one channel more tells what it costs
    wide = kept if count == len(vectors) else scores_of(photographs, train, knobs, vectors, some)
    losses = dome_report.losses(fitted, asset, some, (C, wide, kept))
    quality = dome_report.quality_of(fitted, asset, samples)
    return replace(asset, quality=quality | losses | asset.quality)


def for_channels(series: Float, space: str) -> Array:
    """Return the series (n, values) of pixels as they count for the choice of channels: linear ones
    by the root of their size, since energy forgets what is dark, and eyes do not."""
    rows = np.asarray(series, np.float64)
    size = np.sqrt(np.mean(np.square(rows), axis=1, keepdims=True))
    floor = DARKEST * np.sqrt(np.mean(np.square(size)))
    return rows if space == "stored" or floor == 0 else rows / np.sqrt(size + floor)


def covered_of(photographs: Photographs) -> Indices | None:
    """Return the pixels that are covered at all, row-major; None for all of an opaque picture."""
    if photographs.coverage is None:
        return None
    covered = np.flatnonzero(photographs.coverage.ravel() > 0)
    if not len(covered):
        raise InputError("dome", "coverage", "all zero", "nothing is to be seen: check the mesh")
    return covered


def spread(photographs: Photographs, covered: Indices | None, most: int) -> Indices:
    """Return up to `most` of the covered pixels, evenly spread by the golden ratio, in order."""
    count = photographs.pictures[0].size // 3 if covered is None else len(covered)
    steps = (np.arange(min(most, count)) + 0.5) * 0.6180339887498949 % 1
    chosen = np.arange(count) if count <= most else np.unique((steps * count).astype(np.int64))
    return chosen if covered is None else covered[chosen]


def sample_of(pictures: Float, train: Indices, covered: Indices | None = None) -> Array:
    """Return the samples (pixels, N, 3) of some pixels, for knobs."""
    flat = pictures.reshape(len(pictures), -1, 3)
    chosen = spread(Photographs(pictures, np.zeros((0, 3)), "linear"), covered, SAMPLE)
    return np.asarray(flat[train[:, None], chosen].transpose(1, 0, 2), np.float64)


def series_of(photographs: Photographs, train: Indices, knobs: Knobs, pixels: Indices) -> Float:
    """Return the coefficients (pixels, bands^2, 3) of some pixels."""
    lights, K = photographs.directions[train], knobs.bands**2
    C = np.empty((len(pixels), K, 3), np.float32)
    matrix = harmonics.fit_weights(lights, knobs.bands, knobs.penalty).matrix

    def tile(start: int) -> None:
        x = samples_at(photographs, train, pixels[start : start + WEIGHTED_TILE])
        if knobs.exponent == 0:
            C[start : start + len(x)] = np.matmul(matrix, x.astype(np.float64))
            return
        weights = dome_knobs.weights_of(x, knobs.exponent)
        fitted = harmonics.fit_each(x, lights, knobs.bands, knobs.penalty, weights)
        C[start : start + len(x)] = fitted

    workers.map_tiles(tile, range(0, len(C), WEIGHTED_TILE))
    return C


def scores_of(
    photographs: Photographs,
    train: Indices,
    knobs: Knobs,
    vectors: Array,
    pixels: Indices,
    progress: workers.Progress = workers.silent,
) -> Float:
    """Fit pixels with a few series instead of all: channels (pixels, J), of the least weighted
    squares and penalty that they can have.

    vectors : (J, bands^2, 3), the series of the channels; zeros give channels of zeros.
    """
    lights, count = photographs.directions[train], len(vectors)
    # What channel j gives light n and colour c, and the penalty as its quadratic form
    given = np.einsum("nk,jkc->ncj", harmonics.evaluate(lights, knobs.bands), vectors)
    rough = harmonics.penalties(knobs.bands)[:, None]
    form = knobs.penalty * len(lights) * np.tensordot(vectors * rough, vectors, ((1, 2), (1, 2)))
    # An empty channel has no equation: let it be 0
    form += np.diag(~vectors.any(axis=(1, 2)) * 1.0)
    pairs = np.einsum("nci,ncj->nij", given, given)
    flat = given.reshape(-1, count)
    matrix = np.linalg.solve(pairs.sum(axis=0) + form, flat.T).T
    # Lower triangles, column after column
    below = np.concatenate([pairs[:, k:, k].T for k in range(count)])
    ends = np.cumsum(np.arange(count, 1, -1))
    scores = np.empty((len(pixels), count), np.float32)

    def tile(start: int) -> None:
        x = samples_at(photographs, train, pixels[start : start + TILE])
        own = slice(start, start + len(x))
        if knobs.exponent == 0:
            scores[own] = x.reshape(len(x), -1).astype(np.float64) @ matrix
            return
        w = dome_knobs.weights_of(x, knobs.exponent)
        w /= w.mean(axis=1, keepdims=True)
        x *= w[..., None]
        normal = np.empty((count, count, len(x)), np.float32)
        for k, column in enumerate(np.split(below @ w.T.astype(np.float64), ends)):
            normal[k:, k] = column + form[k:, k, None]
        right = (x.reshape(len(x), -1).astype(np.float64) @ flat).T.astype(np.float32, "C")
        scores[own] = dome_solve.solved(normal, right).T

    workers.map_tiles(tile, range(0, len(pixels), TILE), progress)
    return scores


def samples_at(photographs: Photographs, train: Indices, pixels: Indices) -> Float:
    """Return the samples (pixels, N, 3) of some pixels, those of one run fast."""
    flat = photographs.pictures.reshape(len(photographs.pictures), -1, 3)
    first, last = int(pixels[0]), int(pixels[-1])
    run = last - first + 1 == len(pixels)
    part = flat[:, first : last + 1] if run else flat[:, pixels]
    x = np.empty((len(pixels), len(train), 3), np.float32)
    for i, n in enumerate(train):
        x[:, i] = part[n]
    return x


def packed(
    photographs: Photographs,
    scores: Float,
    vectors: Array,
    covered: Indices | None,
    params: Params,
) -> Dome:
    """Lay scores (pixels, channels) of the covered pixels out in planes, levels and codes.

    vectors : (channels, bands^2, 3)."""
    height, width = photographs.pictures.shape[1:3]
    alpha = photographs.coverage
    if alpha is None and params.coverage:
        alpha = np.ones((height, width), np.float32)
    coverage, views = alpha is not None, photographs.views
    count = len(vectors)
    channels = np.zeros((height * width, count), np.float32)
    channels[slice(None) if covered is None else covered] = scores
    by_view = channels.reshape(views, -1, width, count)
    alphas = [None] * views if alpha is None else list(alpha.reshape(views, -1, width))
    planes = [kind.placed(c, a) for c, a in zip(by_view, alphas, strict=True)]
    per_view, stacked = len(planes[0]), np.concatenate(planes)
    border = 0
    levels: tuple[Float, ...] = (stacked,)
    if coverage or params.max_lod > 0:
        border, levels = mips.bordered_levels(
            stacked, mips.Params(filter=params.filter, max_lod=params.max_lod)
        )
    codes, scales, clipped = kind.encode(levels, per_view, coverage)
    return Dome(
        levels=codes,
        scales=scales,
        components=vectors,
        space=photographs.space,
        coverage=coverage,
        views=views,
        metres_per_texel=photographs.metres_per_texel,
        pivot=(photographs.pivot[0] + border, photographs.pivot[1] + border),
        height=photographs.height,
        max_lod=min(params.max_lod, len(levels) - 1.0),
        lens_scale=mips.FILTERS[params.filter].lens_scale,
        quality={
            "border": border,
            "size": [width, height // views],
            "levels": len(levels),
            "clipped_values": clipped,
        },
    )
