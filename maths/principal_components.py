"""Principal components about zero: the few numbers a record that keep the most of its energy.

Uncentred, because zero must stay zero: no light gives no radiance, and nothing filters to nothing.
scikit-learn adds nothing here: its PCA always centres, and its TruncatedSVD iterates from random
starts (ARPACK, or Halko's projections) for matrices too wide to factor; a test compares with it.
Records are many and short: the Gram matrix in double precision is one product, and where its
squared condition would hide small directions, QR by blocks and one small SVD find them.

References
----------
Eckart, Young 1936, The Approximation of One Matrix by Another of Lower Rank.
Demmel, Grigori, Hoemmen, Langou 2012, Communication-Optimal Parallel and Sequential QR and LU
Factorizations (QR of tall matrices by blocks).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

BLOCK = 8192  # rows
# Largest over smallest singular value up to which a Gram matrix is trusted: it squares them, and
# 1e5 leaves the smallest of them 6 digits
TRUSTED = 1e5
TIED = 1e-5  # relative gap of singular values up to which rounding of records chooses directions
SLACK = 1.01  # of the least RMS residual that is possible


@dataclass(frozen=True)
class Components:
    """An orthonormal set of directions and the energy along them.

    vectors : (count, p), rows orthonormal, those past the rank 0.  singular : (count,)
    singular values, falling.  rank : how many count.  residual : RMS over all n p entries of what
    the set leaves out.  optimum : the least that any set of that size could.  warnings : text.
    """

    vectors: Array
    singular: Array
    rank: int
    residual: float
    optimum: float
    warnings: tuple[str, ...]


def principal_components(records: ArrayLike, count: int) -> Components:
    """Find the `count` directions that keep most of the sum of squares of records (n, p).

    Signs are fixed: the largest magnitude of a direction is positive, the first of equal ones. So
    are directions of equal singular values, as symmetrical objects have.
    Where the rank is lower than `count`, rows of zeros fill up, with a warning. Scores are
    `records @ vectors.T`. Raises ValueError for other shapes and for values that are not finite,
    and ArithmeticError should the residual exceed the optimum by more than a hundredth.
    """
    x = np.asarray(records)
    if x.ndim != 2 or x.dtype.kind not in "fiu" or not x.size or count < 1:
        raise ValueError("Records are a matrix (n, p) of numbers, components one or more.")
    n, p = x.shape
    blocks = [slice(a, a + BLOCK) for a in range(0, n, BLOCK)]
    peak = 0.0
    for block in blocks:
        if not np.isfinite(x[block]).all():
            raise ValueError("Records are finite.")
        peak = max(peak, float(np.abs(x[block]).max()))
    if peak == 0:
        zeros = Components(np.zeros((count, p)), np.zeros(count), 0, 0.0, 0.0, ("all zero",))
        return zeros
    # Scale to 1, so that squares neither overflow nor vanish
    scaled = (np.asarray(x[b], np.float64) / peak for b in blocks)
    s, Vt = _by_gram(scaled, p) or _by_qr([np.asarray(x[b], np.float64) / peak for b in blocks])
    # Rounding of n p products of entries up to 1, not of the largest singular value
    rank = int(np.count_nonzero(s > np.finfo(np.float64).eps * max(n, p)))
    kept = min(count, rank)
    Vt = _settled(s[:rank], Vt[:rank])
    vectors, singular = np.zeros((count, p)), np.zeros(count)
    vectors[:kept], singular[:kept] = _signed(Vt[:kept]), s[:kept] * peak
    left = sum(_left(np.asarray(x[b], np.float64) / peak, vectors[:kept]) for b in blocks)
    residual = peak * float(np.sqrt(left / (n * p)))
    optimum = peak * float(np.sqrt(np.sum(np.square(s[kept:])) / (n * p)))
    # 1e-12 of the largest entry: rounding, where nothing is left out
    if residual > SLACK * optimum + 1e-12 * peak:
        raise ArithmeticError(f"Components leave {residual:.3g} where {optimum:.3g} is possible.")
    short = (f"{rank} components hold everything: {count - rank} are zero",) if rank < count else ()
    return Components(vectors, singular, rank, residual, optimum, short)


def _by_gram(blocks: Iterator[Array], p: int) -> tuple[Array, Array] | None:
    """Singular values and right vectors by the Gram matrix; None where it hides some of them."""
    gram = np.zeros((p, p))
    for block in blocks:
        gram += block.T @ block
    squares, vectors = np.linalg.eigh(gram)
    if not squares[0] * TRUSTED**2 > squares[-1]:
        return None
    return np.sqrt(squares[::-1]), vectors.T[::-1]


def _by_qr(blocks: list[Array]) -> tuple[Array, Array]:
    """Singular values and right vectors of blocks of rows, to the rounding of the largest."""
    R = np.linalg.qr(np.vstack([np.linalg.qr(block, mode="r") for block in blocks]), mode="r")
    _, s, Vt = np.linalg.svd(R, full_matrices=False)
    return s, Vt


def _settled(s: Array, Vt: Array) -> Array:
    """Turn directions of equal singular values, so that not the rounding of a library chooses which
    of them are kept. What that loses is below TIED of their energy."""
    found, start = Vt.copy(), 0
    for end in range(1, len(s) + 1):
        if end < len(s) and s[end] > s[end - 1] * (1 - TIED):
            continue
        if end - start > 1:
            found[start:end] = _nearest_to_axes(Vt[start:end])
        start = end
    return found


def _nearest_to_axes(rows: Array) -> Array:
    """Return the orthonormal basis of the span of `rows`, itself one, whose first direction is that
    nearest to any axis, the first of equals, and so on in what is left."""
    left, found = rows.copy(), np.empty_like(rows)
    for direction in found:
        lengths = np.sum(np.square(left), axis=0)
        axis = left[:, np.argmax(lengths >= lengths.max() * (1 - 1e-9))]
        axis = axis / np.linalg.norm(axis)
        direction[:] = axis @ left
        left -= np.outer(axis, direction)
    return found


def _signed(vectors: Array) -> Array:
    """Turn each row so that its entry of largest magnitude is positive, the first of equals."""
    magnitude = np.abs(vectors)
    # Equal but for rounding counts as equal, so that symmetric data get one sign everywhere
    first = np.argmax(magnitude >= magnitude.max(axis=1, keepdims=True) * (1 - 1e-9), axis=1)
    return np.asarray(vectors * np.sign(vectors[np.arange(len(vectors)), first])[:, None])


def _left(x: Array, vectors: Array) -> float:
    return float(np.sum(np.square(x - (x @ vectors.T) @ vectors)))
