"""Counter-based random numbers: an integer hash of what is computed, never of the order of threads.

Every function is exact 32-bit integer arithmetic and has a twin of the same name in
`runtime/glsl/hashing.glsl`. `uniform` is a reserved word there, so the shared name is `uniform01`.

References
----------
Jarzynski, Olano 2020, Hash Functions for GPU Rendering, JCGT 9(3) (one round; nesting of keys).
O'Neill 2014, PCG: A Family of Simple Fast Statistically Good Algorithms (the output function).
"""

import hashlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

MULTIPLIER = np.uint32(747796405)
INCREMENT = np.uint32(2891336453)
OUTPUT_MULTIPLIER = np.uint32(277803737)


def pcg(*keys: ArrayLike) -> NDArray[np.uint32]:
    """Hash one or more integers to 32 bits, `pcg(a, b) = pcg(b + pcg(a))`.

    keys : broadcastable integers, taken modulo 2^32 (so negative ones have their two's complement).
    Returns uint32 of the broadcast shape. Raises ValueError without a key or for keys that are
    not integers.

    >>> int(pcg(0)), int(pcg(1)), int(pcg(1, 2))
    (129708002, 2831084092, 3752912895)
    """
    if not keys:
        raise ValueError("A hash needs at least one key.")
    state = np.zeros((), np.uint32)
    # Wrap modulo 2^32 as a GPU does
    with np.errstate(over="ignore"):
        for key in keys:
            state = (state + _as_uint32(key)) * MULTIPLIER + INCREMENT
            word = (
                (state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state
            ) * OUTPUT_MULTIPLIER
            state = np.asarray((word >> np.uint32(22)) ^ word, np.uint32)
    return state


def uniform01(*keys: ArrayLike) -> NDArray[np.float64]:
    """Hash integers to a uniform number in [0, 1): 24 bits, so that a float32 holds it exactly.

    keys : as `pcg`. Returns float64 of the broadcast shape.

    >>> float(uniform01(7, 3)) == float(np.float32(uniform01(7, 3)))
    True
    """
    return (pcg(*keys) >> np.uint32(8)).astype(np.float64) * 2.0**-24


uniform = uniform01


def key(text: str) -> int:
    """Turn a name (of an asset, a stage) into a 32-bit key for the functions above, by SHA-256.

    >>> key("grove") == key("grove") != key("Grove")
    True
    """
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little")


def _as_uint32(key: ArrayLike) -> NDArray[np.uint32]:
    values = np.asarray(key)
    if values.dtype.kind not in "iub":
        raise ValueError(f"Keys of a hash are integers, not {values.dtype}.")
    # Python integers above 2^63 arrive as uint64, all others as int64 or smaller
    return np.asarray(values.astype(np.uint64) & np.uint64(0xFFFFFFFF), np.uint32)
