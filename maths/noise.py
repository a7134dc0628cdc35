"""Value noise on the integer hash, and sums of its octaves.

Twins of the same names in `runtime/glsl/noise.glsl`: the lattice agrees in every bit, what lies
between to rounding. Arithmetic is in the type of the points (float32 like a GPU, or float64).

References
----------
Perlin 2002, Improving Noise (the quintic blend, whose second derivative is continuous).
Ebert et al. 2002, Texturing and Modeling: A Procedural Approach, ch. 2 (value noise, sums of
octaves).
"""

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.hashing import uniform01

# Each octave is turned by the angle of a 3-4-5 triangle (about z, then about x), so that lattices
# do not line up
TURN_2D = np.array([[0.8, -0.6], [0.6, 0.8]])
TURN_3D = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]])


def value_noise(p: ArrayLike, seed: int = 0) -> NDArray[np.floating]:
    """Smooth noise in [0, 1): random values on the integer lattice, blended between.

    p : (..., 2) or (..., 3), |p| < 2^31.  seed : integer. Returns (...) in the type of p.
    Raises ValueError for other dimensions.

    >>> float(value_noise([3.0, -7.0], 5)) == float(uniform01(5, 3, -7))
    True
    """
    points = np.asarray(p)
    if points.dtype != np.float32:
        points = points.astype(np.float64)
    if points.ndim == 0 or points.shape[-1] not in (2, 3):
        raise ValueError("Noise is for points of two or three dimensions.")
    floor = np.floor(points)
    cell = floor.astype(np.int64)
    f = points - floor
    blend = f * f * f * (f * (f * 6 - 15) + 10)
    # Blend along x, then y, then z, like the twin
    corners = {
        at: uniform01(seed, *(cell[..., i] + at[i] for i in range(len(at)))).astype(points.dtype)
        for at in itertools.product((0, 1), repeat=points.shape[-1])
    }
    for i in range(points.shape[-1]):
        corners = {
            at[1:]: low + (corners[(1, *at[1:])] - low) * blend[..., i]
            for at, low in corners.items()
            if at[0] == 0
        }
    return np.asarray(corners[()])


def fbm(p: ArrayLike, octaves: int, seed: int = 0) -> NDArray[np.floating]:
    """Sum of octaves of `value_noise`, each turned, twice as fine and half as strong, in [0, 1).

    p : (..., 2) or (..., 3).  octaves : 1 or more.  seed : octave i uses seed + i.
    Returns (...) in the type of p. Raises ValueError for no octave.

    >>> bool(0.0 <= fbm([0.3, 0.4, 0.5], 4) < 1.0)
    True
    """
    if octaves < 1:
        raise ValueError("A sum of octaves has one or more.")
    points = np.asarray(p)
    if points.dtype != np.float32:
        points = points.astype(np.float64)
    turn = (2.0 * (TURN_2D if points.shape[-1] == 2 else TURN_3D)).astype(points.dtype)
    total = np.zeros(points.shape[:-1], points.dtype)
    amplitude = points.dtype.type(1.0)
    for i in range(octaves):
        amplitude = amplitude * points.dtype.type(0.5)
        total = total + amplitude * value_noise(points, seed + i)
        points = points @ turn.T
    # The amplitudes sum to 1 - 2^-octaves
    return np.asarray(total / (points.dtype.type(1.0) - amplitude))
