"""A drawn or painted picture as a sprite: premultiplied linear light, and mips that look like a
lens.

Memory: 16 bytes a texel of the source, and 16 a texel of each level in floats: 1.2 GB at the most.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bake import mips, workers
from formats import picture_files
from formats.errors import InputError
from formats.files import apart, image
from formats.picture import Picture

Float = NDArray[np.float32]
LARGEST = 65504.0  # of a half float
MINIFIED = 5  # levels that keep their edges where no lens asks for more
FEWEST = 8  # texels of the picture on the last of them


@dataclass(frozen=True)
class Params:
    """Knobs. width, height : texels to shrink to. filter : one of bake.mips.FILTERS. max_lod : the
    coarsest level that the lens will ask for; sizes the transparent border."""

    width: int
    height: int
    # The kaiser is .7 dB nearer to a lens, but where its lobes go below 0 a picture has nothing to
    # take away: cut off there, small pictures gained up to 8 % of light. Less border, too
    filter: str = "gaussian"
    max_lod: float = 0.0


def load(path: Path) -> Float:
    """Read a PNG (sRGB, straight alpha) or EXR (linear, premultiplied) as (h, w, 4) premultiplied.

    Grey, palettes, 8 and 16 bits, with and without alpha. Raises InputError for what is none, has
    several pictures or shows nothing; what is negative counts as 0, alpha over 1 as 1.
    """
    if path.suffix.lower() == ".exr":
        parts = apart.read_exr(path)
        if len(parts) != 1:
            names = ", ".join(parts)
            raise InputError(path, "layers", names, "save one picture, channels RGBA, RGB or Y")
        picture = np.maximum(next(iter(parts.values())), np.float32(0))
    else:
        picture = image.read(path)
    channels = picture.shape[2]
    alpha = picture[..., -1:] if channels in (2, 4) else np.ones_like(picture[..., :1])
    alpha = np.minimum(alpha, np.float32(1))
    rgb = picture[..., :3] if channels > 2 else picture[..., :1]
    colour = np.broadcast_to(rgb, (*picture.shape[:2], 3))
    if path.suffix.lower() != ".exr":
        colour = colour * alpha
    found = np.concatenate([colour, alpha], axis=-1, dtype=np.float32)
    if not found.any():
        raise InputError(path, "pixels", "all transparent", "paint something, or leave the set out")
    return found


def prepare(
    source: Float, *, params: Params, progress: workers.Progress = workers.silent
) -> Picture:
    """Shrink, put borders around and filter. source : (h, w, 4) premultiplied linear.

    Raises InputError for an array of another shape or type, and for values that are not finite.
    """
    source = np.asarray(source)
    if source.ndim != 3 or source.shape[2] != 4 or not source.size or source.dtype.kind != "f":
        shape = f"{source.dtype} {source.shape}"
        raise InputError("picture", "pixels", shape, "give floats (h, w, 4), premultiplied")
    if not np.isfinite(source).all():
        raise InputError("picture", "pixels", "not finite", "repair the picture")
    found = shrunk(source, params.width, params.height)
    clipped = int(np.count_nonzero(found > LARGEST))
    longer = max(params.width, params.height)
    # Small on the screen, a sprite must not lose its edges to the zeros around each level
    minified = min(MINIFIED, np.log2(max(longer / FEWEST, 1.0)))
    told = mips.Params(filter=params.filter, max_lod=max(params.max_lod, float(minified)))
    told.check()
    border, levels = mips.bordered_levels(found[None], told, progress)
    halves = tuple(_stored(level) for level in levels)
    quality = {
        "border": border,
        "levels": len(levels),
        "clipped_values": clipped,
        "size": [params.width, params.height],
        "source_size": list(source.shape[1::-1]),
    }
    return Picture(
        levels=halves,
        metres_per_texel=1.0 / params.height,
        pivot=(border + params.width / 2, float(border + params.height)),
        height=1.0,
        max_lod=min(params.max_lod, len(levels) - 1.0),
        lens_scale=mips.FILTERS[params.filter].lens_scale,
        brightest=max(float(level[..., :3].max()) for level in halves),
        quality=quality,
    )


def shrunk(picture: Float, width: int, height: int) -> Float:
    """Average (h, w, 4) down to a smaller size by area; light and coverage are kept."""
    if picture.shape[:2] == (height, width):
        return picture
    from PIL import Image

    def resized(channel: Float) -> Float:
        plane = Image.fromarray(np.ascontiguousarray(channel))
        return np.asarray(plane.resize((width, height), Image.Resampling.BOX), np.float32)

    return np.stack([resized(picture[..., c]) for c in range(4)], axis=-1)


def _stored(level: Float) -> NDArray[np.float16]:
    """Half floats; what lobes of a filter make negative or more than opaque is cut off."""
    level = np.maximum(level, 0.0)
    # The whole texel, so that its hue stays
    level /= np.maximum(level[..., 3:], 1.0)
    return np.minimum(level, LARGEST).astype(np.float16)


def of_file(path: Path, resolution: int, max_lod: float) -> Params:
    """Return the knobs for a picture file shrunk to `resolution`. InputError as baked_size."""
    width, height = picture_files.baked_size(path, resolution)
    return Params(width=width, height=height, max_lod=max_lod)
