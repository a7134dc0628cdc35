"""Hard cases of relighting by circular harmonics: rings of lights, and what is stored of them."""

from __future__ import annotations

import numpy as np

from maths import circular_basis, circular_fit, circular_lights, circular_window, sprite_packing
from maths.circular_signals import alias_series, lambert_lobe, shadow_arc, tilted_lambert
from pipelines.hard.cells import Family, Result, all_of, at_most, equal, noted, refused

circular = Family("relighting by a ring")
ROUNDING = 1e-12
"""A sum of at most 64 products of doubles up to 3 rounds to less than 64 * 3 * 2^-53 * 8."""


def even(count: int) -> np.ndarray:
    """Return azimuths of evenly spaced lights."""
    return np.asarray(2 * np.pi * np.arange(count) / count)


def series(Y: np.ndarray, angles: np.ndarray) -> np.ndarray:
    return np.asarray(circular_basis.reconstruct(Y, angles))


circular.row("C1", "N evenly spaced lights, N >= 5", "OK", "closed form plus folded harmonics")


@circular.cell("C1", "maths.circular_fit")
def _aliasing() -> Result:
    found = []
    for count in (5, 8, 12, 16, 64):
        X = np.maximum(0, np.cos(even(count)))
        Y = circular_fit.fit_weights(even(count), 5).matrix @ X
        # Harmonics beyond 4096 fold less than their sum, 2 / (pi 4096)
        folded = alias_series(lambert_lobe(8193), count, 5)
        found.append(at_most(np.abs(Y - folded).max(), 1e-3 / 4, "tail of the series"))
    return all_of(*found)


circular.row("C2", "1 to 4 lights, or duplicates of fewer than 5", "fewer terms, and a note",
             "2 K + 1 terms need as many azimuths")  # fmt: skip


@circular.cell("C2", "maths.circular_fit")
def _few() -> Result:
    found = []
    for angles, terms in (([1.0], 1), ([0.0, 3.0], 1), ([0, 2.0, 4.0], 3), ([0, 2, 4, 0, 2, 4], 3)):
        fit = circular_fit.fit_weights(np.asarray(angles, float), 5)
        value = fit.matrix @ np.full(len(angles), 0.7)
        constant = np.abs(series(value, even(9)) - 0.7).max()
        found += [equal(fit.terms, terms), noted(fit.warnings, "distinct azimuths")]
        found.append(at_most(constant, ROUNDING, "a constant stays exact"))
    return all_of(*found)


circular.row(
    "C3",
    "irregular azimuths and gaps",
    "OK to condition 10, then smoothed or fewer terms",
    "band-limited signals come back; noise grows at most as gated",
)


@circular.cell("C3", "maths.circular_fit")
def _irregular() -> Result:
    rng = np.random.default_rng(3)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 24))
    fit = circular_fit.fit_weights(angles, 5)
    Y = rng.normal(size=5)
    return at_most(np.abs(fit.matrix @ series(Y, angles) - Y).max(), 1e-12 * fit.condition)


@circular.cell("C3", "a gap of 225 degrees")
def _gap() -> Result:
    fit = circular_fit.fit_weights(even(16)[:7], 5)
    # A lobe has an RMS of 0.5: a fit that is worse than no fit is refused its order
    return all_of(
        at_most(fit.condition, circular_fit.CONDITION_DROP, "the gate"),
        at_most(circular_fit.predicted_error(fit), 0.5, "RMS of the lobe itself"),
        noted(fit.warnings, "gap"),
    )


circular.row("C4", "clipped or missing samples", "left out by weights of 0", "fit of the others")


@circular.cell("C4", "maths.circular_fit")
def _clipped() -> Result:
    rng = np.random.default_rng(4)
    angles, weights = even(16), np.ones(16)
    weights[[2, 9]] = 0
    X = series(rng.normal(size=5), angles)
    truth = circular_fit.fit_weights(angles[weights > 0], 5).matrix @ X[weights > 0]
    X[weights == 0] = 255.0
    fit = circular_fit.fit_weights(angles, 5, sample_weights=weights)
    return at_most(np.abs(fit.matrix @ X - truth).max(), ROUNDING)


circular.row("C5", "smoothing", "shrinks harmonic h of even lights by 1 / (1 + 2 ridge h^2)",
             "closed form; a constant is never penalised")  # fmt: skip


@circular.cell("C5", "maths.circular_fit")
def _ridge() -> Result:
    angles, ridge = even(16), 0.05
    Y = np.array([2.0, 0.5, -1.0, 0.25, 0.125])
    found = circular_fit.fit_weights(angles, 5, ridge=ridge).matrix @ series(Y, angles)
    h = circular_basis.harmonic_of(5)
    return at_most(np.abs(found - Y / (1 + 2 * ridge * h**2)).max(), ROUNDING)


circular.row(
    "C6",
    "directions off the ring, and on its axis",
    "gains g^h; the axis tells the constant",
    "A + B cos of the tilted normal, exact in three terms",
)


@circular.cell("C6", "maths.circular_lights")
def _zenith() -> Result:
    Y = circular_lights.evaluate_direction([[0.0, 0.0, 1.0]], 5, elevation=0.5)
    lit = np.array([1 / np.sqrt(2 * np.pi), 0, 0, 0, 0])
    return at_most(np.abs(Y[0] - lit).max(), ROUNDING, "an azimuth on the axis is undefined")


@circular.cell("C6", "maths.circular_fit")
def _tilted() -> Result:
    X = 0.6 + 0.5 * np.cos(even(16) - 0.3)
    Y = circular_fit.fit_weights(even(16), 3).matrix @ X
    truth = circular_basis.rotate(tilted_lambert(0.6, 0.5, 3), 0.3)
    return at_most(np.abs(Y - truth).max(), ROUNDING)


circular.row("C7", "directions of length 0, NaN, infinite, huge or tiny",
             "refused, or scaled to unit length", "length does not matter")  # fmt: skip


@circular.cell("C7", "maths.circular_lights")
def _no_direction() -> Result:
    bad = ([0.0, 0.0, 0.0], [np.nan, 0, 1], [np.inf, 0, 0])
    return all_of(*(refused(lambda d=d: circular_lights.project_sun(d, [1.0] * 3, 5)) for d in bad))


@circular.cell("C7", "lengths 1e-300 and 1e300")
def _any_length() -> Result:
    unit = circular_lights.project_sun([0.3, 0.4, 0.866], [1.0] * 3, 5)
    sizes = (1e-300, 1e-160, 1e160, 1e300)
    found = [
        circular_lights.project_sun(np.array([0.3, 0.4, 0.866]) * s, [1.0] * 3, 5) for s in sizes
    ]
    return at_most(np.abs(np.array(found) - unit).max(), ROUNDING)


circular.row("C8", "constant signal", "exactly constant, and exactly so after 8 bits", "exact zero")


@circular.cell("C8", "maths.circular_fit")
def _constant() -> Result:
    Y = circular_fit.fit_weights(even(64), 5).matrix @ np.full(64, 0.3)
    return at_most(np.abs(series(Y, even(7)) - 0.3).max(), ROUNDING)


@circular.cell("C8", "8-bit codes")
def _zero_codes() -> Result:
    planes = np.zeros((4, 4, 4, 4), np.float32)
    planes[0, ..., 0], planes[1, ..., 1] = 0.5, np.linspace(-1, 1, 16).reshape(4, 4)
    scales = sprite_packing.scales_of(planes)
    back = sprite_packing.decode(sprite_packing.encode(planes, scales)[0], scales)
    return equal(np.count_nonzero(back[planes == 0]), 0, "code 128 is exactly 0")


circular.row("C9", "negative input", "kept; its sign survives the codes", "linear")


@circular.cell("C9", "8-bit codes")
def _negative() -> Result:
    planes = np.random.default_rng(9).normal(size=(4, 8, 8, 4)).astype(np.float32)
    # The first plane holds colour and coverage, which are never negative
    planes[0] = np.clip(np.abs(planes[0]), 0, 1)
    scales = sprite_packing.scales_of(planes)
    back, clipped = _coded(planes, scales)
    half = np.abs(scales)[:, None, None, :] / 254 * (1 + 1e-5)
    inside = np.abs(planes) <= scales[:, None, None, :]
    worst = np.max(np.where(inside, np.abs(back - planes) / half, 0))
    return all_of(at_most(worst, 1, "half a code of 127"), at_most(clipped, 4, "beyond 4 sigma"))


def _coded(planes: np.ndarray, scales: np.ndarray) -> tuple[np.ndarray, int]:
    codes, clipped = sprite_packing.encode(planes, scales)
    return np.asarray(sprite_packing.decode(codes, scales)), clipped


circular.row("C10", "values from 1e-6 to 6.5e4, one texel far beyond the rest",
             "finite; what is clipped is counted", "half a code of the scale")  # fmt: skip


@circular.cell("C10", "8-bit codes")
def _outlier() -> Result:
    rng = np.random.default_rng(10)
    planes = 10 ** rng.uniform(-6, 0, (4, 16, 16, 4)).astype(np.float32)
    planes[0, 3, 4, 1] = 6.5e4
    scales = sprite_packing.scales_of(planes)
    back, clipped = _coded(planes, scales)
    half = scales[:, None, None, :] / 254 * (1 + 1e-5)
    others = np.abs(back - planes)[planes <= scales[:, None, None, :]]
    worst = np.max(others / np.broadcast_to(half, planes.shape)[planes <= scales[:, None, None, :]])
    finite = equal(np.isfinite(back).all(), True)
    return all_of(at_most(worst, 1), finite, at_most(clipped, 1, f"{clipped} clipped and counted"))


circular.row("C11", "hard shadow steps", "ringing known, and lifted by a window where asked",
             "minima of the truncated step in closed form")  # fmt: skip


@circular.cell("C11", "maths.circular_window")
def _ringing() -> Result:
    # Order 2 of steps of half-width 22.5, 45, 90 and 135 degrees dips to these (NUMERICS A.0)
    arcs = {22.5: -0.133, 45: -0.148, 90: -0.137, 135: -0.018}
    Y = np.array([shadow_arc(np.radians(w), 5) for w in arcs])
    dips = np.abs(circular_window.minimum(Y) - np.array(list(arcs.values())))
    amount = circular_window.smallest_window(Y)
    lifted = circular_window.minimum(Y * circular_window.window(5, amount))
    return all_of(
        at_most(dips.max(), 5e-4, "3 digits"), at_most(-lifted.min(), 1e-6, "lifted to 0")
    )


circular.row("C12", "negative sums", "clamped at 0 after the sum", "never below 0")


@circular.cell("C12", "maths.circular_basis")
def _clamped() -> Result:
    Y = np.tile(shadow_arc(0.5, 5)[:, None], (1, 3))
    L = np.array([circular_basis.evaluate(t, 5) for t in even(32)])[..., None] * np.ones(3)
    lit = np.array([circular_basis.relight(Y, light) for light in L])
    return at_most(-lit.min(), 0, "max(0, sum)")


circular.row("C14", "8-bit quantisation", "error within the sum of half codes",
             "sum over k of s_k |b_k| / 254")  # fmt: skip


@circular.cell("C14", "8-bit ladder")
def _ladder() -> Result:
    ramp = np.linspace(-1, 1, 4096, dtype=np.float32).reshape(64, 64)
    planes = np.stack([np.stack([ramp * s for s in (1, 0.1, 1e-3, 30)], -1)] * 4)
    planes[0] = np.abs(planes[0])
    planes[0, ..., 3] = np.abs(ramp)
    scales = sprite_packing.scales_of(planes)
    back, _ = _coded(planes, scales)
    half = scales[:, None, None, :] / 254 * (1 + 1e-5)
    bias = np.abs(np.mean((back - planes) / half))
    return all_of(
        at_most(np.max(np.abs(back - planes) / half), 1, "half a code"),
        at_most(bias, 1e-3, "rounding, not truncation: no mean shift"),
    )


circular.row("C15", "sRGB input", "decoded before any fit", "f(2 x) = 2 f(x) in linear light")


@circular.cell("C15", "formats.files.image")
def _srgb() -> Result:
    import io

    from PIL import Image

    from formats.files import image
    from maths import colour

    codes = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    stream = io.BytesIO()
    Image.fromarray(codes).save(stream, "PNG")
    found = image.decode(stream.getvalue(), "ramp.png")[0, :, 0]
    # float32 of values up to 1
    return at_most(np.abs(found - colour.srgb_decode(np.arange(256) / 255)).max(), 2.0**-23)
