"""Grain: noise of film, a closed form of pixel and frame.

The sum of four bytes of one hash: mean 0, standard deviation 1, never beyond 3.46, close to a bell
curve. It moves 8-bit codes by 4 v (1 - v) of itself, v the encoded value: most at mid grey, nothing
at black and white, so that no code is clipped and the mean of the codes stays what it was.
`grain` has a twin of the same name in `runtime/glsl/grain.glsl`.

References
----------
Irwin 1927, Hall 1927 (sums of uniform numbers).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.hashing import pcg

DEVIATION = float(np.sqrt(4 * (256**2 - 1) / 12))  # of the sum of four bytes
MIDDLE = 4 * 255 / 2  # of it


def grain(x: ArrayLike, y: ArrayLike, frame: ArrayLike = 0) -> NDArray[np.float64]:
    """Noise of mean 0 and standard deviation 1 in [-3.46, 3.46].

    x, y, frame : broadcastable integers >= 0, pixel column, row and number of the frame.
    Returns (...), independent from pixel to pixel and from frame to frame.

    >>> float(np.round(grain(np.arange(8), 0).max(), 3)) < 3.46
    True
    """
    word = pcg(x, y, frame)
    total = sum((word >> np.uint32(shift)) & np.uint32(255) for shift in (0, 8, 16, 24))
    return np.asarray((np.asarray(total, np.float64) - MIDDLE) / DEVIATION)


def strength(encoded: ArrayLike) -> NDArray[np.float64]:
    """How much of the grain an encoded value takes, 1 at mid grey. encoded : (...) in [0, 1].

    >>> strength([0.0, 0.5, 1.0]).tolist()
    [0.0, 1.0, 0.0]
    """
    v = np.asarray(encoded, np.float64)
    return np.asarray(4.0 * v * (1.0 - v))
