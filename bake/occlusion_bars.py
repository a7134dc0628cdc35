"""Error bars of an occlusion volume: how far its voxels would come out otherwise.

The rays of a voxel are one spiral, and by how much its even and its odd rays differ is known for
nothing. What the whole spiral errs by is some share of that: 1 for rays that might as well be
independent, as among many thin leaves, about .6 along a smooth outline. So some voxels are traced
again with other turns, and what they come out apart is held against what their halves are: that
share, band by band, is the asset's own. A single voxel's halves say little (25 numbers that are not
independent, often none of them where few rays meet anything), those of it and its 26 neighbours
enough: their mean square is taken.

References
----------
L'Ecuyer, Lemieux 2002, Recent Advances in Randomized Quasi-Monte Carlo Methods (error bars from
replicated randomisations).
"""

from __future__ import annotations

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


def scales(
    scene: RayScene, points: Float, where: Cones, keys: Indices, rays: int, found: Estimate
) -> tuple[Array, int]:
    """Return the variance of a coefficient over `found.apart`, for each band (l_max + 1,), and the
    rays that tell it.

    points, where, keys, rays : as `occlusion_rays.project` took them for `found`. 1 where nothing
    tells.
    """
    count = min(len(points), max(LEAST, min(MOST, round(SHARE * len(points)))))
    chosen = np.sort(np.argsort(pcg(keys, SALT), kind="stable")[:count])
    part = where.pick(chosen)
    bands = found.apart.shape[1]
    again = occlusion_rays.project(
        scene, points[chosen], part, keys[chosen], rays, bands - 1, number=1
    )
    off = np.square(again.terms.astype(np.float64) - found.terms[chosen]) / 2
    variance = occlusion_rays.by_bands(off.T).sum(axis=1)
    apart = (found.apart[chosen].astype(np.float64) + again.apart).sum(axis=0) / 2
    told = (variance > 0) & (apart > 0)
    ratio = np.where(told, variance / np.where(told, apart, 1.0), 1.0)
    return ratio, occlusion_rays.total_of(part, rays)


def variances(found: Estimate, scale: Array) -> Array:
    """Return the variance (v, l_max + 1) of a coefficient of each band, each voxel by itself."""
    return np.asarray(found.apart * scale)


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
