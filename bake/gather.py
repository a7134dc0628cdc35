"""Light on hits, streamed on to harmonics: the inner loop of a sprite's bake.

Subsamples take turns: with N lights and S subsamples a texel, subsample s sees only the lights
j = -s (mod m), evenly spaced, so a texel casts N S / m shadow rays instead of N S. What the turns
add to the signal repeats every N / m lights, at harmonics N / m and up, out of the way of the kept
ones; so m is the largest common divisor of N and S that leaves N / m >= 4 H (at least 8). On a mesh
of 70,000 faces, N = 64, S = 16, that is m = 8: an eighth of the rays for less than 0.01 dB of
held-out error; crowns of leaves, whose subsamples differ most, pay 0.3 dB (study `shadow_rays`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

from bake.rays import RayScene
from bake.shading import Shading, ggx
from maths import circular_harmonics
from maths.colour import luminance

Float = NDArray[np.float32]

BLOCK = 16  # lights in memory at once, whatever their number


def turns_of(lights: int, samples: int, terms: int, lights_per_sample: int = 0) -> int:
    """Return m, over how many subsamples the lights are shared out; 1 where they cannot be.

    lights_per_sample : at least how many lights each subsample sees; 0 for the rule above.

    >>> turns_of(64, 16, 5), turns_of(64, 16, 5, 64), turns_of(61, 16, 5)
    (8, 1, 1)
    """
    least = lights_per_sample or max(8, 2 * (terms - 1))
    common = gcd(lights, samples)
    return max(
        (m for m in range(1, common + 1) if common % m == 0 and lights // m >= least), default=1
    )


@dataclass(frozen=True)
class Lights:
    """All directions a sprite is lit from, in its own frame.

    ring : (N, S, 3), one a light and subsample, spread over the sun's disc. matrix : (K, N) maps
    what they light to coefficients. sky : (Q, S, 3) and sky_share, what each adds to Y0. held : (M,
    S, 3) directions that the fit does not see, at azimuths held_angles. turns : the m above.
    """

    ring: NDArray[np.float64]
    matrix: NDArray[np.float64]
    fit: circular_harmonics.Fit
    sky: NDArray[np.float64]
    sky_share: float
    held: NDArray[np.float64]
    held_angles: NDArray[np.float64]
    turns: int


@dataclass(frozen=True)
class Gathered:
    """Sums for p texels. terms : (K, p, 3). held : (M, q, 3) renders of the chosen texels. squares,
    kept : (p,) of luminance: the mean square over the ring, and what of it the terms keep."""

    terms: Float
    held: Float
    squares: Float
    kept: Float


def gather(
    scene: RayScene,
    shading: Shading,
    lights: Lights,
    turn: NDArray[np.float64],
    samples: int,
    chosen: NDArray[np.int64],
) -> Gathered:
    """Light the hits (S, p) of some texels and project on the terms.

    turn : rotation (3, 3), world from sprite. chosen : texels among the p to render under the
    held-out lights.
    """
    ring, sky, held = (
        np.ascontiguousarray(d @ turn.T, np.float32) for d in (lights.ring, lights.sky, lights.held)
    )
    count = len(shading.normal) // samples
    colours = [c.reshape(samples, count, 3) for c in shading.colours]
    weigh = [luminance(c).astype(np.float32) for c in colours]
    sums = [np.zeros((len(lights.matrix), samples, count), np.float32) for _ in colours]
    squares = np.zeros(count, np.float32)
    share = np.float32(lights.turns / samples)
    matrix = lights.matrix.astype(np.float32)

    def add_block(which: NDArray[np.int64], subsamples: NDArray[np.int64]) -> None:
        """Project one block of lights; its buffers are gone before the next one's are made."""
        lit = _lit(scene, shading, ring, which, subsamples, count)
        seen = sum(
            np.einsum("sjp,sp->jp", v, w[subsamples]) for v, w in zip(lit, weigh, strict=True)
        )
        np.add(squares, np.einsum("jp,jp->p", seen, seen) * share**2, out=squares)
        for total, values in zip(sums, lit, strict=True):
            for s, light in zip(subsamples, values, strict=True):
                total[:, s] += matrix[:, which] @ light

    for which, subsamples in _blocks(len(ring), lights.turns, samples):
        add_block(which, subsamples)
    terms = sum(np.einsum("ksp,spc->kpc", t, c) for t, c in zip(sums, colours, strict=True)) * share
    luma = luminance(terms)
    kept = np.einsum("kp,kp->p", luma, luma) / (2 * np.pi)
    # The sky is the same under every light: the held-out renders have it too
    even = fill(scene, shading, sky, colours) * np.float32(lights.sky_share / samples)
    terms[0] += even
    rendered = render(scene, shading.select(chosen, samples), held, samples)
    rendered += even[chosen] / np.float32(np.sqrt(2 * np.pi))
    mean_square = squares / np.float32(len(ring))
    return Gathered(terms, rendered, mean_square, kept.astype(np.float32))


def fill(scene: RayScene, shading: Shading, sky: Float, colours: list[Float]) -> Float:
    """Return the sum (p, 3) over all directions (Q, S, 3) of the sky and all subsamples."""
    samples, count, _ = colours[0].shape
    total = np.zeros((count, 3), np.float32)
    for which, subsamples in _blocks(len(sky), 1, samples):
        lit = _lit(scene, shading, sky, which, subsamples, count)
        total += sum(np.einsum("sjp,spc->pc", v, c) for v, c in zip(lit, colours, strict=True))
        del lit
    return total


def _blocks(
    lights: int, turns: int, samples: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """List (lights, subsamples that see them), at most BLOCK lights at a time."""
    for turn in range(turns):
        mine = np.arange(turn, lights, turns)
        subsamples = np.arange(-turn % turns, samples, turns)
        for start in range(0, len(mine), BLOCK):
            yield mine[start : start + BLOCK], subsamples


def _lit(
    scene: RayScene,
    shading: Shading,
    directions: Float,
    which: NDArray[np.int64],
    subsamples: NDArray[np.int64],
    count: int,
) -> list[Float]:
    """Return, for each channel, what lights give subsamples: (subsamples, lights, p)."""
    channels = [np.empty((len(subsamples), len(which), count), np.float32) for _ in shading.colours]
    for i, j in enumerate(which):
        for k, s in enumerate(subsamples):
            hits = slice(s * count, (s + 1) * count)
            one_light(scene, shading, hits, directions[j, s], [c[k, i] for c in channels])
    return channels


def render(scene: RayScene, shading: Shading, directions: Float, samples: int) -> Float:
    """Return radiance (M, q, 3) under each of (M, S, 3) directions, over all subsamples."""
    count = len(shading.normal) // samples
    colours = [c.reshape(samples, count, 3) for c in shading.colours]
    out = np.zeros((len(directions), count, 3), np.float32)
    for m in range(len(directions)):
        lit = _lit(scene, shading, directions, np.array([m]), np.arange(samples), count)
        out[m] = sum(
            np.einsum("sp,spc->pc", v[:, 0], c) for v, c in zip(lit, colours, strict=True)
        ) / np.float32(samples)
    return out


def one_light(
    scene: RayScene, shading: Shading, hits: slice, towards: Float, channels: list[Float]
) -> None:
    """Fill each channel (p,) with what a light in direction `towards` (3,) gives the hits.

    Only hits that face the light cast a ray; those that face away do so where light passes through.
    """
    rest = iter(channels)
    cosine = shading.normal[hits] @ towards
    lit = (cosine > 0).nonzero()[0]
    shadowed = scene.occluded(shading.front[hits].take(lit, axis=0), towards[None], finite=True)
    values = np.maximum(cosine, 0, out=next(rest))
    values[lit[shadowed]] = 0
    if shading.through is not None and shading.back is not None:
        values = np.maximum(-cosine, 0, out=next(rest))
        values[~shading.thin[hits]] = 0
        behind = values.nonzero()[0]
        origins = shading.back[hits].take(behind, axis=0)
        blocked = scene.occluded(origins, towards[None], finite=True)
        values[behind[blocked]] = 0
    if shading.gloss is not None:
        values, free = next(rest), lit[~shadowed]
        values[:] = 0
        view = shading.view if len(shading.view) == 1 else shading.view[hits][free]
        values[free] = ggx(
            shading.normal[hits][free],
            view,
            towards,
            cosine[free],
            shading.alpha[hits][free],
            shading.f0[hits][free],
        )
