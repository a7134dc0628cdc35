"""What a linear, edge-clamped lookup of a 3D texture reads: eight texels and their weights."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float32]
Size = tuple[int, int, int]


def corners(places: ArrayLike, size: Size) -> tuple[NDArray[np.int64], Float]:
    """Return flat indices (m, 8), x fastest, then y, then z, and weights (m, 8) that sum to 1.

    places : (m, 3) texture coordinates x, y, z; texel i has its middle at (i + 1/2) / n, and beyond
    the outermost middles those are read.  size : texels (x, y, z).

    >>> indices, weights = corners([[0.5, 0.25, 0.0]], (2, 2, 1))
    >>> indices[0, :4].tolist(), weights[0, :4].tolist()
    ([0, 1, 2, 3], [0.5, 0.5, 0.0, 0.0])
    """
    n = np.asarray(size, np.int64)
    at = np.clip(np.asarray(places, np.float64) * n - 0.5, 0, n - 1)
    low = np.minimum(at.astype(np.int64), np.maximum(n - 2, 0))
    share = (at - low).astype(np.float32)
    ends = np.stack([low, np.minimum(low + 1, n - 1)])
    shares = np.stack([1 - share, share])
    indices = np.empty((len(at), 8), np.int64)
    weights = np.empty((len(at), 8), np.float32)
    for corner, (z, y, x) in enumerate(np.ndindex(2, 2, 2)):
        indices[:, corner] = (ends[z, :, 2] * n[1] + ends[y, :, 1]) * n[0] + ends[x, :, 0]
        weights[:, corner] = shares[z, :, 2] * shares[y, :, 1] * shares[x, :, 0]
    return indices, weights


def looked_up(volume: NDArray[np.float32], places: ArrayLike) -> Float:
    """Return the values (m, c) of a volume (z, y, x, c) at texture coordinates (m, 3).

    >>> looked_up(np.float32([[[[0.0], [1.0]]]]), [[0.5, 0.5, 0.5]]).tolist()
    [[0.5]]
    """
    z, y, x, count = volume.shape
    flat = np.asarray(volume, np.float32).reshape(-1, count)
    indices, weights = corners(places, (x, y, z))
    found = np.zeros((len(indices), count), np.float32)
    for corner in range(8):
        found += weights[:, corner, None] * flat[indices[:, corner]]
    return found
