"""The player's last step in numpy: exposure, vignette, tone curve, sRGB, grain, dither.

A twin of `runtime/passes/film.frag`, of which all but the vignette is in `maths.colour` and
`maths.grain`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from formats.scene import Scene
from maths import colour, grain


def develop(radiance: ArrayLike, scene: Scene, time: float) -> NDArray[np.uint8]:
    """Return the picture (h, w, 3) that the film of `scene` makes of radiance (h, w, 3) at `time`
    seconds, row 0 on top."""
    film = scene.picture.film
    linear = np.asarray(radiance, np.float64)
    height, width = linear.shape[:2]
    # The player counts rows from the bottom
    row, column = np.arange(height)[::-1, None], np.arange(width)[None]
    x = (2 * (column + 0.5) / width - 1) * width / np.hypot(width, height)
    y = (2 * (row + 0.5) / height - 1) * height / np.hypot(width, height)
    cosine2 = 1 / (1 + x * x + y * y)
    shade = 1 + film.vignette * (cosine2 * cosine2 - 1)
    exposed = linear * 2.0 ** float(film.exposure.at(time)) * shade[..., None]
    shown = colour.srgb_encode(colour.TONEMAPS[film.tonemap](exposed))
    frame = round(time * scene.time.frame_rate) & 0x7FFFFFFF
    noise = colour.dither(column, row, frame)
    if film.grain > 0.0:
        codes = film.grain * grain.strength(shown)
        noise = noise + codes * grain.grain(column, row, frame)[..., None]
    return colour.quantise(shown, noise)
