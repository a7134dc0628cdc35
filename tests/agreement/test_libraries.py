"""Every function of runtime/glsl against its numpy twin, or a slow and obvious version of it.

Tolerances: EXACT where both sides do the same integer arithmetic; ROUNDING for chains of float32
operations with exact sums and products; CURVES where exp, log2 and pow come in, which GLSL lets a
driver approximate (llvmpipe: up to 1e-5 relative in pow).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from maths import bloom, colour, grain, hashing, noise, optics, sprite_packing

pytestmark = pytest.mark.gpu
ROUNDING = {"rtol": 4e-6, "atol": 2e-6}
CURVES = {"rtol": 5e-5, "atol": 5e-6}


def close(found, expected, tolerance):
    np.testing.assert_allclose(found, np.asarray(expected, np.float64), **tolerance)


def directions(rng, n):
    d = rng.normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


# hashing and noise


def test_pcg_is_equal_in_every_bit(glsl, rng):
    keys = rng.integers(0, 2**32, (4, 4096), dtype=np.uint64).astype(np.uint32)
    names = dict(zip("abcd", keys, strict=True))
    for n in (1, 2, 3, 4):
        call = f"uintBitsToFloat((pcg({', '.join('abcd'[:n])}) >> 9u) | 0x3f800000u) - 1.0"
        found = glsl("hashing", call, {k: names[k] for k in "abcd"[:n]})
        expected = (hashing.pcg(*keys[:n]) >> np.uint32(9)) * 2.0**-23
        np.testing.assert_array_equal(found, expected)


def test_uniform01_is_equal_in_every_bit(glsl, rng):
    keys = rng.integers(0, 2**32, (4, 4096), dtype=np.uint64).astype(np.uint32)
    for n in (1, 2, 3, 4):
        inputs = dict(zip("abcd"[:n], keys[:n], strict=True))
        found = glsl("hashing", f"uniform01({', '.join('abcd'[:n])})", inputs)
        np.testing.assert_array_equal(found, hashing.uniform01(*keys[:n]))


@pytest.mark.parametrize("dimensions", [2, 3])
def test_value_noise(glsl, rng, dimensions):
    p = rng.uniform(-50, 50, (4096, dimensions)).astype(np.float32)
    p[:64] = np.round(p[:64])
    found = glsl(["hashing", "noise"], "value_noise(p, 7u)", {"p": p})
    close(found, noise.value_noise(p, 7), ROUNDING)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_fbm(glsl, rng, dimensions):
    p = rng.uniform(-5, 5, (2048, dimensions)).astype(np.float32)
    found = glsl(["hashing", "noise"], "fbm(p, 4, 3u)", {"p": p})
    # The turns round differently: 8 octave units of 2^-23 |p| times slope 2 of the noise
    close(found, noise.fbm(p, 4, 3), {"rtol": 0, "atol": 3e-5})


# colour


def test_colour_curves(glsl, rng):
    rgb = np.concatenate([rng.uniform(-0.2, 1.5, (2048, 3)), 10 ** rng.uniform(-5, 5, (2048, 3))])
    inputs = {"rgb": rgb.astype(np.float32)}
    for name in ("srgb_encode", "srgb_decode", "tonemap_linear", "tonemap_filmic"):
        found = glsl("colour", f"{name}(rgb)", inputs, 3)
        close(found, getattr(colour, name)(inputs["rgb"]), CURVES)
    close(glsl("colour", "luminance(rgb)", inputs), colour.luminance(inputs["rgb"]), ROUNDING)


def test_dither_is_equal_in_every_bit(glsl, rng):
    x, y, frame = rng.integers(0, 4096, (3, 4096), dtype=np.uint32)
    found = glsl("colour", "dither(x, y, frame)", {"x": x, "y": y, "frame": frame}, 3)
    np.testing.assert_array_equal(found, colour.dither(x, y, frame))


def test_grain_is_equal_but_for_a_rounding(glsl, rng):
    x, y, frame = rng.integers(0, 4096, (3, 4096), dtype=np.uint32)
    found = glsl("grain", "grain(x, y, frame)", {"x": x, "y": y, "frame": frame})
    close(found, grain.grain(x, y, frame), {"rtol": 3e-7, "atol": 0})


@pytest.mark.parametrize("threshold", [0.0, 0.7])
def test_bright_share(glsl, rng, threshold):
    rgb = rng.uniform(0, 2, (2048, 3)).astype(np.float32)
    rgb[0], rgb[1] = 0.0, threshold
    found = glsl("bloom", f"bright_share(rgb, {threshold})", {"rgb": rgb})
    close(found, bloom.bright_share(rgb, np.float32(threshold)), ROUNDING)


# optics


def test_optics(glsl, rng):
    n = 4096
    d = (10 ** rng.uniform(-2, 4, n)).astype(np.float32)
    f = rng.uniform(0.02, 0.2, n).astype(np.float32)
    number = rng.uniform(1, 22, n).astype(np.float32)
    focus = (f + 10 ** rng.uniform(-1, 3, n)).astype(np.float32)
    call = "circle_of_confusion(d, f, number, focus)"
    found = glsl("optics", call, {"d": d, "f": f, "number": number, "focus": focus})
    # 1 - focus / d cancels near focus: absolute error is that of the largest circle
    expected = optics.circle_of_confusion(d, f, number, focus)
    largest = f / number * f / (focus - f) * np.maximum(1, focus / np.maximum(d, f))
    assert np.max(np.abs(found - expected) / largest) < 1e-6
    coc, size = (10 ** rng.uniform(-6, -1, (2, n))).astype(np.float32)
    found = glsl("optics", "texels(c, d, f, m)", {"c": coc, "d": d, "f": f, "m": size})
    close(found, optics.texels(coc, d, f, size), ROUNDING)
    wide = (10 ** rng.uniform(-3, 4, n)).astype(np.float32)
    close(glsl("optics", "lod(w, 0.7, 6.5)", {"w": wide}), optics.lod(wide, 0.7, 6.5), CURVES)
    close(
        glsl("optics", "pixels(c, 720.0, 0.024)", {"c": coc}),
        optics.pixels(coc, 720, 0.024),
        ROUNDING,
    )


# fog: the obvious version adds up many short steps


def fog_depth_slow(a, b, extinction, falloff, base, steps=4000):
    t = (np.arange(steps) + 0.5) / steps
    y = a[:, 1, None] + (b[:, 1] - a[:, 1])[:, None] * t
    density = extinction * np.exp(-falloff * (y - base))
    return density.mean(axis=1) * np.linalg.norm(b - a, axis=1)


@pytest.mark.parametrize("falloff", [0.0, 1e-5, 0.3, 2.0])
def test_fog_is_the_integral_along_the_segment(glsl, rng, falloff):
    a = rng.uniform([-5, 0, -5], [5, 3, 5], (512, 3)).astype(np.float32)
    b = a + rng.uniform(-8, 8, (512, 3)).astype(np.float32) * [1, 0.3, 1]
    b[:32, 1] = a[:32, 1]
    inputs = {"a": a, "b": b.astype(np.float32)}
    call = f"(a, b, 0.05, {falloff:.9f}, 0.5)"
    expected = fog_depth_slow(a.astype(float), inputs["b"].astype(float), 0.05, falloff, 0.5)
    # Midpoint steps are good to (falloff dy / steps)^2 / 24 < 1e-7; the series below 1e-3 to 1.7e-7
    close(glsl("fog", "fog_depth" + call, inputs), expected, CURVES)
    close(glsl("fog", "fog_transmittance" + call, inputs), np.exp(-expected), CURVES)


def test_fog_sky_drowns_the_horizon_only(glsl):
    sine = np.linspace(-0.2, 1, 257).astype(np.float32)
    origin = np.zeros((257, 3), np.float32)
    inputs = {"o": origin, "s": sine}
    found = glsl("fog", "fog_sky(o, s, 0.05, 0.0, 0.0, 0.05)", inputs)
    close(found, 1 - np.exp(-np.maximum(sine, 1e-4) / 0.05), {"rtol": 1e-4, "atol": 1e-6})
    # A layered fog has a finite depth straight through it: the segment to very far away
    up = sine > 0.02
    far = (
        np.stack([np.sqrt(1 - sine[up] ** 2), sine[up], 0 * sine[up]], axis=1)
        * 200
        / sine[up, None]
    )
    found = glsl("fog", "fog_sky(o, s, 0.05, 0.4, 0.0, 0.05)", {"o": origin[up], "s": sine[up]})
    expected = np.exp(-fog_depth_slow(0 * far, far, 0.05, 0.4, 0.0, 40000))
    close(found, expected, {"rtol": 1e-3, "atol": 1e-6})


# sky


def test_sky(glsl, rng):
    d, sun = directions(rng, 1024), directions(rng, 1024)
    inputs = {"d": d.astype(np.float32), "s": sun.astype(np.float32)}
    d, sun = inputs["d"].astype(float), inputs["s"].astype(float)
    sine = d[:, 1]
    zenith, horizon = np.array([0.1, 0.2, 0.4]), np.array([0.9, 0.6, 0.4])
    share = np.exp(-5.5 * np.maximum(sine, 0))[:, None]
    found = glsl("sky", "sky_gradient(d.y, vec3(0.1, 0.2, 0.4), vec3(0.9, 0.6, 0.4))", inputs, 3)
    close(found, zenith + (horizon - zenith) * share, CURVES)
    near = 1 - np.sum(d * sun, axis=1)
    rise = d[:, 1] - sun[:, 1]
    expected = 0.45 * np.exp(-near / 0.006) + 0.55 * np.exp(-near / 0.16 - 40.0 * rise**2)
    close(glsl("sky", "sky_glow(d, s)", inputs), expected, {"rtol": 2e-4, "atol": 1e-5})


def test_the_disc_of_the_sun_has_its_own_radius(glsl):
    angle = np.linspace(0, 0.02, 401)
    d = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1).astype(np.float32)
    found = glsl("sky", "sky_disc(d, vec3(0.0, 0.0, 1.0), 0.01)", {"d": d})
    x = np.clip((angle - 0.008) / 0.004, 0, 1)
    close(found, 1 - x * x * (3 - 2 * x), {"rtol": 0, "atol": 2e-3})


# ground


def mottle_slow(place, width):
    total, weights, frequency, amplitude = 0.0, 0.0, np.float32(0.31), 1.0
    for i in range(6):
        angle = 2.39996323 * i
        c, s = np.cos(angle), np.sin(angle)
        turned = (place @ np.array([[c, -s], [s, c]]).T) * frequency
        x = np.clip((width * frequency - 0.35) / 0.65, 0, 1)
        share = 1 - x * x * (3 - 2 * x)
        total += amplitude * (share * noise.value_noise(turned, i) + (1 - share) * 0.5)
        weights += amplitude
        amplitude *= 0.62
        frequency *= np.float32(2.17)
    x = np.clip((total / weights - 0.22) / 0.56, 0, 1)
    return x * x * (3 - 2 * x)


def test_mottle(glsl, rng):
    place = rng.uniform(-20, 20, (2048, 2)).astype(np.float32)
    width = (10 ** rng.uniform(-3, 1.5, 2048)).astype(np.float32)
    found = glsl("mottle", "mottle(place, width)", {"place": place, "width": width})
    # Places round at 2^-24 * 20 * 15 (finest octave) = 2e-5, times the slope of noise and curve, 5
    close(found, mottle_slow(place.astype(float), width), {"rtol": 0, "atol": 2e-4})
    # Nothing is left to alias where a pixel is wider than every octave
    wide = glsl("mottle", "mottle(place, 10.0)", {"place": place})
    np.testing.assert_allclose(wide, 0.5, atol=1e-6)


def test_octave_share(glsl):
    width = np.linspace(0, 2, 257).astype(np.float32)
    x = np.clip((width.astype(float) - 0.35) / 0.65, 0, 1)
    close(glsl("mottle", "octave_share(w)", {"w": width}), 1 - x * x * (3 - 2 * x), ROUNDING)


def test_shadow_geometry(glsl, rng):
    along, beside, across = rng.uniform(-3, 3, (3, 512)).astype(np.float32)
    inputs = {"a": along, "b": beside, "c": across}
    found = glsl("shadow", "shadow_lookup(a, b, c, 0.7)", inputs, 2)
    expected = np.stack(
        [np.where(beside < 0, -1, 1) * np.hypot(beside, across), (along - across) * 0.7], 1
    )
    close(found, expected, ROUNDING)
    side = glsl("shadow", "shadow_side(b, c)", inputs)
    close(side, 0.5 + 0.5 * np.abs(beside) / np.hypot(beside, across), ROUNDING)
    # On the body's own axis both sides are the same
    assert glsl("shadow", "shadow_side(0.0 * b, 0.0 * c)", inputs).min() == 1
    # A sun of angular radius r blurs by 2 r times the length of the ray
    height = np.abs(along)
    tangent = np.abs(beside) + np.float32(0.1)
    found = glsl("shadow", "penumbra(h, t, 0.01)", {"h": height, "t": tangent})
    close(
        found,
        0.02 * height / np.sin(np.arctan(tangent.astype(float))),
        {"rtol": 2e-5, "atol": 1e-7},
    )


def test_contact_is_dark_at_the_foot_and_gone_far_away(glsl):
    distance = np.linspace(0, 3, 129).astype(np.float32)
    found = glsl("shadow", "contact(d, 0.1, 0.8, 0.5)", {"d": distance})
    d = distance.astype(float)
    stem, wide = 0.6 * np.exp(-(d**2) / (2.6 * 0.01)), 0.225 * np.exp(-(d**2) / (0.5 * 0.64))
    close(found, 1 - (1 - stem) * (1 - wide), CURVES)
    assert np.all(np.diff(found) <= 0)
    assert glsl("shadow", "contact(d, 0.0, 0.0, 0.5)", {"d": distance}).max() == 0


# circular harmonics


@pytest.mark.parametrize(
    ("terms", "unpacking"),
    [(k, "full") for k in (1, 3, 5, 9, 11)]
    + [(k, u) for k in (5, 9, 11) for u in ("chroma", "talk")],
)
def test_unpacking_is_that_of_the_twin(glsl, rng, terms, unpacking):
    packing = "full" if unpacking == "full" else "twelve"
    count, n = sprite_packing.planes_of(terms, packing), 256
    planes = rng.normal(size=(count, n, 4)).astype(np.float32)
    planes[0] = np.abs(planes[0])
    planes[:, :8] = 0
    light = rng.normal(size=(terms, 3)).astype(np.float32)
    number = {"full": 0, "chroma": 1, "talk": 2}[unpacking]
    defines = {"TERMS": terms, "PLANES": count, "PACKING": number}
    vectors = ", ".join(f"vec3({', '.join(f'{float(v)!r}' for v in row)})" for row in light)
    attributes = {f"p{i}": plane for i, plane in enumerate(planes)}
    stack = f"vec4[{count}]({', '.join(attributes)})"
    lights = f"vec3[{terms}]({vectors})"
    tint = "vec3(0.5, 1.0, 2.0)"
    found = glsl(
        "circular_harmonics", f"relight({stack}, {lights}, {tint})", attributes, 4, defines
    )
    if unpacking == "talk" and terms == 5:
        twin = sprite_packing.unpack_talk(planes, light, [0.5, 1, 2, 1])
    else:
        Y = sprite_packing.unpack(planes.astype(float), terms, packing, unpacking)
        L = light.astype(float)
        if unpacking == "talk":
            # From the fourth term on, white by the light's luma
            L = np.concatenate([L[:3], np.repeat(colour.luminance(L[3:])[:, None], 3, 1)])
        rgb = np.einsum("knc,kc->nc", Y, L) * [0.5, 1, 2]
        twin = np.concatenate([rgb, planes[0, :, 3:]], axis=1)
    # Chroma divides by a luminance that may be small: error relative to the largest value
    error = np.abs(found - np.maximum(twin, 0)).max() / np.abs(twin).max()
    assert error < 2e-6
    assert found[:8].max() == 0


@pytest.mark.parametrize("channels", [1, 3, 4, 15, 16])
def test_channels_of_a_dome_are_summed_as_by_the_twin(glsl, rng, channels):
    count, n = -(-(channels + 1) // 4), 64
    planes = rng.normal(size=(count, n, 4)).astype(np.float32)
    light = rng.normal(size=(channels, 3)).astype(np.float32)
    vectors = ", ".join(f"vec3({', '.join(f'{float(v)!r}' for v in row)})" for row in light)
    attributes = {f"p{i}": plane for i, plane in enumerate(planes)}
    stack, lights = f"vec4[{count}]({', '.join(attributes)})", f"vec3[{channels}]({vectors})"
    defines = {"TERMS": channels, "PLANES": count, "PACKING": 3}
    call = f"relight({stack}, {lights}, vec3(0.5, 1.0, 2.0))"
    found = glsl("circular_harmonics", call, attributes, 4, defines)
    slots = np.moveaxis(planes.astype(float), 0, 1).reshape(n, -1)
    by_channel = np.delete(slots, 3, axis=1)[:, :channels]
    twin = np.column_stack([by_channel @ light.astype(float) * [0.5, 1, 2], slots[:, 3]])
    error = np.abs(found - np.maximum(twin, 0)).max() / np.abs(twin).max()
    # Sums of up to 16 products in single precision
    assert error < 2e-6


def test_every_function_of_every_library_has_a_test():
    """A library function that no file of this folder calls by name has no twin."""
    here = Path(__file__).resolve()
    folder = here.parents[2] / "runtime" / "glsl"
    text = "".join(path.read_text() for path in here.parent.glob("test_*.py"))
    define = re.compile(r"^(?:float|u?int|u?vec[234]|bool)\s+(\w+)\s*\(", re.M)
    names = {name for path in folder.glob("*.glsl") for name in define.findall(path.read_text())}
    # relight runs whichever unpacking the defines choose, and the lumas within
    by_relight = {"unpack_full", "unpack_chroma", "unpack_talk", "unpack_dome", "further_lumas"}
    assert len(names) > 20
    assert {name for name in names - by_relight if name not in text} == set()
