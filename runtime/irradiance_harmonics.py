"""The nine harmonics of an environment's irradiance, turned as the scene turns the map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maths import transforms
from maths.environment_irradiance import basis

Array = NDArray[np.float64]


def turned(harmonics: Array, angle: float) -> Array:
    """Harmonics (9, 3) of the same light turned about +y by `angle` radians, counter-clockwise."""
    # Bands turn within themselves, so nine directions in general position fix how; more are stabler
    spread = np.array([[np.sin(7 * i + 1), np.cos(5 * i), np.sin(3 * i + 2)] for i in range(16)])
    directions = spread / np.linalg.norm(spread, axis=1, keepdims=True)
    back = basis(directions @ transforms.rotation("y", -angle).T)
    return np.asarray(np.linalg.lstsq(basis(directions), back @ harmonics, rcond=None)[0])
