"""Error bars of an occlusion volume: how far its voxels would come out otherwise.

The rays of a voxel are one spiral, and by how much its even and its odd rays differ is known for
nothing. What the whole spiral errs by is some share of that: 1 for rays that might as well be
independent, as among many thin leaves, about .6 along a smooth outline. So some voxels are traced
again with other turns, and what they come out apart is held against what their halves are: that
share, band by band, is the asset's own. A single voxel's halves say little (25 numbers that are not
independent, often none of them where few rays meet anything), those of it and its 26 neighbours
enough, but on a coarse grid these lie near the mesh or far from it and are unlike. So the mean over
them is drawn towards the voxel's own figure, by the share of what figures differ by from their
means that is not chance; the voxels traced again tell how much is.

Counted over 48 volumes, of 10 meshes on 6 to 16 voxels a side with 128 and 1,024 rays: 93.2 to
96.1 % of all 95 % intervals hold, RMS 0.75 % from 95. The mean alone: 93.4 to 97.9, 1.15; weights
1 2 1 along each axis: 92.9 to 97.5, 1.0; each voxel by itself: 74 to 92. Student's t for the
degrees of freedom that are left, 2 / (share * chance): 93.8 to 96.8, 0.9; mostly it adds to what is
wide enough, so that 1.96 is kept.

References
----------
Buehlmann 1967, Experience Rating and Credibility, ASTIN Bulletin 4 (the best linear mean of a
group's figure and one's own).
L'Ecuyer, Lemieux 2002, Recent Advances in Randomized Quasi-Monte Carlo Methods (error bars from
replicated randomisations).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import occlusion_rays
from bake.occlusion_rays import Cones, Estimate
from bake.rays import RayScene
from maths.hashing import pcg

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

SHARE = 1 / 40  # of the voxels are traced again
LEAST, MOST = 64, 640  # of them: the scale is then known to 6 % and to 2 %
SALT = 0xE7707


@dataclass(frozen=True)
class Again:
    """What voxels came out as that were traced again. scale : (l_max + 1,) variance of a
    coefficient of each band over `Estimate.apart`, 1 where nothing tells.  chosen : (m,) which
    voxels.  apart : (m, l_max + 1) as in `Estimate`.  rays : that tell it."""

    scale: Array
    chosen: Indices
    apart: Float
    rays: int


def again(
    scene: RayScene, points: Float, where: Cones, keys: Indices, rays: int, found: Estimate
) -> Again:
    """Trace some voxels again with other turns.

    points, where, keys, rays : as `occlusion_rays.project` took them for `found`.
    """
    count = min(len(points), max(LEAST, min(MOST, round(SHARE * len(points)))))
    chosen = np.sort(np.argsort(pcg(keys, SALT), kind="stable")[:count])
    part = where.pick(chosen)
    bands = found.apart.shape[1]
    other = occlusion_rays.project(
        scene, points[chosen], part, keys[chosen], rays, bands - 1, number=1
    )
    off = np.square(other.terms.astype(np.float64) - found.terms[chosen]) / 2
    variance = occlusion_rays.by_bands(off.T).sum(axis=1)
    apart = (found.apart[chosen].astype(np.float64) + other.apart).sum(axis=0) / 2
    tells = (variance > 0) & (apart > 0)
    ratio = np.where(tells, variance / np.where(tells, apart, 1.0), 1.0)
    return Again(ratio, chosen, other.apart, occlusion_rays.total_of(part, rays))


def variances(apart: Float, scale: Array) -> Array:
    """Return the variance (v, l_max + 1) of a coefficient of each band, each voxel by itself."""
    return np.asarray(apart * scale)


def told(apart: Float, again: Again, voxels: Indices, grid: int) -> Array:
    """Return the variance of a coefficient (v,), mean over all, that voxels are told to have.

    apart : (v, l_max + 1) as in `Estimate`.  voxels : (v,) flat indices in a volume of `grid`
    voxels a side.
    """
    own, other = (over_bands(variances(each, again.scale)) for each in (apart, again.apart))
    around = pooled(own, voxels, grid)
    off, differ, near = np.zeros(len(own)), np.zeros(len(other)), around[again.chosen]
    np.divide(own - around, around, out=off, where=around > 0)
    np.divide(own[again.chosen] - other, near, out=differ, where=near > 0)
    # Half the square of two figures' difference is the variance of one
    chance, total = np.mean(np.square(differ)) / 2, np.mean(np.square(off))
    share = 1 - chance / total if total > chance else 0.0
    return np.asarray(around + share * (own - around))


def over_bands(values: Array) -> Array:
    """Return the mean (v,) over all coefficients of what each band has (v, l_max + 1)."""
    sizes = 2 * np.arange(values.shape[1]) + 1
    # Not by BLAS, whose kernels round otherwise
    return np.asarray((values * sizes).sum(axis=1) / sizes.sum())


def pooled(values: Array, voxels: Indices, grid: int) -> Array:
    """Return the means (v,) of values (v,) over each voxel and those of its 26 neighbours that have
    one. voxels : (v,) flat indices in a volume of `grid` voxels a side."""
    sums = np.zeros((2, grid**3))
    sums[0, voxels], sums[1, voxels] = values, 1
    volume = sums.reshape(2, grid, grid, grid)
    for axis in (1, 2, 3):
        before = np.moveaxis(volume, axis, 0)
        after = before.copy()
        after[1:] += before[:-1]
        after[:-1] += before[1:]
        volume = np.moveaxis(after, 0, axis)
    total, count = volume.reshape(2, -1)[:, voxels]
    return np.asarray(total / count)
