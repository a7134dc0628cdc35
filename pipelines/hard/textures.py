"""Hard cases of textures and blocks, of mips, of the lens and of the light of closed forms."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from maths import area_lights, bc1, disc_lights, optics, polygon_lights
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


lights = Family("light in closed form")
DOWN = np.array([0.0, 1.0, 0.0])


def close(found: object, truth: object, bound: float, why: str = "") -> Result:
    return at_most(np.abs(np.asarray(found) / np.asarray(truth) - 1).max(), bound, why)


lights.row("L1", "a ball above, cut by and below the horizon", "pi s^2 cos, then less, then 0",
           "closed form; continuous across the horizon")  # fmt: skip


@lights.cell("L1", "maths.area_lights")
def _ball() -> Result:
    angles = np.linspace(0, np.pi, 721)
    centre = 2.0 * np.stack([np.sin(angles), np.cos(angles), 0 * angles], -1)
    E = area_lights.sphere_irradiance(np.zeros(3), DOWN, centre, 1.0, [1.0] * 3)[:, 0]
    above = angles <= np.pi / 3
    return all_of(
        close(E[above], np.pi / 4 * np.cos(angles[above]), 1e-12),
        equal(E[angles >= 2 * np.pi / 3 + 1e-9], 0.0),
        at_most(np.abs(np.diff(E)).max(), np.pi / 4 * np.pi / 720 * 1.01, "slope at most pi s^2"),
    )


lights.row("L2", "a ball that is touched, entered, far away or tiny", "finite, never above pi L",
           "pi L is the whole hemisphere")  # fmt: skip


@lights.cell("L2", "maths.area_lights")
def _near() -> Result:
    distance = np.array([1e-9, 0.5, 1.0, 1 + 1e-12, 1.05, 1e6, 1e15])
    centre = distance[:, None] * DOWN
    E = area_lights.sphere_irradiance(np.zeros(3), DOWN, centre, 1.0, [1.0] * 3)
    return all_of(equal(np.isfinite(E).all(), True), at_most(E.max(), np.pi * (1 + 1e-12)))


lights.row(
    "L3", "a disc over its axis, from touching to far", "pi R^2 / (R^2 + h^2)", "closed form"
)


@lights.cell("L3", "maths.disc_lights")
def _disc() -> Result:
    h = 10.0 ** np.arange(-6.0, 7)
    E = disc_lights.disc_irradiance(np.zeros(3), DOWN, h[:, None] * DOWN, -DOWN, 1.0, [1.0] * 3)
    return close(E[:, 0], np.pi / (1 + h**2), 1e-9, "as measured at 1e6 radii")


lights.row("L4", "a square over a corner, from touching to far", "two arc tangents a side",
           "closed form")  # fmt: skip


@lights.cell("L4", "maths.polygon_lights")
def _square() -> Result:
    h = 10.0 ** np.arange(-3.0, 4)
    E = []
    for x in h:
        centre = np.array([0.5, x, 0.5])
        corners = polygon_lights.rectangle_corners(centre, [0.5, 0, 0], [0, 0, 0.5])
        E.append(polygon_lights.polygon_irradiance(np.zeros(3), DOWN, corners, [1.0] * 3)[0])
    a = 1 / h
    root = np.sqrt(1 + a * a)
    return close(E, a / root * np.arctan(a / root), 1e-9, "rounding of areas at 1000 sides")


lights.row(
    "L5", "a flat light seen from behind or edge on", "0, or both sides where asked", "exact"
)


@lights.cell("L5", "maths.polygon_lights")
def _behind() -> Result:
    corners = polygon_lights.rectangle_corners([0, 1.0, 0], [1.0, 0, 0], [0, 0, -1.0])
    back = polygon_lights.polygon_irradiance(np.zeros(3), DOWN, corners, [1.0] * 3)
    both = polygon_lights.polygon_irradiance(np.zeros(3), DOWN, corners, [1.0] * 3, two_sided=True)
    edge = polygon_lights.polygon_irradiance([5.0, 1, 0], DOWN, corners, [1.0] * 3)
    return all_of(equal(back, 0.0), equal(edge, 0.0), equal(both > 0, True))


lights.row("L6", "a sun that sets", "cos above, a part of the disc on the horizon, 0 below",
           "monotone; half of it at 0 within the disc's own angle")  # fmt: skip


@lights.cell("L6", "maths.area_lights")
def _sunset() -> Result:
    a = np.radians(np.linspace(-3, 3, 601))
    towards = np.stack([np.cos(a), np.sin(a), 0 * a], -1)
    E = area_lights.sun_irradiance(DOWN, towards, [1.0] * 3, np.radians(0.265))[:, 0]
    high = a > np.radians(0.27)
    return all_of(
        close(E[high], np.sin(a[high]), 1e-6, "a disc of 0.27 degrees counts as its middle"),
        equal(E[a < -np.radians(0.27)], 0.0), at_most(-np.diff(E).min(), 1e-15, "monotone"),
    )  # fmt: skip


lights.row("L7", "lights of radius 0, NaN places, other shapes", "refused or no light", "typed")
for _name, _radius, _place in (("radius NaN", np.nan, 1.0), ("place NaN", 1.0, np.nan)):

    def _none(radius: float = _radius, place: float = _place) -> Result:
        try:
            E = area_lights.sphere_irradiance(
                np.zeros(3), DOWN, [0.0, 2 * place, 0], radius, [1.0] * 3
            )
        except (ValueError, FloatingPointError) as error:
            return Result("refused", said=str(error))
        # What is not finite is never silent inside a bake: scenes refuse it, rows M
        return Result("ok", said=f"propagates: {E[0]}")

    lights.add("L7", _name, _none)
