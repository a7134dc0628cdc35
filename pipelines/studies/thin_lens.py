"""A flat sprite through a true lens, and through a mip chain as the player looks it up.

The truth shifts copies of the finest picture and knows nothing of mips; the lookup reads two
levels, four texels each. That the shader reads the same is tested where the shader is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]

LENS_SAMPLES = 1024
CONTENT = 512  # texels of level 0 along the sprite's longer side
FINE = 2  # texels of the truth to one of level 0
PHASE = 0.37  # of a pixel, by which the sprite lies off the pixel grid
MAX_LOD = 8.0


def aperture(diameter: float, samples: int = LENS_SAMPLES) -> NDArray[np.float64]:
    """Return shifts (samples, 2) over a disc of `diameter`, by Vogel's spiral: even to the rim."""
    i = np.arange(samples) + 0.5
    r, turn = np.sqrt(i / samples), np.pi * (3 - np.sqrt(5)) * i
    return diameter / 2 * np.stack([r * np.cos(turn), r * np.sin(turn)], axis=-1)


def through_lens(sprite: Float, diameter: float, samples: int = LENS_SAMPLES) -> tuple[Float, int]:
    """Return the mean of shifted copies of a sprite (h, w, c), and the margin added on each side.

    A shift by part of a texel weighs the texels on both sides of it. The copies are laid out as one
    kernel and convolved by FFT: the same sum in another order.
    """
    from scipy import fft

    margin = int(np.ceil(diameter / 2)) + 1
    kernel = np.zeros((2 * margin + 1, 2 * margin + 1))
    shifts = aperture(diameter, samples) + margin
    whole = np.floor(shifts).astype(np.int64)
    part = shifts - whole
    for dx in (0, 1):
        for dy in (0, 1):
            weight = np.abs(1 - dx - part[:, 0]) * np.abs(1 - dy - part[:, 1]) / samples
            np.add.at(kernel, (whole[:, 1] + dy, whole[:, 0] + dx), weight)
    size = [fft.next_fast_len(n + 2 * margin, real=True) for n in sprite.shape[:2]]
    spectrum = fft.rfft2(kernel.astype(np.float32), size)
    blurred = [
        fft.irfft2(fft.rfft2(sprite[..., c], size) * spectrum, size) for c in range(sprite.shape[2])
    ]
    height, width = (n + 2 * margin for n in sprite.shape[:2])
    return np.stack(blurred, axis=-1)[:height, :width].astype(np.float32), margin


def averaged(image: Float, edges: NDArray[np.float64], axis: int) -> Float:
    """Average an image between consecutive edges (n + 1,), in texels, along an axis; 0 outside."""
    image = np.moveaxis(image, axis, 0)
    total = np.concatenate(
        [np.zeros((1, *image.shape[1:])), np.cumsum(image, axis=0, dtype=np.float64)]
    )
    at = np.clip(edges, 0, len(image))
    low = np.minimum(at.astype(np.int64), len(image) - 1)
    part = (at - low).reshape(-1, *[1] * (image.ndim - 1))
    upto = total[low] * (1 - part) + total[low + 1] * part
    width = np.diff(edges).reshape(-1, *[1] * (image.ndim - 1))
    return np.moveaxis((np.diff(upto, axis=0) / width).astype(np.float32), 0, axis)


def sampled(level: Float, at: NDArray[np.float64], axis: int) -> Float:
    """Return linear lookups at texel coordinates `at` (n,) along an axis, clamped to the edge."""
    level = np.moveaxis(level, axis, 0)
    at = np.clip(at - 0.5, 0, len(level) - 1)
    low = np.minimum(at.astype(np.int64), max(len(level) - 2, 0))
    part = (at - low).astype(np.float32).reshape(-1, *[1] * (level.ndim - 1))
    out = level[low] * (1 - part) + level[np.minimum(low + 1, len(level) - 1)] * part
    return np.moveaxis(np.asarray(out), 0, axis)


@dataclass(frozen=True)
class Screen:
    """Pixels on which a sprite stands. pixels : of its longer side; margin : pixels around it."""

    size: tuple[int, int]
    pixels: float
    margin: int

    @property
    def texels_per_pixel(self) -> float:
        """Texels of level 0 to a pixel."""
        return CONTENT / self.pixels

    def edges(self, axis: int) -> NDArray[np.float64]:
        """Return the pixels' edges along y (0) or x (1), in texels of level 0's content."""
        count = int(np.ceil(self.size[axis] / self.texels_per_pixel)) + 2 * self.margin + 1
        return np.asarray((np.arange(count + 1) - self.margin - PHASE) * self.texels_per_pixel)

    def truth(self, blurred: Float, margin: int) -> Float:
        """Average a blurred sprite of FINE times the size, with its margin, over the pixels."""
        for axis in (0, 1):
            blurred = averaged(blurred, self.edges(axis) * FINE + margin, axis)
        return blurred

    def lookup(self, level: Float, number: int, border: int) -> Float:
        """Look a mip level up at the pixels' centres, bilinearly."""
        for axis in (0, 1):
            edges = self.edges(axis)
            level = sampled(level, ((edges[1:] + edges[:-1]) / 2 + border) / 2**number, axis)
        return level


def level_of(
    coc_texels: float, texels_per_pixel: float, scale: float, max_lod: float = MAX_LOD
) -> float:
    """Return the level that the player reads: the coarser of the hardware's and the lens's."""
    lens = min(np.log2(max(scale * coc_texels, 1.0)), max_lod)
    return float(max(np.log2(texels_per_pixel), lens, 0.0))


def looked_up(screen: Screen, levels: Sequence[Float], border: int, lod: float) -> Float:
    """Return what textureLod gives every pixel: two levels weighed by the fraction of the level."""
    low = min(int(lod), len(levels) - 1)
    part = np.float32(lod - low)
    fine = screen.lookup(levels[low], low, border)
    if part == 0 or low + 1 == len(levels):
        return fine
    return fine + part * (screen.lookup(levels[low + 1], low + 1, border) - fine)
