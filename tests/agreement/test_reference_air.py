"""Sky, fog and mottling of the reference against the GLSL that the player draws them with."""

import numpy as np
import pytest

from bake import reference_air as air

pytestmark = pytest.mark.gpu
N = 4096


@pytest.fixture
def directions(rng):
    vectors = rng.normal(size=(N, 3))
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit.astype(np.float32).astype(np.float64)


def test_sky(glsl, directions):
    to_sun = np.array([0.48, 0.6, 0.64], np.float32).astype(np.float64)
    zenith, horizon = np.array([0.25, 0.5, 1.0]), np.array([1.0, 0.5, 0.125])
    # Half of the directions near the sun, about its disc
    directions[::2] = to_sun + 0.2 * (directions[::2] - to_sun)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions.astype(np.float32).astype(np.float64)
    sun = "vec3(0.48, 0.6, 0.64)"
    found = glsl(
        "sky",
        "sky_gradient(d.y, vec3(.25, .5, 1.), vec3(1., .5, .125))",
        {"d": directions},
        components=3,
    )
    # A few roundings of numbers up to 1, and float32's exp
    assert np.abs(found - air.sky_gradient(directions[:, 1], zenith, horizon)).max() < 1e-6
    # 1 - cos has an absolute rounding of 2^-23, over .006 in the narrow lobe
    found = glsl("sky", f"sky_glow(d, {sun})", {"d": directions})
    assert np.abs(found - air.sky_glow(directions, to_sun)).max() < 4 * 2.0**-23 / 0.006
    found = glsl("sky", f"sky_disc(d, {sun}, 0.1)", {"d": directions})
    assert 0.01 < found.mean() < 0.99
    # llvmpipe's asin is a polynomial: 3e-4 measured, 8e-6 of an angle over a limb of 0.04
    assert np.abs(found - air.sky_disc(directions, to_sun, 0.1)).max() < 1e-3


@pytest.mark.parametrize("falloff", [0.0, 0.5])
def test_fog(glsl, directions, falloff):
    distance = np.exp(np.linspace(-3.0, 5.0, N)).astype(np.float32).astype(np.float64)
    ends = (np.array([1.0, 2.0, 3.0]) + distance[:, None] * directions).astype(np.float32)
    offset = ends.astype(np.float64) - [1.0, 2.0, 3.0]
    start = np.full(N, 2.0)
    found = glsl(
        "fog",
        f"fog_transmittance(vec3(1., 2., 3.), e, 0.04, {falloff:.2f}, 0.0)",
        {"e": ends},
    )
    truth = air.fog_transmittance(
        start, offset[:, 1], np.linalg.norm(offset, axis=1), 0.04, falloff
    )
    assert truth.min() < 0.1
    assert truth.max() > 0.9
    # (1 - exp(-s)) / s at s = 1e-3 cancels to 2^-24 / 1e-3, times a depth whose exp is at most 1/e
    assert np.abs(found - truth).max() < 2e-4
    sine = directions[:, 1]
    call = f"fog_sky(vec3(1., 2., 3.), s, 0.04, {falloff:.2f}, 0.0, {air.RISE:.9f})"
    found = glsl("fog", call, {"s": sine})
    # The argument of exp is rounded: at most x exp(-x) < 1/e of 2^-22 of it
    assert np.abs(found - air.fog_sky(start, sine, 0.04, falloff, air.RISE)).max() < 1e-6


def test_mottle(glsl, rng):
    place = rng.uniform(-40, 40, (N, 2)).astype(np.float32)
    found = glsl(["mottle"], "mottle(p, 0.0)", {"p": place})
    truth = air.mottle(place.astype(np.float64))
    # The finest octave has 40 * 15 cells, whose places float32 rounds by 2^-24 of that; noise rises
    # by at most 15/8 a cell, times the step's slope of 1.5 / .56
    assert truth.std() > 0.1
    assert np.abs(found - truth).max() < 8 * 600 * 2.0**-24 * 15 / 8 * 1.5 / 0.56
