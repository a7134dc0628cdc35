"""Irradiance from a lat-long map of radiance: texel by texel, and from nine harmonics for shaders.

The harmonics keep the clamped cosine up to l = 2, which is within 3/32 of the true one everywhere,
the worst being a light on the horizon. The error of `harmonic_irradiance` is therefore at most 3/32
of the integral of radiance over all directions: 9.4 % of a lone sun's perpendicular irradiance, and
nearly nothing under an even sky.

References
----------
Ramamoorthi, Hanrahan 2001, An Efficient Representation for Irradiance Environment Maps, eq. 5 to
13.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.spherical_harmonics import evaluate
from maths.spherical_projection import cosine_factors, project_latlong

Array = NDArray[np.float64]

COSINE = np.repeat(cosine_factors(2), [1, 3, 5])
"""Clamped cosine, a factor for each harmonic: pi, 2 pi / 3, pi / 4."""
BOUND = 3 / 32
"""Largest |clamped cosine - its part up to l = 2|, at a right angle: |0 - (1/4 - 5/32)|."""
CHUNK = 2**22
"""Products of normals and texels held at a time: 32 MB."""


def environment_irradiance(radiance: ArrayLike, normals: ArrayLike, *, cuts: int = 1) -> Array:
    """Irradiance of a map whose texels are even: `sum L max(0, n . integral of w over the texel)`.

    radiance : (h, w, c) lat-long, W/(m^2 sr).  normals : (..., 3) unit.  cuts : texels are cut in
    cuts^2; what lies wholly above the horizon is exact as it is, and a texel that the horizon
    crosses errs by its solid angle times its height over the horizon.
    Takes h w cuts^2 operations a normal. Returns (..., c), W/m^2.

    >>> E = environment_irradiance(np.ones((8, 16, 1)), [[0.0, 1.0, 0.0]])
    >>> round(float(E[0, 0] / np.pi), 12)
    1.0
    """
    L = np.asarray(radiance, np.float64)
    h, w, channels = L.shape
    moments = _moments(h * cuts, w * cuts).reshape(-1, 3)
    values = L.repeat(cuts, axis=0).repeat(cuts, axis=1).reshape(-1, channels)
    n = np.asarray(normals, np.float64)
    flat = n.reshape(-1, 3)
    step = max(1, CHUNK // len(moments))
    parts = [
        np.maximum(flat[i : i + step] @ moments.T, 0.0) @ values for i in range(0, len(flat), step)
    ]
    found = np.concatenate(parts) if parts else np.zeros((0, channels))
    return found.reshape(*n.shape[:-1], channels)


def irradiance_harmonics(radiance: ArrayLike) -> Array:
    """The nine harmonics of a map's irradiance, `A_l L_lm`, index l (l + 1) + m.

    radiance : (h, w, c) lat-long, exact for even texels. Returns (9, c), for `harmonic_irradiance`.
    """
    return np.asarray(COSINE[:, None] * project_latlong(radiance, 2))


def harmonic_irradiance(normals: ArrayLike, harmonics: ArrayLike) -> Array:
    """Irradiance (..., c) on normals (..., 3) from harmonics (9, c); never below 0.

    >>> E = harmonic_irradiance([0.0, 0.0, 1.0], irradiance_harmonics(np.ones((8, 16, 1))))
    >>> bool(abs(E[0] / np.pi - 1) < 0.01)
    True
    """
    return np.asarray(np.maximum(0.0, evaluate(normals, 2) @ np.asarray(harmonics, np.float64)))


def _moments(h: int, w: int) -> Array:
    """Integral of the direction over each texel (h, w, 3), exact."""
    q, p = np.pi * np.arange(h + 1) / h, 2 * np.pi * (np.arange(w + 1) / w - 0.5)
    ring = np.diff(0.5 * (q - np.sin(q) * np.cos(q)))
    rise = np.diff(0.5 * np.sin(q) ** 2)
    x, z = ring[:, None] * -np.diff(np.cos(p)), ring[:, None] * -np.diff(np.sin(p))
    return np.stack([x, np.broadcast_to(rise[:, None] * (2 * np.pi / w), (h, w)), z], axis=-1)
