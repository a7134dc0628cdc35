"""Write soft_sky.hdr: an even sky without a sun, neutral, to be tinted by a light's scale.

    python assets/environments/make_sky.py [FILE]

Radiance 1 at the zenith and 0.62 at the horizon, as of thin cloud (a milder Moon and Spencer 1942);
below, a meadow that gives back a tenth, slightly green.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.files import rgbe

WIDTH, HEIGHT = 128, 64
MEADOW = np.array([0.085, 0.095, 0.060])


def soft_sky() -> NDArray[np.float32]:
    """Lat-long radiance (64, 128, 3); the middle column looks along -z, row 0 is +y."""
    polar = (np.arange(HEIGHT) + 0.5) * np.pi / HEIGHT
    around = (np.arange(WIDTH) + 0.5) * 2 * np.pi / WIDTH - np.pi
    sine = np.cos(polar)[:, None, None]
    # Slow bands of cloud, the same all round the seam.
    cloud = 0.05 * np.sin(3 * around[None] + 5 * polar[:, None]) * np.sin(polar)[:, None] ** 2
    sky = (
        (0.62 + 0.38 * np.clip(sine, 0, 1)) * np.array([0.985, 1.0, 1.015]) * (1 + cloud[..., None])
    )
    # Cloud and meadow meet within a few degrees.
    share = 1.0 / (1.0 + np.exp(-sine / 0.03))
    return np.asarray(sky * share + MEADOW * (1 - share), dtype=np.float32)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("soft_sky.hdr")
    rgbe.write(target, soft_sky())
