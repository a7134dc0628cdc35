"""Error bars of a transfer: how far its vertices' vectors would come out otherwise.

The rays of a vertex are one spiral, and by how much its even and its odd rays differ is known for
nothing. What the whole spiral errs by is about half of that, and light that bounces has an error of
its own. So some vertices are traced again with other spins, and what they come out apart is held
against what their halves are: that share, band by band, is the mesh's own.

References
----------
L'Ecuyer, Lemieux 2002, Recent Advances in Randomized Quasi-Monte Carlo Methods (error bars from
replicated randomisations).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bake import occlusion_rays
from maths.hashing import pcg

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

SHARE = 1 / 40  # of the vertices are traced again
LEAST, MOST = 256, 640  # of them
SALT = 0xBA125


def chosen(count: int) -> Indices:
    """Return which of `count` vertices are traced again, in order."""
    some = min(count, max(LEAST, min(MOST, round(SHARE * count))))
    return np.sort(np.argsort(pcg(np.arange(count), SALT), kind="stable")[:some])


def error(one: Float, other: Float, apart: Float, apart_again: Float, which: Indices) -> float:
    """Return the standard error of a coefficient, RMS over all vertices and coefficients.

    one, other : (v, C, K) vectors of the chosen vertices by their own rays, and by others.  apart :
    (n, l_max + 1) mean square by band of what halves differ by, of all vertices; apart_again : (v,
    l_max + 1) that of the other rays.  which : (v,) the chosen vertices.
    """
    off = np.square(one.astype(np.float64) - other).mean(axis=1) / 2
    variance = occlusion_rays.by_bands(off.T).mean(axis=1)
    known = (apart[which].astype(np.float64) + apart_again).mean(axis=0) / 2
    every = apart.mean(axis=0, dtype=np.float64)
    # Where the chosen tell no share, halves or what they came out apart stand as they are
    told = (variance > 0) & (known > 0)
    share = np.where(told, variance / np.where(known > 0, known, 1.0), 1.0)
    bands = np.where(known > 0, share * every, np.maximum(variance, every))
    sizes = 2 * np.arange(len(bands)) + 1
    return float(np.sqrt((bands * sizes).sum() / sizes.sum()))
