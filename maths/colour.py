"""Radiance to picture: luminance, tone curves, the sRGB transfer function, dither of the last step.

Scene-linear Rec. 709 throughout. Twins of the same names in `runtime/glsl/colour.glsl`, except
`quantise`, which is what a framebuffer of 8 bits does.

References
----------
IEC 61966-2-1:1999 (sRGB).  ITU-R BT.709-6 (luminance).
Naka, Rushton 1966, S-potentials from colour units in the retina of fish (the saturation curve);
Reinhard, Devlin 2005, Dynamic Range Reduction Inspired by Photoreceptor Physiology (the curve for
pictures, with a mixture of the channels before it).
Roberts 2018, The Unreasonable Effectiveness of Quasirandom Sequences (R2).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

REC709_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

FILMIC_CONTRAST = 1.3  # exponent of the Naka-Rushton curve
FILMIC_GREY = 0.18  # maps to itself
FILMIC_HALF = (
    FILMIC_GREY**FILMIC_CONTRAST * (1 - FILMIC_GREY) / FILMIC_GREY
)  # curve = p / (p + half)
FILMIC_MIX = 0.15  # share of luminance mixed into each channel before the curve
LARGEST = 65504.0  # largest half float: brighter input counts as this

# floor(2^32 / g) and floor(2^32 / g^2), g = 1.32471795724 the root of g^3 = g + 1; 2^32 / phi
R2_X, R2_Y, GOLDEN = np.uint32(3242174889), np.uint32(2447445413), np.uint32(2654435769)
THIRD = np.uint32(1431655765)  # 2^32 / 3, the phase between channels


def luminance(rgb: ArrayLike) -> NDArray[np.float64]:
    """Relative luminance of linear Rec. 709 colours.

    rgb : (..., 3). Returns (...).

    >>> round(float(luminance([1.0, 1.0, 1.0])), 12)
    1.0
    """
    return np.asarray(np.asarray(rgb, np.float64) @ REC709_LUMINANCE)


def srgb_encode(linear: ArrayLike) -> NDArray[np.float64]:
    """Linear [0, 1] to sRGB-encoded [0, 1]; values outside are clamped.

    linear : (...). Returns (...).

    >>> srgb_encode([0.0, 0.0031308, 1.0]).round(6).tolist()
    [0.0, 0.04045, 1.0]
    """
    c = np.clip(np.asarray(linear, np.float64), 0.0, 1.0)
    return np.where(
        c <= 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 0.0031308) ** (1 / 2.4) - 0.055
    )


def srgb_decode(encoded: ArrayLike) -> NDArray[np.float64]:
    """Encoded sRGB [0, 1] to linear [0, 1]; values outside are clamped.

    encoded : (...). Returns (...).

    >>> round(float(srgb_decode(0.5)), 6)
    0.214041
    """
    c = np.clip(np.asarray(encoded, np.float64), 0.0, 1.0)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0.04045) + 0.055) / 1.055) ** 2.4)


def tonemap_linear(rgb: ArrayLike) -> NDArray[np.float64]:
    """Clamp radiance to [0, 1]; nothing else. rgb : (..., 3). Returns (..., 3).

    >>> tonemap_linear([-1.0, 0.25, 7.0]).tolist()
    [0.0, 0.25, 1.0]
    """
    return np.asarray(np.clip(np.asarray(rgb, np.float64), 0.0, 1.0))


def tonemap_filmic(rgb: ArrayLike) -> NDArray[np.float64]:
    """Compress radiance to [0, 1] as film does: a toe, a long shoulder, bright colours pale.

    Each channel takes a share of the luminance, goes through `p / (p + half)`, `p = c^1.3` (18 %
    grey maps to itself, slope 1.07 there in log-log), and gives the share back. The mixture makes a
    saturated light turn pale as it grows instead of shifting to the next primary, and giving back
    keeps deep colours deep.

    rgb : (..., 3) scene-linear radiance after exposure; negative counts as 0. Returns (..., 3).

    >>> tonemap_filmic([0.18, 0.18, 0.18]).round(12).tolist()
    [0.18, 0.18, 0.18]
    """
    c = np.clip(np.asarray(rgb, np.float64), 0.0, LARGEST)
    mixed = c + (luminance(c)[..., None] - c) * FILMIC_MIX
    power = mixed**FILMIC_CONTRAST
    curve = power / (power + FILMIC_HALF)
    # The luminance is its own under the mixture, which makes its inverse as short as itself
    unmixed = (curve - FILMIC_MIX * luminance(curve)[..., None]) / (1.0 - FILMIC_MIX)
    return np.asarray(np.clip(unmixed, 0.0, 1.0))


TONEMAPS = {"linear": tonemap_linear, "filmic": tonemap_filmic}


def dither(x: ArrayLike, y: ArrayLike, frame: ArrayLike = 0) -> NDArray[np.float64]:
    """Offset in (-0.5, 0.5) codes of the last step, evenly spread over any neighbourhood (R2).

    x, y, frame : broadcastable integers >= 0, pixel column, row and number of the frame.
    Returns (..., 3), one offset a channel, exact in float32. A colour that is a code stays it.

    >>> bool(np.all(np.abs(dither(np.arange(64), 5)) < 0.5))
    True
    """
    with np.errstate(over="ignore"):
        phase = _u32(x) * R2_X + _u32(y) * R2_Y + _u32(frame) * GOLDEN
        channels = np.asarray(phase)[..., None] + np.arange(3, dtype=np.uint32) * THIRD
    # 23 bits, and the middle of each step: 2^-24 is never 0 and float32 holds all of it
    steps = np.asarray(channels >> np.uint32(9), np.float64)
    return steps * 2.0**-23 - (0.5 - 2.0**-24)


def quantise(encoded: ArrayLike, offset: ArrayLike = 0.0) -> NDArray[np.uint8]:
    """Round to 8-bit codes, half up, after adding `offset` codes.

    encoded : (...) in [0, 1].  offset : (...) codes, as from `dither`. Returns uint8 (...).

    >>> quantise([0.0, 0.5, 1.0]).tolist()
    [0, 128, 255]
    """
    codes = np.floor(np.asarray(encoded, np.float64) * 255.0 + np.asarray(offset) + 0.5)
    return np.asarray(np.clip(codes, 0, 255).astype(np.uint8))


def _u32(values: ArrayLike) -> NDArray[np.uint32]:
    return np.asarray(np.asarray(values).astype(np.int64) & 0xFFFFFFFF).astype(np.uint32)
