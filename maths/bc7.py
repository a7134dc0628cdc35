"""BC7 blocks of mode 6: 4 x 4 texels of four channels in 16 bytes, two a number.

Eight modes share the format; mode 6 alone has one pair of endpoints of 8 bits in all four channels
(7 bits, and a last one that the channels of an endpoint share) and 16 steps between them, which
suits four numbers that have little to do with one another. Blocks of it are read by every decoder;
`decode` reads no other mode.

Reference
---------
Khronos Data Format Specification 1.3, chapter 20 (BPTC compressed texture image formats).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float32]
Bytes = NDArray[np.uint8]

STEPS = np.array([0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64], np.int32)
"""64ths from the first to the second endpoint."""
CHUNK = 1 << 14  # blocks at once: 40 MB
ROUNDS = 2  # of endpoints and steps in turns: a third gains 1e-4 of the error


def encode(texels: ArrayLike) -> Bytes:
    """Return blocks (..., 16) of texels (..., 4, 4, 4) uint8, by least squares in mode 6."""
    given = np.asarray(texels, np.uint8)
    flat = given.reshape(-1, 16, 4)
    blocks = [_encoded(flat[a : a + CHUNK]) for a in range(0, len(flat), CHUNK)]
    found = np.concatenate([np.zeros((0, 16), np.uint8), *blocks])
    return found.reshape(*given.shape[:-3], 16)


def decode(blocks: ArrayLike) -> Bytes:
    """Return texels (..., 4, 4, 4) uint8 of blocks (..., 16). Raises ValueError for other modes."""
    given = np.asarray(blocks, np.uint8)
    flat = given.reshape(-1, 16)
    if np.any(flat[:, 0] & 0x7F != 0x40):
        raise ValueError("Blocks of BC7 are of mode 6.")
    bits = np.unpackbits(flat, axis=1, bitorder="little").astype(np.int32)
    sevens = _numbers(bits[:, 7:63], 7).reshape(-1, 4, 2)
    ends = 2 * np.moveaxis(sevens, 2, 0) + bits[:, 63:65].T[:, :, None]
    # The first index has no top bit
    steps = np.concatenate([bits[:, 65:68], np.zeros_like(bits[:, :1]), bits[:, 68:]], axis=1)
    found = _texels(ends, _numbers(steps, 4))
    return found.astype(np.uint8).reshape(*given.shape[:-1], 4, 4, 4)


def encode_volume(volume: ArrayLike) -> Bytes:
    """Return blocks (z, y / 4, x / 4, 16) of a volume (z, y, x, 4) uint8, edges repeated."""
    given = np.asarray(volume, np.uint8)
    z, y, x = given.shape[:3]
    whole = np.pad(given, ((0, 0), (0, -y % 4), (0, -x % 4), (0, 0)), mode="edge")
    rows, columns = whole.shape[1] // 4, whole.shape[2] // 4
    split = whole.reshape(z, rows, 4, columns, 4, 4).swapaxes(2, 3)
    return encode(split)


def decode_volume(blocks: ArrayLike, height: int, width: int) -> Bytes:
    """Return the volume (z, height, width, 4) of blocks (z, rows, columns, 16)."""
    texels = decode(blocks)
    z, rows, columns = texels.shape[:3]
    whole = texels.swapaxes(2, 3)
    return np.ascontiguousarray(whole.reshape(z, 4 * rows, 4 * columns, 4)[:, :height, :width])


def _encoded(texels: Bytes) -> Bytes:
    """Return blocks (n, 16) of texels (n, 16, 4)."""
    x = texels.astype(np.float32)
    low, high = _span(x)
    best = np.full(len(x), np.inf, np.float32)
    ends = np.zeros((2, len(x), 4), np.int32)
    steps = np.zeros((len(x), 16), np.int32)
    for _ in range(ROUNDS):
        for first, second in np.ndindex(2, 2):
            tried = np.stack([_rounded(low, first), _rounded(high, second)])
            nearest = _steps(x, tried)
            error = np.square(_texels(tried, nearest) - x).sum(axis=(1, 2))
            won = error < best
            best[won], ends[:, won], steps[won] = error[won], tried[:, won], nearest[won]
        low, high = _least_squares(x, steps, ends)
    return _packed(ends, steps)


def _span(x: Float) -> tuple[Float, Float]:
    """Return the ends (n, 4) of texels (n, 16, 4) along their principal axis."""
    mean = x.mean(axis=1)
    centred = x - mean[:, None]
    covariance = np.einsum("nik,nil->nkl", centred, centred)
    axis = np.linalg.eigh(covariance)[1][..., -1].astype(np.float32)
    along = np.einsum("nik,nk->ni", centred, axis)
    low, high = along.min(axis=1)[:, None], along.max(axis=1)[:, None]
    return mean + low * axis, mean + high * axis


def _rounded(end: Float, last: int) -> NDArray[np.int32]:
    """Return endpoints (n, 4) as the nearest numbers of 8 bits whose last bit is `last`."""
    return np.asarray(2 * np.clip(np.rint((end - last) / 2), 0, 127) + last, np.int32)


def _steps(x: Float, ends: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return for texels (n, 16, 4) the steps (n, 16) next to their feet between ends (2, n, 4)."""
    way = (ends[1] - ends[0]).astype(np.float32)
    length = np.maximum(np.sum(way * way, axis=1), 1)
    foot = np.einsum("nik,nk->ni", x - ends[0][:, None], way) / length[:, None]
    halves = (STEPS[1:] + STEPS[:-1]).astype(np.float32) / 128
    return np.asarray(np.searchsorted(halves, foot.ravel()).reshape(foot.shape), np.int32)


def _least_squares(
    x: Float, steps: NDArray[np.int32], ends: NDArray[np.int32]
) -> tuple[Float, Float]:
    """Return the ends (n, 4) that fit best with those steps, as they were where one step does."""
    b = STEPS[steps].astype(np.float32) / 64
    a = 1 - b
    aa, ab, bb = (a * a).sum(axis=1), (a * b).sum(axis=1), (b * b).sum(axis=1)
    determinant = aa * bb - ab * ab
    sound = (determinant > 1e-3)[:, None]
    inverse = np.where(sound, 1 / np.where(sound, determinant[:, None], 1), 0)
    ax, bx = np.einsum("ni,nik->nk", a, x), np.einsum("ni,nik->nk", b, x)
    low = (bb[:, None] * ax - ab[:, None] * bx) * inverse
    high = (aa[:, None] * bx - ab[:, None] * ax) * inverse
    return np.where(sound, low, ends[0]), np.where(sound, high, ends[1])


def _texels(ends: NDArray[np.int32], steps: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return texels (n, 16, 4) at steps (n, 16) between ends (2, n, 4)."""
    w = STEPS[steps][..., None]
    return np.asarray(((64 - w) * ends[0][:, None] + w * ends[1][:, None] + 32) >> 6)


def _packed(ends: NDArray[np.int32], steps: NDArray[np.int32]) -> Bytes:
    """Return blocks (n, 16): mode, endpoints channel by channel, last bits, steps."""
    # The first step's top bit is not stored: swap ends where it is set
    swap = steps[:, 0] > 7
    ends = np.where(swap[None, :, None], ends[::-1], ends)
    steps = np.where(swap[:, None], 15 - steps, steps)
    n = len(steps)
    bits = np.zeros((n, 128), np.uint8)
    bits[:, 6] = 1
    bits[:, 7:63] = _bits(np.moveaxis(ends >> 1, 0, 2).reshape(n, 8), 7)
    bits[:, 63:65] = ends[:, :, 0].T & 1
    each = _bits(steps, 4)
    bits[:, 65:68], bits[:, 68:] = each[:, :3], each[:, 4:]
    return np.packbits(bits, axis=1, bitorder="little")


def _bits(numbers: NDArray[np.int32], count: int) -> Bytes:
    """Return the bits (n, m count), lowest first, of numbers (n, m)."""
    found = numbers[:, :, None] >> np.arange(count) & 1
    return found.reshape(len(numbers), -1).astype(np.uint8)


def _numbers(bits: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """Return the numbers (n, m) of bits (n, m count), lowest first."""
    return np.asarray(bits.reshape(len(bits), -1, count) @ (1 << np.arange(count)), np.int32)
