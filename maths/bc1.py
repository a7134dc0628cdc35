"""BC1 (S3TC, DXT1) with 1-bit alpha: 4 x 4 texels in 8 bytes, coded and decoded.

A block holds two endpoints of 5, 6 and 5 bits, little-endian, then 16 indices of 2 bits, the top
left texel in the lowest. As numbers, endpoint 0 > endpoint 1 means four opaque colours, the two
others at a third and two thirds; otherwise three, the third halfway, and index 3 is transparent
black. Colours are premultiplied, so that black is right for what is transparent. Endpoints become
8 bits by repeating their high bits, and what lies between is rounded to the nearest code, a half
up. Graphics cards round that their own way: within a few codes, the endpoints excepted.

References
----------
Khronos Data Format Specification 1.3, 18.1 (BC1 with punch-through alpha).
"""

import numpy as np
from numpy.typing import NDArray

from maths import bc1_fit

Bytes = NDArray[np.uint8]

OPAQUE = 128
"""Least alpha that counts as opaque."""
CHUNK = 4096  # blocks fitted at a time, in some 20 MB
# Index of each level on the way from endpoint 0 to 1, by the number of steps between them
_INDEX = {2: np.array([0, 2, 1], np.uint8), 3: np.array([0, 2, 3, 1], np.uint8)}
_WEIGHTS = np.array([1 << 2 * t for t in range(16)], np.uint32)


def decode(blocks: Bytes) -> Bytes:
    """Return the texels (..., 4, 4, 4) RGBA of blocks (..., 8); transparent ones are all 0."""
    raw = np.ascontiguousarray(_checked(blocks, (8,)), np.uint8).reshape(-1, 8)
    codes = np.ascontiguousarray(raw[:, :4]).view("<u2").astype(np.int32)
    ends = np.stack([codes.T >> 11, codes.T >> 5 & 63, codes.T & 31], axis=1)
    a, b = bc1_fit.expand(ends[0]), bc1_fit.expand(ends[1])
    palette = np.zeros((len(raw), 4, 4), np.uint8)
    palette[:, :, 3] = 255
    four = codes[:, 0] > codes[:, 1]
    halfway = bc1_fit.between(a, b, 1, 2)
    palette[:, 0, :3], palette[:, 1, :3] = a.T, b.T
    palette[:, 2, :3] = np.where(four, bc1_fit.between(a, b, 1, 3), halfway).T
    palette[:, 3, :3] = np.where(four, bc1_fit.between(a, b, 2, 3), 0).T
    palette[~four, 3, 3] = 0
    index = np.ascontiguousarray(raw[:, 4:]).view("<u4") >> np.arange(0, 32, 2, dtype=np.uint32) & 3
    texels = np.take_along_axis(palette, index[..., None].astype(np.intp), axis=1)
    return texels.reshape(*blocks.shape[:-1], 4, 4, 4)


def encode(rgba: Bytes, *, exact_black: bool = False) -> Bytes:
    """Return blocks (..., 8) for texels (..., 4, 4, 4), premultiplied RGBA.

    Alpha of `OPAQUE` or more becomes 255, all else transparent. A block is exact where its opaque
    texels have at most two colours that endpoints hold, and else at least as near as the best
    single colour for its mean. exact_black : opaque black stays exactly black, whatever else a
    block holds: one endpoint is then black. A block's bytes depend on nothing but its texels.
    """
    texels = np.ascontiguousarray(_checked(rgba, (4, 4, 4)), np.uint8).reshape(-1, 16, 4)
    opaque = texels[:, :, 3] >= OPAQUE
    colours = np.where(opaque[:, :, None], texels[:, :, :3], 0)
    blocks = np.full((len(texels), 8), 255, np.uint8)
    blocks[:, :4] = 0  # all transparent

    # Code the blocks of one colour by tables
    top = colours.max(axis=1)
    low = np.where(opaque[:, :, None], colours, 255).min(axis=1)
    some = opaque.any(axis=1)
    even = some & (top == low).all(axis=1)
    blocks[even] = _flat(top[even], opaque[even])

    # Group the others by what is fitted: opaque texels, without the black that is an endpoint
    black = opaque & ~colours.any(axis=2) & exact_black
    fitted = opaque & ~black
    key = fitted.sum(axis=1) + 32 * black.any(axis=1) + 64 * opaque.all(axis=1)
    others = some & ~even
    for group in np.unique(key[others]):
        members = np.flatnonzero(others & (key == group))
        for start in range(0, len(members), CHUNK):
            chosen = members[start : start + CHUNK]
            blocks[chosen] = _fitted(
                colours[chosen], fitted[chosen], opaque[chosen], black=bool(group & 32)
            )
    return blocks.reshape(*rgba.shape[:-3], 8)


def _flat(colours: Bytes, opaque: NDArray[np.bool_]) -> Bytes:
    """Return blocks (n, 8) of one colour (n, 3), transparent where not opaque (n, 16)."""
    colour = colours.T.astype(np.int32)
    blocks, least = np.zeros((len(colours), 8), np.uint8), np.full(len(colours), 1 << 30, np.int32)
    for steps in (2, 3):
        ends = bc1_fit.flat(colour, steps)
        a, b = bc1_fit.expand(ends[0]), bc1_fit.expand(ends[1])
        error = ((bc1_fit.between(a, b, 1, steps) - colour) ** 2).sum(axis=0, dtype=np.int32)
        better = (error < least) & ((steps == 2) | opaque.all(axis=1))
        packed = _packed(ends, np.ones(opaque.T.shape, np.uint8), steps, opaque)
        blocks[better], least[better] = packed[better], error[better]
    return blocks


def _fitted(
    colours: Bytes, fitted: NDArray[np.bool_], opaque: NDArray[np.bool_], *, black: bool
) -> Bytes:
    """Return blocks (n, 8) of colours (n, 16, 3), as many of them fitted (n, 16) in each."""
    n = int(fitted[0].sum())
    whole = colours.transpose(1, 2, 0).astype(np.int32)
    first = np.argsort(~fitted.T, axis=0, kind="stable")[:n]
    x = np.take_along_axis(whole, first[:, None], axis=0)
    ends, least = bc1_fit.fit(x, 2, black=black)
    blocks = _packed(ends, bc1_fit.assign(ends, whole, 2)[0], 2, opaque)
    if opaque[0].all():
        ends, error = bc1_fit.fit(x, 3, black=black)
        packed = _packed(ends, bc1_fit.assign(ends, whole, 3)[0], 3, opaque)
        blocks = np.where((error <= least)[:, None], packed, blocks)
    return blocks


def _packed(ends: bc1_fit.Int, levels: Bytes, steps: int, opaque: NDArray[np.bool_]) -> Bytes:
    """Return blocks (n, 8) of endpoints A, B (2, 3, n) and levels (16, n), in the order of a mode.

    Equal endpoints are of three colours, and any index but 3 says the same.
    """
    a, b = (end[0] << 11 | end[1] << 5 | end[2] for end in ends)
    swapped = (a > b) if steps == 2 else (a < b)
    levels = np.where(swapped, steps - levels, levels)
    levels = np.where(a == b, 0, levels)
    index = np.where(opaque.T, _INDEX[steps][levels], 3).astype(np.uint32)
    blocks = np.empty((len(a), 8), np.uint8)
    codes = np.stack([np.where(swapped, b, a), np.where(swapped, a, b)], axis=1)
    blocks[:, :4] = np.ascontiguousarray(codes, "<u2").view(np.uint8)
    words = (index * _WEIGHTS[:, None]).sum(axis=0, dtype=np.uint32)
    blocks[:, 4:] = words.astype("<u4")[:, None].view(np.uint8)
    return blocks


def encode_image(rgba: Bytes, *, exact_black: bool = False) -> Bytes:
    """Return blocks (..., h / 4, w / 4, 8), rounded up, of pictures or slices (..., h, w, 4).

    Edges are repeated to fill the last blocks.
    """
    return encode(_tiles(_checked(rgba, (None, None, 4))), exact_black=exact_black)


def decode_image(blocks: Bytes, extent: tuple[int, int]) -> Bytes:
    """Return the texels (..., h, w, 4) of blocks (..., h / 4, w / 4, 8); extent : (w, h)."""
    rows, columns = _checked(blocks, (None, None, 8)).shape[-3:-1]
    width, height = extent
    if (rows, columns) != (-(-height // 4), -(-width // 4)):
        raise ValueError(f"{columns} x {rows} blocks do not make {width} x {height} texels.")
    texels = np.moveaxis(decode(blocks), -4, -3)
    whole = texels.reshape(*blocks.shape[:-3], 4 * rows, 4 * columns, 4)
    return whole[..., :height, :width, :]


def encode_volume(rgba: Bytes, *, exact_black: bool = False) -> Bytes:
    """Return blocks (z, y / 4, x / 4, 8), rounded up, of a volume (z, y, x, 4), slice by slice."""
    return encode_image(_checked(rgba, (None, None, None, 4)), exact_black=exact_black)


def dirty_blocks(old: Bytes, new: Bytes) -> NDArray[np.intp]:
    """Return (n, 3) indices (z, y / 4, x / 4) of the blocks that differ in two volumes
    (z, y, x, 4); transparent texels are all the same, as `encode` has them."""
    if old.shape != _checked(new, (None, None, None, 4)).shape:
        raise ValueError(f"The volumes differ in size: {old.shape} and {new.shape}.")
    solid = old[..., 3] >= OPAQUE
    changed = solid != (new[..., 3] >= OPAQUE)
    changed |= solid & (old[..., :3] != new[..., :3]).any(axis=-1)
    height, width = changed.shape[1:]
    rows = np.add.reduceat(changed, np.arange(0, height, 4), axis=1, dtype=np.int32)
    return np.argwhere(np.add.reduceat(rows, np.arange(0, width, 4), axis=2) > 0)


def update(
    blocks: Bytes, volume: Bytes, dirty: NDArray[np.intp], *, exact_black: bool = False
) -> None:
    """Code some blocks of a volume (z, y, x, 4) anew, in place, as `encode_volume` would.

    blocks : (z, y / 4, x / 4, 8). dirty : (n, 3), from `dirty_blocks`.
    """
    z, y, x = np.asarray(dirty, np.intp).reshape(-1, 3).T
    inside = np.arange(4)
    rows = np.minimum(4 * y[:, None] + inside, volume.shape[1] - 1)
    columns = np.minimum(4 * x[:, None] + inside, volume.shape[2] - 1)
    tiles = volume[z[:, None, None], rows[:, :, None], columns[:, None, :]]
    blocks[z, y, x] = encode(tiles, exact_black=exact_black)


def _tiles(rgba: Bytes) -> Bytes:
    """Cut pictures (..., h, w, 4) into blocks (..., h / 4, w / 4, 4, 4, 4), edges repeated."""
    *lead, height, width, _ = rgba.shape
    pads = [(0, 0)] * len(lead) + [(0, -height % 4), (0, -width % 4), (0, 0)]
    padded = np.pad(rgba, pads, mode="edge") if any(pads[-3] + pads[-2]) else rgba
    rows, columns = -(-height // 4), -(-width // 4)
    return np.moveaxis(padded.reshape(*lead, rows, 4, columns, 4, 4), -3, -4)


def _checked(array: Bytes, shape: tuple[int | None, ...]) -> Bytes:
    """Raise ValueError unless the array is uint8 and ends in a shape; None is any but 0."""
    ends = array.shape[-len(shape) :] if array.ndim >= len(shape) else ()
    fits = len(ends) == len(shape) and all(
        found == wanted or (wanted is None and found > 0)
        for found, wanted in zip(ends, shape, strict=True)
    )
    if array.dtype != np.uint8 or not fits:
        raise ValueError(f"Expected uint8 (..., {shape}), not {array.dtype} {array.shape}.")
    return array
