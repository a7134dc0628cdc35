"""A plate of known tilt under a ring of point lights, in closed form: the truth of sprites."""

import numpy as np

from bake.billboard import Params
from maths.circular_basis import rotate
from maths.circular_signals import alias_series, tilted_lambert

POINT = Params(resolution=8, samples=4, sun_diameter=0.0, transmission=0.0, held_out=0)


def tilted_plate(normal, params):
    """Closed form (K,) of a white plate under the lights of `params`, aliases and all."""
    n = np.asarray(normal, np.float64) / np.linalg.norm(normal)
    # Components along the ring's cos t, sin t and axis
    right, left, along = n if params.axis == "view" else (n[0], -n[2], n[1])
    A, B = along * np.sin(params.elevation), np.hypot(right, left) * np.cos(params.elevation)
    # Harmonics fall like 1 / h^2: the first 200,000 leave out under 1e-7
    lobe = rotate(tilted_lambert(A, B, 400_001), np.arctan2(left, right))
    return alias_series(lobe, params.lights, params.terms) / np.pi


def rounding(params):
    """Worst float32 error of a coefficient: a sum of N lights of up to 1 / pi by S subsamples."""
    steps = params.lights + params.samples + 16
    return steps * 2.0**-24 * 2 * np.pi / np.sqrt(np.pi) / np.pi


def whole(master):
    """Terms (K, n, 3) of the texels of view 0 that are all mesh."""
    return master.terms[0][:, master.alpha[0] == 1]
