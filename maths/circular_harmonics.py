"""Circular harmonics: how a sprite's light depends on where on a ring the lamp stands.

    B0 = 1 / sqrt(2 pi),  B(2h-1) = sin(h t) / sqrt(pi),  B(2h) = cos(h t) / sqrt(pi),  h = 1..H

are orthonormal on [0, 2 pi). X(t), the radiance sent back for unit irradiance from azimuth t, keeps
`Y_k = integral X B_k dt`; under lights with coefficients L_k it sends back `sum_k Y_k L_k`. K = 2H
+ 1.

The parts: `circular_basis` (the functions, rotation, energy), `circular_fit` (from N lights to
coefficients), `circular_window` (less ringing), `circular_lights` (lamps to coefficients),
`circular_signals` (closed forms). Import from here.

References
----------
Evans 2004, Making Pretty Pictures with D3D (the technique).
Ramamoorthi, Hanrahan 2001, An Efficient Representation for Irradiance Environment Maps (order 2 is
enough).
"""

from maths.circular_basis import (
    evaluate,
    harmonic_of,
    reconstruct,
    relight,
    rotate,
    truncation_rms,
)
from maths.circular_fit import Fit, fit_weights, leave_one_out, noise_gain, predicted_error
from maths.circular_lights import (
    project_environment,
    project_sphere,
    project_sun,
    ring_coordinates,
    ring_direction,
)
from maths.circular_signals import alias_series, lambert_lobe, shadow_arc, tilted_lambert
from maths.circular_window import minimum, smallest_window, window

__all__ = [
    "Fit",
    "alias_series",
    "evaluate",
    "fit_weights",
    "harmonic_of",
    "lambert_lobe",
    "leave_one_out",
    "minimum",
    "noise_gain",
    "predicted_error",
    "project_environment",
    "project_sphere",
    "project_sun",
    "reconstruct",
    "relight",
    "ring_coordinates",
    "ring_direction",
    "rotate",
    "shadow_arc",
    "smallest_window",
    "tilted_lambert",
    "truncation_rms",
    "window",
]
