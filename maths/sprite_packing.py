"""Sixteen, twelve or 4 K numbers a texel: how the terms of a relit sprite lie in RGBA planes.

Packing `twelve` is the layout of Evans' talk *Making Pretty Pictures with D3D* (case 2), carried on
to any number of terms: plane 0 holds (Y0 rgb, alpha), plane 1 (Y1 rgb, luma Y3), plane 2 (Y2 rgb,
luma Y4), and each further plane four lumas. Packing `full` gives each term a plane of its own.

Codes are 8 bit: unsigned `q / 255` for plane 0 (radiance and coverage are never negative), and
signed `(q - 128) / 127` elsewhere, which has an exact zero; `v * .5 + .5` has none, and lights
black texels by up to .0147 of the scale over five terms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.colour import luminance

Array = NDArray[np.floating]

PACKINGS = ("twelve", "full")
UNPACKINGS = ("chroma", "talk")
FLOOR = 1e-12  # luminance under which a colour has no hue to lend


def planes_of(terms: int, packing: str) -> int:
    """Return the number of RGBA planes that `terms` terms take.

    >>> planes_of(5, "twelve"), planes_of(9, "twelve"), planes_of(5, "full")
    (3, 4, 5)
    """
    if terms < 1 or terms % 2 == 0:
        raise ValueError(f"terms must be odd and positive, not {terms}")
    if packing == "full" or terms < 5:
        return terms
    return 3 + -(-(terms - 5) // 4)


def pack(Y: ArrayLike, alpha: ArrayLike, packing: str) -> Array:
    """Lay terms out in planes.

    Y : (K, ..., 3) premultiplied coefficients; alpha : (...) coverage, 0..1.
    Returns (P, ..., 4).
    """
    Y, alpha = np.asarray(Y), np.asarray(alpha)
    terms = Y.shape[0]
    planes = np.zeros((planes_of(terms, packing), *Y.shape[1:-1], 4), dtype=Y.dtype)
    coloured = terms if packing == "full" or terms < 5 else 3
    planes[:coloured, ..., :3] = Y[:coloured]
    planes[0, ..., 3] = alpha
    for k in range(coloured, terms):
        plane, channel = luma_slot(k)
        planes[plane, ..., channel] = luminance(Y[k])
    return planes


def luma_slot(k: int) -> tuple[int, int]:
    """Return (plane, channel) of the luma of term k >= 3 in packing `twelve`.

    >>> [luma_slot(k) for k in (3, 4, 5, 8, 9)]
    [(1, 3), (2, 3), (3, 0), (3, 3), (4, 0)]
    """
    return (k - 2, 3) if k < 5 else (3 + (k - 5) // 4, (k - 5) % 4)


def unpack(planes: ArrayLike, terms: int, packing: str, unpacking: str = "chroma") -> Array:
    """Return the terms (K, ..., 3) that decoded planes (P, ..., 4) stand for.

    `chroma` gives a luma the colour of the same texel's Y0; `talk` adds it as white.
    """
    planes = np.asarray(planes)
    if packing == "full" or terms < 5:
        return planes[:terms, ..., :3]
    Y = np.empty((terms, *planes.shape[1:-1], 3), dtype=planes.dtype)
    Y[:3] = planes[:3, ..., :3]
    if unpacking == "chroma":
        base = luminance(planes[0, ..., :3])[..., None]
        tint = np.where(base > FLOOR, planes[0, ..., :3] / np.maximum(base, FLOOR), 0)
    else:
        tint = np.ones_like(planes[0, ..., :3])
    for k in range(3, terms):
        plane, channel = luma_slot(k)
        Y[k] = planes[plane, ..., channel, None] * tint
    return Y


def unpack_talk(planes: ArrayLike, light: ArrayLike, vertex: ArrayLike) -> Array:
    """Evaluate the ps_1_1 program of the talk on decoded planes, line by line.

    planes : (3, ..., 4); light : (5, 3) constants c0..c4, of which c3 and c4 give their luma;
    vertex : (4,) colour. Returns premultiplied (..., 4), not clamped.
    """
    t0, t1, t2 = np.asarray(planes)
    L, v0 = np.asarray(light), np.asarray(vertex)
    r0 = t0 * np.append(L[0], 1.0)
    r0[..., :3] += t1[..., :3] * L[1]
    r0[..., :3] += t2[..., :3] * L[2]
    r0[..., :3] += t1[..., 3:] * luminance(L[3])
    r0[..., :3] += t2[..., 3:] * luminance(L[4])
    return np.asarray(r0 * v0)


def scales_of(planes: ArrayLike, *, outlier: float = 4.0) -> NDArray[np.float32]:
    """Return one scale a plane and channel, (P, 4): the largest magnitude.

    Where a few texels (under .05 %) stand above `outlier` times all the others, the scale is that
    of the others times `outlier`, so that one firefly does not cost the sprite its precision; those
    texels clip. The coverage channel has scale 1, an empty channel 0 (its codes decode to zero).
    Raises ValueError for values that are not finite.
    """
    planes = _finite(planes)
    magnitude = np.abs(planes).reshape(len(planes), -1, 4)
    largest = magnitude.max(axis=1)
    scales = np.array(largest, dtype=np.float64)
    for p, c in np.argwhere(largest > 0):
        lit = magnitude[p, :, c]
        lit = lit[lit > 0]
        usual = np.quantile(lit, 0.9995) if lit.size >= 2000 else largest[p, c]
        scales[p, c] = min(float(largest[p, c]), outlier * float(usual))
    # Round up, so that the largest value does not clip
    rounded = np.minimum(scales, np.finfo(np.float32).max / 2).astype(np.float32)
    above = np.where(scales > 0, np.nextafter(rounded, np.float32(np.inf)), np.float32(0))
    above[0, 3] = 1.0
    return np.asarray(above, np.float32)


def encode(planes: ArrayLike, scales: ArrayLike) -> tuple[NDArray[np.uint8], int]:
    """Quantise planes (P, ..., 4) to 8-bit codes; return them and the number of clipped values.

    Raises ValueError for values that are not finite.
    """
    planes, scales = _finite(planes), np.asarray(scales)
    codes = np.empty(planes.shape, np.uint8)
    clipped = 0
    for p, plane in enumerate(planes):
        with np.errstate(over="ignore"):
            zero = np.zeros(plane.shape, planes.dtype)
            unit = np.divide(plane, scales[p], where=scales[p] > 0, out=zero)
        low = 0.0 if p == 0 else -1.0
        slack = 0.5 / 127
        clipped += int(np.count_nonzero((unit > 1 + slack) | (unit < low - slack)))
        unit = np.clip(unit, low, 1.0)
        codes[p] = np.floor(unit * 255 + 0.5) if p == 0 else np.floor(unit * 127 + 128.5)
    return codes, clipped


def decode(codes: ArrayLike, scales: ArrayLike) -> NDArray[np.float32]:
    """Return the planes (P, ..., 4) that 8-bit codes stand for; float16 planes are scaled only."""
    codes, scales = np.asarray(codes), np.asarray(scales, dtype=np.float32)
    scale = scales.reshape(len(scales), *([1] * (codes.ndim - 2)), 4)
    if codes.dtype != np.uint8:
        return np.asarray(codes.astype(np.float32) * scale)
    planes = (codes.astype(np.float32) - 128) / 127
    planes[0] = codes[0].astype(np.float32) / 255
    return np.asarray(planes * scale)


def _finite(planes: ArrayLike) -> Array:
    values = np.asarray(planes)
    if not np.isfinite(values).all():
        raise ValueError("Planes to be coded are finite.")
    return values
