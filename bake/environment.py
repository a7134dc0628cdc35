"""An environment map becomes a small one, its energy unchanged, for the player to project on any
basis.

Circular harmonics of a few terms see nothing finer than a few degrees, so 64 x 32 texels of exact
area means serve every sprite, whatever its ring and wherever it looks.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from formats.environment import Environment
from formats.errors import InputError
from maths.transforms import latlong_solid_angles

Float = NDArray[np.float32]
BRIGHTEST = 1e30  # sums of many are still finite in float32
MOST_BELOW = 0.1  # of the light; six real maps with such values have .002 to .048
SUFFIXES = (".exr", ".hdr", ".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class Params:
    """Knobs. width : texels round the horizon; the map is half as high. rotate : radians that the
    map is turned about +y, counter-clockwise from above."""

    width: int = 64
    rotate: float = 0.0


def load(path: Path) -> Float:
    """Read a lat-long map (h, w, 3), linear radiance. InputError for what is not one."""
    if not path.is_file():
        raise InputError(path, "", "no such file", "check the path")
    suffix = path.suffix.lower()
    if suffix == ".exr":
        from formats.files import apart

        image = next(iter(apart.read_exr(path).values()))
    elif suffix == ".hdr":
        from formats.files import rgbe

        image = rgbe.read(path)
    elif suffix in SUFFIXES:
        from formats.files import image as picture

        image = picture.read(path)
    else:
        raise InputError(path, "suffix", suffix, f"use one of {', '.join(SUFFIXES)}")
    if image.shape[2] == 1:
        image = np.repeat(image, 3, axis=2)
    if image.shape[1] != 2 * image.shape[0]:
        size = f"{image.shape[1]}x{image.shape[0]}"
        raise InputError(path, "size", size, "a lat-long map is twice as wide as high")
    return np.ascontiguousarray(image[..., :3], np.float32)


def resample(
    radiance: Float, *, params: Params, progress: workers.Progress = workers.silent
) -> Environment:
    """Turn and shrink a lat-long map.

    Values below 0, which sharpening filters leave beside lamps, count as 0 and are told. InputError
    where they take more than `MOST_BELOW` of the light, and where radiance is not finite.
    """
    radiance = np.asarray(radiance)
    if radiance.ndim != 3 or radiance.shape[2:] != (3,) or not radiance.size:
        raise InputError("environment", "shape", str(radiance.shape), "give an image (h, w, 3)")
    if radiance.dtype.kind not in "fiu":
        raise InputError("environment", "type", str(radiance.dtype), "give numbers")
    bad = ~((radiance >= -BRIGHTEST) & (radiance <= BRIGHTEST))
    if bad.any():
        row, column, channel = (int(i) for i in np.argwhere(bad)[0])
        value = float(radiance[row, column, channel])
        where = f"texel (column {column}, row {row})"
        raise InputError("environment", where, value, "radiance must be finite, at most 1e30")
    radiance, below = _from_zero(radiance)
    if not 2 <= params.width <= 4096 or params.width % 2:
        remedy = "choose an even number from 2 to 4096"
        raise InputError("environment", "width", params.width, remedy)
    if not abs(params.rotate) < 1e6:
        raise InputError("environment", "rotate", params.rotate, "give finite radians")
    # One layout, so that sums have one order
    exact = np.ascontiguousarray(radiance, np.float64)
    height, width = radiance.shape[:2]
    turned = _area_weights(width, params.width, params.rotate / (2 * np.pi))
    rows = _row_weights(height, params.width // 2)
    small = np.einsum("ih,hwc,jw->ijc", rows, exact, turned, optimize=True)
    solid, fine = latlong_solid_angles(*small.shape[:2]), latlong_solid_angles(height, width)
    before = np.einsum("h,hwc->c", fine, exact)
    after = np.einsum("h,hwc->c", solid, small)
    quality = {
        "mean_radiance": [float(x) for x in before / (4 * np.pi)],
        "peak_radiance": float(radiance.max()),
        "energy_error": float(np.abs(after - before).max() / max(before.max(), 1e-30)),
        "source_size": [width, height],
        **below,
    }
    return Environment(radiance=small.astype(np.float32), quality=quality)


def _from_zero(radiance: Float) -> tuple[Float, dict[str, Any]]:
    """Return the map without values below 0, and what the report says of them."""
    below = radiance < 0
    if not below.any():
        return radiance, {}
    light = (
        np.abs(radiance, dtype=np.float64)
        * latlong_solid_angles(*radiance.shape[:2])[:, None, None]
    )
    taken = float(light[below].sum() / light.sum())
    share = float(below.mean())
    if taken > MOST_BELOW:
        remedy = f"at most {MOST_BELOW:.0%} of a map may lie below 0: export it again"
        raise InputError("environment", "radiance", f"{taken:.1%} of it below 0", remedy)
    note = f"{share:.2g} of the values lie below 0 ({taken:.2g} of the light): they count as 0"
    told = {"negative_values": share, "negative_light": taken, "notes": [note]}
    return np.maximum(radiance, 0), told


def _area_weights(fine: int, coarse: int, shift: float) -> NDArray[np.float64]:
    """Return (coarse, fine) shares of each fine column in each coarse one, `shift` turns later."""
    edges = np.arange(coarse + 1) / coarse + shift % 1
    starts = np.arange(fine) / fine
    weights = np.zeros((coarse, fine))
    for turn in (0, 1):
        low = np.maximum(edges[:-1, None], starts + turn)
        high = np.minimum(edges[1:, None], starts + turn + 1 / fine)
        weights += np.clip(high - low, 0, None)
    return weights * coarse


def _row_weights(fine: int, coarse: int) -> NDArray[np.float64]:
    """Return (coarse, fine) shares by solid angle, in which the polar angle's cosine is linear."""
    low = np.maximum(np.arange(coarse)[:, None] / coarse, np.arange(fine) / fine)
    high = np.minimum(np.arange(1, coarse + 1)[:, None] / coarse, np.arange(1, fine + 1) / fine)
    overlap = np.where(high > low, np.cos(np.pi * low) - np.cos(np.pi * np.maximum(high, low)), 0.0)
    return np.asarray(overlap / overlap.sum(axis=1, keepdims=True))
