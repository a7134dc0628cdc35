"""How far gathered light may be off: what each texel's own rays say, and what is handed on.

Rays belong to two sets, and half the difference of their means is the error of a texel by its own
rays (`runtime/gather.py`). Light handed on is off in another way: all rays meet the same few
texels, so that what those are off by does not average out, and neither set knows. It is told here
as if what surfaces hand on were off as a whole: the errors of all texels, which are independent,
add up to that of the sum; each bounce hands it on, 1 + q + q^2 + ... times where a bounce has q of
the light before. That is all while every pair of passes hands on the latest light; later on older
means are. Renewed whenever passes have doubled, those give the variance RENEWED times: with means
of 1/2, 1/4, ... of the passes in shares of as much, sum over i, j >= 1 of 2^-max(i, j) = 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formats.lightmap_faces import Faces

Array = NDArray[np.float64]

RENEWED = 3.0
MOST = 0.98
"""Largest share of light that a bounce is taken to hand on."""


@dataclass(frozen=True, eq=False)
class Sums:
    """What texels in use (t,) hold. light : luminance of irradiance.  indirect : of it, what
    surfaces handed on.  albedo : luminance.  apart : half the difference of both sets.  older : >=
    1, passes over those that are in `indirect`, for passes are forgotten while light settles.
    renewed : 1 to RENEWED, the more of the passes have met means."""

    light: Array
    indirect: Array
    albedo: Array
    apart: Array
    older: Array
    renewed: float = RENEWED

    @property
    def variance(self) -> Array:
        """Variance (t,) of each texel's light by its own rays."""
        return self.apart**2 * self.older

    def handed_on(self) -> float:
        """Relative standard error of the light that surfaces hand on, as a whole."""
        sent = float(np.sum(self.albedo * self.light))
        if sent <= 0 or not self.indirect.any():
            return 0.0
        q = min(float(np.sum(self.albedo * self.indirect)) / sent, MOST)
        own = float(np.sqrt(self.renewed * np.sum(self.albedo**2 * self.variance)))
        return own / sent / (1 - q)

    def relative_error(self) -> float:
        """Standard error over light, both RMS over texels; 0 in the dark."""
        power = float(np.sum(self.light**2))
        handed = self.handed_on() ** 2 * float(np.sum(self.indirect**2))
        return float(np.sqrt((self.variance.sum() + handed) / power)) if power > 0 else 0.0


def pooled(values: Array, used: NDArray[np.bool_], faces: Faces) -> tuple[Array, Array]:
    """Return means (t,) of values (t,) over each texel and its neighbours of the same rectangle, at
    most nine, and how many those are.

    A texel's two sets alone have one degree of freedom. used : (h, w) texels that have values.
    """
    rows, _, _, x, y = faces.interior
    h, w = used.shape
    own = np.full((h + 2, w + 2), -1, np.int64)
    own[y + 1, x + 1] = rows
    own[1:-1, 1:-1][~used] = -1
    padded = np.zeros((h + 2, w + 2))
    padded[1:-1, 1:-1][used] = values
    total, count = np.zeros((2, h, w))
    for dy in range(3):
        for dx in range(3):
            same = own[dy : dy + h, dx : dx + w] == own[1:-1, 1:-1]
            total += np.where(same, padded[dy : dy + h, dx : dx + w], 0.0)
            count += same
    return total[used] / count[used], count[used]
