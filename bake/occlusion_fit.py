"""Whole bands of occlusion on two grids, by least squares: the encoding "bands".

A lookup mixes eight texels, so that texels are chosen for what lookups give, not for what is true
in their middles: those coefficients whose trilinear lookups come closest, in the sum of squares, to
what was traced in the voxels outside the solid. Smooth as an occlusion is, grids of about half the
voxels then lose little, and the bytes are spent on bands. Low bands, which all lights see, take the
finer grid. Texels lie closer in the middle, where the mesh is, and along its long axes.

Memory: 150 bytes a voxel traced and 20 a number stored.

Reference
---------
Hestenes, Stiefel 1952, Methods of Conjugate Gradients for Solving Linear Systems.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.occlusion import Box
from maths.occlusion_shadow import occlusion_unwarp, occlusion_warp
from maths.trilinear import Size, corners, looked_up

Array = NDArray[np.float64]
Float = NDArray[np.float32]

WARP = 0.5  # voxels are 1.5 times as fine in the middle, and 1.5 times as coarse at the edge
COARSER = 0.75  # voxels an axis of the coarser grid, of the finer one's
ROUND = 0.5  # power of an axis' length that its voxels grow with: 0 a cube of them, 1 cubic voxels
# Weight of the first guess, of a traced voxel's: it decides only texels that none of them touches
HELD = 1e-3
STEPS = 16  # the error falls by a third a step: 1e-7
LEAST = 2  # texels an axis


def split(K: int) -> tuple[int, int]:
    """Return how many of K components take the finer grid, in fours, and how many the coarser.

    >>> split(64), split(36), split(3)
    ((16, 48), (12, 24), (3, 0))
    """
    fine = min(K, 4 * -(-K // 16))
    return fine, K - fine


def sizes(box: Box, K: int, values: int) -> tuple[Size, Size]:
    """Return texels (x, y, z) of both grids, that of four numbers each K components take at most
    `values` numbers, but for grids of 2^3."""
    fine, coarse = (4 * -(-count // 4) for count in split(K))
    aspect = np.asarray(box.half_extent, np.float64) ** ROUND
    aspect = aspect / np.prod(aspect) ** (1 / 3)
    second = _size(aspect, values * COARSER**3 / (fine + coarse * COARSER**3))
    first = _size(aspect, (values - coarse * int(np.prod(second))) / fine)
    return first, second


def _size(aspect: Array, texels: float) -> Size:
    """Return the largest grid of that aspect within a number of texels."""
    for n in np.arange(np.cbrt(max(texels, 1.0)) + 1, 0, -0.01):
        x, y, z = (max(LEAST, int(v)) for v in np.floor(n * aspect + 0.5))
        if x * y * z <= texels:
            return x, y, z
    return LEAST, LEAST, LEAST


def fit(terms: Float, inside: NDArray[np.bool_], size: Size, warp: float) -> Float:
    """Return the volume (z, y, x, c) of texels `size` (x, y, z) whose lookups fit best.

    terms : (n, n, n, c) traced, what is inside filled from outside.  inside : (n, n, n), those that
    do not count.  warp : of `occlusion_warp`.
    """
    from scipy.sparse import csr_array

    n, c, count = len(terms), terms.shape[-1], int(np.prod(size))
    outside = np.flatnonzero(~inside.ravel())
    z, y, x = np.unravel_index(outside, inside.shape)
    at = (np.stack([x, y, z], axis=1) + 0.5) / n
    indices, weights = corners(occlusion_warp(at, warp), size)
    rows = np.arange(0, 8 * len(outside) + 1, 8)
    A = csr_array((weights.ravel(), indices.ravel(), rows), shape=(len(outside), count))
    wanted = terms.reshape(-1, c)[outside]
    guess = looked_up(terms, _middles(size, warp))
    residual = A.T @ (wanted - A @ guess)
    found = guess + _solved(A.T @ A, residual)
    return np.ascontiguousarray(found.reshape(size[2], size[1], size[0], c), np.float32)


def _middles(size: Size, warp: float) -> Array:
    """Return places (t, 3) of texels' middles in an even volume, x fastest, then y, then z."""
    z, y, x = ((np.arange(n) + 0.5) / n for n in size[::-1])
    at = np.stack(np.meshgrid(z, y, x, indexing="ij"), axis=-1)[..., ::-1]
    return occlusion_unwarp(at.reshape(-1, 3), warp)


def _solved(H: Any, b: Float) -> Float:
    """Solve (H + HELD) x = b (t, c), each column on its own, by conjugate gradients."""
    scale = 1 / (H.diagonal() + np.float32(HELD))[:, None]
    x, r = np.zeros_like(b), b
    q = z = scale * r
    rz = np.sum(r * z, axis=0)
    for _ in range(STEPS):
        Hq = H @ q + np.float32(HELD) * q
        alpha = _over(rz, np.sum(q * Hq, axis=0))
        x, r = x + alpha * q, r - alpha * Hq
        z = scale * r
        before, rz = rz, np.sum(r * z, axis=0)
        q = z + _over(rz, before) * q
    return np.asarray(x)


def _over(a: Float, b: Float) -> Float:
    """Return a / b, 0 where nothing is left."""
    return np.where(b > 0, a / np.where(b > 0, b, 1), 0)
