"""A canvas of translucent light: bands, noises and layers of premultiplied linear colour."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from maths.colour import srgb_encode

Array = NDArray[np.float64]
FINER = 2  # samples of a pixel along each axis
WAVES = 28  # plane waves of a noise


class Canvas:
    """A square from -1 to 1 (y up) on which layers are laid over one another.

    x, y : (n, n) coordinates of samples. pixel : width of a pixel of the picture.
    """

    def __init__(self, size: int, seed: int) -> None:
        samples = size * FINER
        across = (np.arange(samples) + 0.5) / samples * 2 - 1
        self.x, self.y = np.meshgrid(across, -across)
        self.pixel = 2.0 / size
        self._bits = np.random.PCG64(seed)
        self._light = np.zeros((samples, samples, 4))

    def chance(self, low: float = 0.0, high: float = 1.0, count: int = 1) -> Array:
        """Uniform numbers (count,); PCG64's raw stream is the same in every version of numpy."""
        raw = np.asarray(self._bits.random_raw(count), np.uint64)
        return low + (high - low) * ((raw >> np.uint64(11)).astype(np.float64) * 2.0**-53)

    def noise(self, turns: float) -> Array:
        """Smooth noise (n, n), mean 0, deviation 1, of about `turns` waves across the canvas."""
        total = np.zeros_like(self.x)
        angle, phase = (self.chance(0, 2 * np.pi, WAVES) for _ in range(2))
        pace = np.pi * turns * self.chance(0.6, 1.4, WAVES)
        for a, p, k in zip(angle, phase, pace, strict=True):
            total += np.cos(k * (np.cos(a) * self.x + np.sin(a) * self.y) + p)
        return total * np.sqrt(2.0 / WAVES)

    def lay(self, alpha: ArrayLike, colour: ArrayLike) -> None:
        """Lay alpha (n, n), 0 to 1, of a colour (3,) or (n, n, 3) over what is there."""
        a = np.clip(np.asarray(alpha, np.float64), 0.0, 1.0)[..., None]
        rgb = np.broadcast_to(np.asarray(colour, np.float64), (*a.shape[:2], 3))
        self._light = np.concatenate([rgb * a, a], axis=-1) + self._light * (1.0 - a)

    def save(self, path: Path) -> None:
        """Fade to nothing at the border, average samples to pixels, and write a PNG."""
        edge = np.maximum(np.abs(self.x), np.abs(self.y))
        light = self._light * smooth((1.0 - edge) / 0.03)[..., None]
        n = len(light) // FINER
        light = light.reshape(n, FINER, n, FINER, 4).mean(axis=(1, 3))
        alpha = light[..., 3:]
        # Straight alpha of whole codes; what is left of the light is kept in the colour
        codes = np.rint(255 * alpha)
        colour = np.where(codes > 0, light[..., :3] / np.maximum(codes / 255, 1e-9), 0.0)
        rgb = np.rint(255 * srgb_encode(np.clip(colour, 0.0, 1.0)))
        data = np.concatenate([rgb, codes], axis=-1).astype(np.uint8)
        Image.fromarray(data, "RGBA").save(path, optimize=True)


def smooth(t: ArrayLike) -> Array:
    """3 t^2 - 2 t^3, held at 0 and 1."""
    x = np.clip(np.asarray(t, np.float64), 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


def band(distance: ArrayLike, width: float) -> Array:
    """A bell over the distance from a line; `width` where it has fallen to 1/e."""
    return np.asarray(np.exp(-np.square(np.minimum(np.abs(distance) / width, 6.0))))


def inside(distance: ArrayLike, edge: float) -> Array:
    """1 where a signed distance is negative, 0 outside, over a soft edge."""
    return smooth(0.5 - np.asarray(distance) / edge)


def mix(low: ArrayLike, high: ArrayLike, share: ArrayLike) -> Array:
    """From one colour to another by a share (...), as (..., 3)."""
    s = np.clip(np.asarray(share, np.float64), 0.0, 1.0)[..., None]
    return np.asarray(np.asarray(low) * (1.0 - s) + np.asarray(high) * s)
