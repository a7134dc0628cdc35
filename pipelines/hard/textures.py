"""Hard cases of textures and blocks, of mips and of the lens."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from maths import bc1, optics
from pipelines.hard.cells import Family, Result, all_of, at_most, equal, refused

textures = Family("textures and lens")
Codes = NDArray[np.uint8]


def block(c0: int, c1: int, indices: int) -> Codes:
    return np.frombuffer(struct.pack("<HHI", c0, c1, indices), np.uint8)


textures.row("T1", "order of the endpoints, every index", "as the format says",
             "table of both orders and of equal ends")  # fmt: skip


@textures.cell("T1", "maths.bc1")
def _order() -> Result:
    red, blue, clear = 0xF800, 0x001F, (0, 0, 0, 0)
    table = {
        (red, blue): [(255, 0, 0, 255), (0, 0, 255, 255), (170, 0, 85, 255), (85, 0, 170, 255)],
        (blue, red): [(0, 0, 255, 255), (255, 0, 0, 255), (128, 0, 128, 255), clear],
        (red, red): [(255, 0, 0, 255)] * 3 + [clear],
    }
    found = [bc1.decode(block(*ends, 0b11_10_01_00))[0] for ends in table]
    return equal(found, [list(colours) for colours in table.values()])


@textures.cell("T1", "opaque blocks of one colour")
def _flat() -> Result:
    colours = np.random.default_rng(1).integers(0, 256, (500, 1, 1, 4)).astype(np.uint8)
    rgba = np.tile(colours, (1, 4, 4, 1))
    rgba[..., 3] = 255
    found = bc1.decode(bc1.encode(rgba)).astype(int)
    # 5 bits are 8.2 codes apart, and a mix of two ends lies between: at most 4
    return all_of(equal(found[..., 3], 255, "no hole"), at_most(np.abs(found - rgba).max(), 4))


textures.row(
    "T2",
    "index 3 of opaque and of transparent blocks",
    "transparent black only where asked",
    "alpha comes back exactly",
)


@textures.cell("T2", "maths.bc1")
def _holes() -> Result:
    rng = np.random.default_rng(2)
    rgba = rng.integers(0, 256, (800, 4, 4, 4)).astype(np.uint8)
    rgba[..., 3] = np.where(rng.random((800, 4, 4)) < 0.5, 0, 255)
    rgba[rgba[..., 3] == 0] = 0
    return equal(bc1.decode(bc1.encode(rgba))[..., 3], rgba[..., 3])


textures.row("T3", "colour of transparent texels", "0, so premultiplied, and no say in the fit",
             "exact")  # fmt: skip


@textures.cell("T3", "maths.bc1")
def _hidden() -> Result:
    rng = np.random.default_rng(3)
    rgba = rng.integers(0, 256, (300, 4, 4, 4)).astype(np.uint8)
    rgba[..., 3] = np.where(rng.random((300, 4, 4)) < 0.5, 0, 255)
    cleared = rgba.copy()
    cleared[rgba[..., 3] == 0] = 0
    found = bc1.encode(rgba)
    holes = bc1.decode(found)[rgba[..., 3] == 0]
    return all_of(equal(found, bc1.encode(cleared)), equal(holes, 0))


textures.row("T4", "coverage of masks in smaller levels", "the mean of every level stays",
             "premultiplied filters keep sums")  # fmt: skip
for _filter in ("box", "kaiser", "gaussian"):

    def _mean(name: str = _filter) -> Result:
        from bake import mips

        if name not in mips.FILTERS:
            return refused(lambda: mips.Params(filter=name).check())
        level0 = np.zeros((1, 64, 64, 4), np.float32)
        mask = np.random.default_rng(4).random((24, 24)) < 0.35
        level0[0, 20:44, 20:44] = mask[..., None]
        means = [float(level.mean()) for level in mips.mip_chain(level0, 3, name)]
        # Weights of a kernel sum to 1 in float32; nothing reaches the edge
        return at_most(max(abs(m / means[0] - 1) for m in means), 1e-5)

    textures.add("T4", f"filter {_filter}", _mean)

textures.row(
    "T5",
    "decoders that mix ends a little differently",
    "ours within a code of the exact mix",
    "nearest code of (2 a + b) / 3",
)


@textures.cell("T5", "maths.bc1")
def _mixes() -> Result:
    rng = np.random.default_rng(5)
    a, b = rng.integers(0, 1 << 16, (2, 500))
    ends = [(max(x, y), min(x, y)) for x, y in zip(a.tolist(), b.tolist(), strict=True) if x != y]
    found = np.array([bc1.decode(block(*e, 0b11_10_01_00))[0, :, :3] for e in ends], float)
    exact = np.stack([(2 * found[:, 0] + found[:, 1]) / 3, (found[:, 0] + 2 * found[:, 1]) / 3], 1)
    return at_most(np.abs(found[:, 2:] - exact).max(), 0.5)


textures.row("T6", "sizes that are no multiple of 4, and of one texel", "edges are repeated",
             "as coding the picture with its edges repeated")  # fmt: skip
for _w, _h in ((1, 1), (2, 2), (5, 3), (7, 4), (13, 9)):

    def _sizes(w: int = _w, h: int = _h) -> Result:
        rgba = np.random.default_rng(w).integers(0, 256, (h, w, 4)).astype(np.uint8)
        rgba[..., 3] = 255
        whole = np.pad(rgba, ((0, -h % 4), (0, -w % 4), (0, 0)), mode="edge")
        blocks = bc1.encode_image(rgba)
        return all_of(
            equal(blocks, bc1.encode_image(whole)),
            equal(bc1.decode_image(blocks, (w, h)).shape, (h, w, 4)),
        )

    textures.add("T6", f"{_w} x {_h}", _sizes)

textures.row("T8", "levels beyond those there are", "clamped", "LOD in 0..max")


@textures.cell("T8", "maths.optics")
def _levels() -> Result:
    with np.errstate(divide="ignore"):
        found = optics.lod(np.array([0.0, 1e-30, 1.0, 1e30]), 0.5, 6.0)
    return all_of(
        equal(np.isfinite(found).all(), True), at_most(found.max(), 6), at_most(-found.min(), 0)
    )


textures.row(
    "T9",
    "in focus, in the camera, at infinity",
    "finite; 0 in focus; refused without focus",
    "A f |d - d_f| / (d (d_f - f)), never above A beyond focus",
)


@textures.cell("T9", "maths.optics")
def _circles() -> Result:
    d = np.array([1e-9, 0.05, 2.0, 1e6, 1e30])
    found = optics.circle_of_confusion(d, 0.05, 2.0, 2.0)
    limit = 0.025 * 0.05 / (2.0 - 0.05)
    return all_of(
        equal(np.isfinite(found).all(), True), equal(found[2], 0.0), at_most(-found.min(), 0),
        at_most(abs(found[-1] / limit - 1), 1e-6, "limit at infinity"),
    )  # fmt: skip


@textures.cell("T9", "focus at or before the focal length")
def _no_lens() -> Result:
    d = np.array([1.0, 2.0])
    bad = (0.05, 0.01, np.nan, np.inf)
    return all_of(*(refused(lambda f=f: optics.circle_of_confusion(d, 0.05, 2.0, f)) for f in bad))


textures.row("T12", "8-bit ladders of sRGB", "every code comes back", "256 codes")


@textures.cell("T12", "maths.colour")
def _srgb_ladder() -> Result:
    from maths import colour

    codes = np.arange(256)
    back = colour.quantise(colour.srgb_encode(colour.srgb_decode(codes / 255)))
    return equal(back, codes)
