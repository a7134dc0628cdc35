"""Mip chains that look like a lens, then planes and codes: the sprite as the player reads it.

A sprite out of focus is drawn from a coarser mip (Evans, case 1); so a level must look like the
sprite seen through a lens, which the usual box does not. Each level is filtered straight from a
finer one with a kernel of the level's own size, and the outermost texels of every level are zero,
so that a clamped lookup fades out instead of smearing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from bake.billboard import held_out_psnr
from formats.billboard import Billboard
from formats.coefficients import Coefficients
from formats.errors import InputError
from maths import sprite_packing

Float = NDArray[np.float32]


@dataclass(frozen=True)
class Filter:
    """One mip filter: kernel half-width in texels of the level it makes, and the c of
    LOD = log2(c * circle of confusion in texels) that fits it best to a true lens."""

    half_width: float
    lens_scale: float


# Half-widths and c that the study `lens_by_mips` found best against a thin lens of 1,024 samples,
# over blurs of 0 to 64 pixels and sprites of 64 to 1,024; the mean PSNR is beside them. The kaiser
# leads at every size, and at every blur but in focus, where the box that drivers make is sharper
# (34.3 against 33.2 dB).
FILTERS = {
    "box": Filter(0.5, 0.56),  # 37.5 dB
    "disc": Filter(0.9, 0.43),  # 39.2 dB
    "gaussian": Filter(1.25, 0.43),  # 39.0 dB
    "kaiser": Filter(2.0, 0.45),  # 39.7 dB
}


@dataclass(frozen=True)
class Params:
    """Knobs. filter : one of FILTERS. max_lod : the coarsest level that the lens will ask for;
    sizes the transparent border. packing : "twelve" or "full". unpack : "chroma" or "talk".
    depth : "8" for RGBA8, "16" for RGBA16F."""

    filter: str = "kaiser"
    max_lod: float = 4.0
    packing: str = "twelve"
    unpack: str = "chroma"
    depth: str = "8"

    def check(self) -> None:
        """Raise InputError for the first knob that is out of its range."""
        choices = {
            "filter": tuple(FILTERS),
            "packing": sprite_packing.PACKINGS,
            "unpack": sprite_packing.UNPACKINGS,
            "depth": ("8", "16"),
        }
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                raise InputError(
                    "mips", name, getattr(self, name), f"choose from {', '.join(allowed)}"
                )
        if not 0 <= self.max_lod <= 8:
            raise InputError("mips", "max_lod", self.max_lod, "choose from 0 to 8")


def pack(
    master: Coefficients, *, params: Params, progress: workers.Progress = workers.silent
) -> Billboard:
    """Filter, pack and quantise a sprite. InputError for knobs or values out of range."""
    params.check()
    master = master.checked("mips")
    planes = np.stack([
        sprite_packing.pack(t, a, params.packing)
        for t, a in zip(master.terms, master.alpha, strict=True)
    ])  # fmt: skip
    border, levels = bordered_levels(planes.reshape(-1, *planes.shape[2:]), params, progress)
    count = len(levels)
    scales, coded, clipped = _coded(levels, planes.shape[1], params)
    board = Billboard(
        levels=coded,
        scales=scales,
        packing=params.packing,
        unpack=params.unpack,
        ring=master.ring,
        views=len(master.terms),
        metres_per_texel=master.metres_per_texel,
        pivot=(master.pivot[0] + border, master.pivot[1] + border),
        height=master.height,
        max_lod=min(params.max_lod, count - 1.0),
        lens_scale=FILTERS[params.filter].lens_scale,
    )
    quality = {**master.quality, "border": border, "levels": count, "clipped_values": clipped}
    quality["size"] = list(master.alpha.shape[:0:-1])
    quality |= losses(master, board, border)
    return replace(board, quality=quality)


def bordered_levels(
    planes: Float, params: Params, progress: workers.Progress = workers.silent
) -> tuple[int, tuple[Float, ...]]:
    """Return the border in texels and the mip levels of planes (layers, h, w, 4) within it."""
    border = border_of(params)
    rows, columns = (n + 2 * border for n in planes.shape[1:3])
    count = level_count(min(rows, columns))
    height, width = (-(-n // (1 << (count - 1))) << (count - 1) for n in (rows, columns))
    framed = placed(planes, border, width, height)
    return border, mip_chain(framed, count, params.filter, progress)


def border_of(params: Params) -> int:
    """Return the border in texels: support of filter and bilinear lookup at the largest LOD."""
    reach = FILTERS[params.filter].half_width + 1.0
    return int(np.ceil(reach * 2 ** np.ceil(params.max_lod))) if params.max_lod > 0 else 2


def level_count(smaller: int) -> int:
    """Return how many levels keep at least four texels along the smaller side."""
    return max(1, int(np.floor(np.log2(max(smaller, 4) / 4))) + 1)


def placed(planes: Float, border: int, width: int, height: int) -> Float:
    """Return planes (n, h, w, 4) within zeros: `border` texels to the left and on top."""
    out = np.zeros((len(planes), height, width, 4), np.float32)
    out[:, border : border + planes.shape[1], border : border + planes.shape[2]] = planes
    return out


def mip_chain(
    level0: Float,
    count: int,
    filter: str,
    progress: workers.Progress = workers.silent,
    *,
    half_width: float | None = None,
) -> tuple[Float, ...]:
    """Return `count` levels of (layers, h, w, 4), whose sizes must be multiples of 2^(count - 1).

    half_width : of the kernel instead of the filter's own.

    Level 1 is filtered from level 0; a coarser level L from the exact 2x2 averages of level L - 2,
    which the kernel, four times as wide there, does not see.
    """
    levels, averages = [_bordered(level0.copy())], [level0]
    for level in range(1, count):
        ratio = 2 if level == 1 else 4
        kernel = kernel_of(filter, ratio, half_width)
        levels.append(_bordered(_filtered(averages[max(0, level - 2)], kernel, ratio)))
        fine = averages[-1]
        total = fine[:, ::2, ::2] + fine[:, 1::2, ::2] + fine[:, ::2, 1::2] + fine[:, 1::2, 1::2]
        averages.append(total * np.float32(0.25))
        progress(level / count)
    return tuple(levels)


def kernel_of(filter: str, ratio: int, half_width: float | None = None) -> Float:
    """Return the kernel (2 m, 2 m), sum 1, that makes one coarse texel from `ratio` finer ones.

    Weights are the filter's integral over each fine texel, by 8x8 points, then made a partition of
    unity: whichever of the `ratio` x `ratio` places a fine texel has in a coarse one, all coarse
    texels together get the whole of it, so that energy is exact and a lone point does not flicker.
    """
    width = FILTERS[filter].half_width if half_width is None else half_width
    m = int(np.ceil(width * ratio))
    sub = 8
    x = (np.arange(2 * m * sub) + 0.5) / sub - m
    x, y = np.meshgrid(x / ratio, x / ratio)
    r = np.hypot(x, y)
    if filter == "box":
        weight = (np.maximum(np.abs(x), np.abs(y)) < width).astype(np.float64)
    elif filter == "disc":
        weight = (r < width).astype(np.float64)
    elif filter == "gaussian":
        # The half-width holds 2.5 standard deviations
        weight = np.where(r < width, np.exp(-0.5 * np.square(r * 2.5 / width)), 0.0)
    else:
        weight = _kaiser(x, width) * _kaiser(y, width)
    fine = weight.reshape(2 * m, sub, 2 * m, sub).sum(axis=(1, 3))
    for row in range(ratio):
        for column in range(ratio):
            place = fine[row::ratio, column::ratio]
            place /= place.sum() * ratio**2
    return np.asarray(fine, np.float32)


def _kaiser(x: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """A sinc at three quarters of the coarse grid's Nyquist rate under a Kaiser window, beta 2.

    The lookup adds a tent two texels wide: with the full rate or a narrower window, what is out of
    focus shows the grid (.5 to .8 dB worse in the study `lens_by_mips`).
    """
    inside = np.clip(1 - np.square(x / width), 0, None)
    return np.asarray(np.sinc(0.75 * x) * np.i0(2 * np.sqrt(inside)) * (np.abs(x) < width))


def _filtered(fine: Float, kernel: Float, ratio: int) -> Float:
    """Correlate (layers, h, w, 4) with the kernel about the centres of the coarse texels."""
    rows, columns = kernel.sum(axis=1), kernel.sum(axis=0)
    if np.allclose(np.outer(rows, columns), kernel, rtol=0, atol=1e-7):
        return _along(_along(fine, rows, ratio, 1), columns, ratio, 2)
    out = np.zeros((len(fine), fine.shape[1] // ratio, fine.shape[2] // ratio, 4), np.float32)
    for i, row in enumerate(_taps(fine, len(kernel), ratio, 1)):
        for j, tap in enumerate(_taps(row, len(kernel), ratio, 2)):
            if kernel[i, j] != 0:
                out += kernel[i, j] * tap
    return out


def _along(fine: Float, weights: Float, ratio: int, axis: int) -> Float:
    """Correlate along one axis, where a kernel is the product of two."""
    shape = list(fine.shape)
    shape[axis] //= ratio
    out = np.zeros(shape, np.float32)
    for weight, tap in zip(weights, _taps(fine, len(weights), ratio, axis), strict=True):
        out += weight * tap
    return out


def _taps(fine: Float, count: int, ratio: int, axis: int) -> Iterator[Float]:
    """List, for each of `count` taps about the coarse centres, what it sees along an axis."""
    before = count // 2 - ratio // 2
    around = [(0, 0)] * fine.ndim
    around[axis] = (max(before, 0),) * 2
    padded = np.pad(fine, around)
    first, last = max(-before, 0), (fine.shape[axis] // ratio - 1) * ratio + 1
    for tap in range(first, first + count):
        seen: list[slice] = [slice(None)] * fine.ndim
        seen[axis] = slice(tap, tap + last, ratio)
        yield padded[tuple(seen)]


def _bordered(level: Float) -> Float:
    """Zero the outermost texels."""
    level[:, [0, -1]] = 0
    level[:, :, [0, -1]] = 0
    return level


def _coded(
    levels: tuple[Float, ...], planes: int, params: Params
) -> tuple[Float, tuple[NDArray[Any], ...], int]:
    """Turn float levels into stored ones: one scale a plane and channel, all levels and views."""
    by_plane = [np.moveaxis(lv.reshape(-1, planes, *lv.shape[1:]), 1, 0) for lv in levels]
    if params.depth == "16":
        top = np.float32(65504)
        clipped = sum(int(np.count_nonzero(np.abs(lv) > top)) for lv in levels)
        halves = tuple(np.clip(lv, -top, top).astype(np.float16) for lv in levels)
        return np.ones((planes, 4), np.float32), halves, clipped
    scales = sprite_packing.scales_of(by_plane[0])
    coded, clipped = [], 0
    for plane in by_plane:
        codes, over = sprite_packing.encode(plane, scales)
        coded.append(np.ascontiguousarray(np.moveaxis(codes, 0, 1).reshape(-1, *codes.shape[2:])))
        clipped += over
    return scales, tuple(coded), clipped


def decoded(board: Billboard, level: int = 0, view: int = 0) -> Float:
    """Return the float planes (P, h, w, 4) of one level and view of a stored sprite."""
    codes = board.levels[level]
    codes = codes.reshape(board.views, board.planes, *codes.shape[1:])[view]
    return sprite_packing.decode(codes, board.scales)


def losses(master: Coefficients, board: Billboard, border: int) -> dict[str, Any]:
    """Return held-out PSNR of the full floats, of the packing, and of the stored codes, in dB."""
    if not master.held_out.size:
        return {}
    rows, columns = (slice(border, border + n) for n in master.alpha.shape[1:])
    terms = master.ring.terms
    packed = sprite_packing.pack(master.terms[0], master.alpha[0], board.packing)
    stored = decoded(board)[:, rows, columns]
    candidates = {
        "full": master.terms[0],
        "packed": sprite_packing.unpack(packed, terms, board.packing, board.unpack),
        "stored": sprite_packing.unpack(stored, terms, board.packing, board.unpack),
    }
    result = {f"psnr_{name}": held_out_psnr(master, Y) for name, Y in candidates.items()}
    result["loss_packing_db"] = result["psnr_full"] - result["psnr_packed"]
    result["loss_bits_db"] = result["psnr_packed"] - result["psnr_stored"]
    return result
