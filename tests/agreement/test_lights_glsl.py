"""Lights of lights.glsl against maths.area_lights, over random and hard configurations.

Errors are shares of the largest irradiance that the light could give at that distance if it faced
the point and nothing cut it off. 1e-5 is the promise; what was measured on llvmpipe stands beside
it.
"""

from __future__ import annotations

import numpy as np
import pytest

from maths import area_lights, environment_irradiance

pytestmark = pytest.mark.gpu
COUNT = 10_000
PROMISE = 1e-5


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def single(v):
    return np.asarray(v, np.float32)


def directions(rng, n=COUNT):
    return unit(rng.normal(size=(n, 3)))


def scene(rng):
    """Point, normal, centre, size: four decades of distance, a third about the horizon, scaled."""
    size = np.ones(COUNT)
    to = directions(rng)
    distance = 10 ** rng.uniform(-1, 3, COUNT)
    normal = directions(rng)
    level = rng.uniform(size=COUNT) < 0.4
    # The light's middle stands within its own size of the horizon
    flat = unit(np.cross(to, normal))
    near = unit(flat + to * (rng.uniform(-1.2, 1.2, COUNT) / np.maximum(distance, 1.3))[:, None])
    normal = np.where(level[:, None], near, normal)
    scale = 10.0 ** rng.choice([-6, -2, 0, 0, 0, 3, 6], COUNT)
    point = directions(rng) * rng.choice([0, 1], (COUNT, 1)) * scale[:, None]
    centre = point + to * (distance * scale)[:, None]
    return single(point), single(normal), single(centre), single(size * scale), distance


def wide(arrays):
    """The same numbers in double precision, normals made unit again."""
    return [np.asarray(a, np.float64) for a in arrays]


def test_cap_cosine(glsl, rng):
    sine = single(
        np.concatenate([10 ** rng.uniform(-6, 0, 9000), 1 - 10 ** rng.uniform(-7, -1, 1000)])
    )
    sine = np.minimum(sine, 1)
    rise = single(np.sqrt(1 - sine.astype(float) ** 2))
    c = single(np.clip(sine * rng.uniform(-1.5, 1.5, COUNT), -1, 1))
    found = glsl("lights", "cap_cosine(c, s, r)", {"c": c, "s": sine, "r": rise})
    expected = area_lights.cap_cosine(*wide([c, sine, rise]))
    # Measured 1.5e-7
    assert np.abs(found - expected).max() < PROMISE


def test_sun_irradiance(glsl, rng):
    n, to = single(directions(rng)), directions(rng)
    to[::2] = unit(np.cross(to[::2], n[::2]) + 0.02 * to[::2])
    to = single(to)
    radius = single(rng.choice([0, 0.0047, 0.3, np.pi / 2 - 1e-6], COUNT))
    call = "sun_irradiance(n, to, vec3(1.0, 2.0, 3.0), r)"
    found = glsl("lights", call, {"n": n, "to": to, "r": radius}, 3)
    expected = area_lights.sun_irradiance(*wide([n, to]), [1.0, 2.0, 3.0], radius.astype(float))
    assert np.abs(found / [1, 2, 3] - expected / [1, 2, 3]).max() < PROMISE


def test_sphere_irradiance(glsl, rng):
    point, normal, centre, radius, _ = scene(rng)
    inputs = {"p": point, "n": normal, "c": centre, "r": radius}
    found = glsl("lights", "sphere_irradiance(p, n, c, r, vec3(1.0, 2.0, 3.0))", inputs, 3)
    assert np.all(np.isfinite(found))
    p, n, c, r = wide(inputs.values())
    expected = area_lights.sphere_irradiance(p, n, c, r, [1.0, 2.0, 3.0])
    largest = np.pi * np.minimum(1, (r / np.linalg.norm(c - p, axis=1)) ** 2)
    error = np.abs(found - expected).max(axis=1) / largest / 3
    assert np.count_nonzero(expected[:, 0] == np.pi) > 500
    assert error.max() < PROMISE


def away_from_edges(point, centre, axis, size, edge):
    """Where rounding of float32 is not the question: not on the light's plane within it, nor its
    rim.

    A point at distance d from the rim turns its direction by 1e-7 size / d.
    """
    offset = point - centre
    height = np.abs(np.sum(offset * axis, axis=1)) / size
    return (height > 1e-5 * np.linalg.norm(offset, axis=1) / size) & (edge > 0.02)


def test_disc_irradiance(glsl, rng):
    point, normal, centre, radius, distance = scene(rng)
    axis = directions(rng)
    away = unit(point.astype(float) - centre)
    # A third on axis, a third nearly edge-on
    axis[::3] = away[::3]
    axis[1::3] = unit(np.cross(axis[1::3], away[1::3]) + 0.03 * axis[1::3])
    axis = single(unit(axis))
    inputs = {"p": point, "n": normal, "c": centre, "a": axis, "r": radius}
    p, n, c, a, r = wide(inputs.values())
    height = np.sum((p - c) * a, axis=1)
    side = np.sqrt(np.maximum(0, np.sum((p - c) ** 2, axis=1) - height**2))
    good = away_from_edges(p, c, a, r, np.hypot(height, side - r) / r)
    assert good.mean() > 0.9
    for both in ("true", "false"):
        call = f"disc_irradiance(p, n, c, a, r, vec3(1.0, 2.0, 3.0), {both})"
        found = glsl("lights", call, inputs, 3)
        assert np.all(np.isfinite(found))
        assert found.min() >= 0
        expected = area_lights.disc_irradiance(p, n, c, a, r, [1, 2, 3.0], two_sided=both == "true")
        largest = np.pi * np.minimum(1, distance**-2.0)
        error = np.abs(found - expected).max(axis=1) / largest / 3
        # Measured 2.1e-6: an axis of float32 is not quite unit
        assert error[good].max() < PROMISE


@pytest.mark.parametrize(("count", "k"), [(3, 4), (4, 4), (4, 8), (8, 8)])
def test_polygon_irradiance(glsl, rng, count, k):
    point, normal, centre, size, distance = scene(rng)
    x, y = directions(rng), directions(rng)
    y = unit(np.cross(x, y))
    turn = np.sort(rng.uniform(0, 2 * np.pi, (count, COUNT)), axis=0)
    stretch = 10 ** rng.uniform(-1, 0, (COUNT, 1))
    corners = [
        single(centre + size[:, None] * (np.cos(t)[:, None] * x + stretch * np.sin(t)[:, None] * y))
        for t in turn
    ]
    inputs = {"p": point, "n": normal, **{f"q{i}": q for i, q in enumerate(corners)}}
    p, n, *q = wide(inputs.values())
    q = np.stack(q, axis=1)
    apart = q - q[:, :1]
    reach = np.linalg.norm(apart, axis=-1).max(axis=1)
    apart /= reach[:, None, None]
    front = unit(np.cross(apart, np.roll(apart, -1, axis=1)).sum(axis=1))
    inputs |= {"f": single(front), "s": single(reach)}
    names = ", ".join([f"q{i}" for i in range(count)] + ["q0"] * (k - count))
    edge = np.min([segment(p, q[:, i - 1], q[:, i]) for i in range(count)], axis=0) / size
    good = away_from_edges(p, q[:, 0], np.cross(x, y), size, edge)
    assert good.mean() > 0.85
    for both in ("true", "false"):
        call = f"polygon_irradiance(p, n, vec3[{k}]({names}), f, s, vec3(1.0, 2.0, 3.0), {both})"
        found = glsl("lights", call, inputs, 3, {"POLYGON_CORNERS": k})
        assert np.all(np.isfinite(found))
        expected = area_lights.polygon_irradiance(p, n, q, [1, 2, 3.0], two_sided=both == "true")
        largest = np.pi * np.minimum(1, distance**-2.0)
        error = np.abs(found - expected).max(axis=1) / largest / 3
        # Measured 9.7e-7
        assert error[good].max() < PROMISE


def segment(p, a, b):
    e = b - a
    t = np.clip(np.sum((p - a) * e, 1) / np.maximum(np.sum(e * e, 1), 1e-30), 0, 1)
    return np.linalg.norm(p - a - t[:, None] * e, axis=1)


def test_rectangle_irradiance(glsl, rng):
    point, normal, centre, size, distance = scene(rng)
    x = directions(rng)
    y = unit(np.cross(x, directions(rng)))
    inputs = {"p": point, "n": normal, "c": centre}
    inputs |= {"u": single(x * size[:, None]), "v": single(0.3 * y * size[:, None])}
    call = "rectangle_irradiance(p, n, c, u, v, vec3(1.0, 2.0, 3.0), true)"
    found = glsl("lights", call, inputs, 3)
    p, n, c, u, v = wide(inputs.values())
    expected = area_lights.rectangle_irradiance(p, n, c, u, v, [1, 2, 3.0], two_sided=True)
    # The corners round by 1e-7 of the centre on the card; nearer, points come upon edges
    far = (distance > 2) & (distance < 20)
    error = np.abs(found - expected).max(axis=1) * distance**2 / np.pi / 3
    # Measured 9.2e-7
    assert error[far].max() < PROMISE


def test_harmonic_irradiance(glsl, rng):
    E = rng.normal(size=(9, 3))
    n = single(directions(rng))
    rows = ", ".join(f"vec3({a}, {b}, {c})" for a, b, c in E.tolist())
    found = glsl("lights", f"harmonic_irradiance(n, vec3[9]({rows}))", {"n": n}, 3)
    expected = environment_irradiance.harmonic_irradiance(n.astype(float), E)
    # Nine products of up to 3: 9 * 3 * 2^-23
    assert np.abs(found - expected).max() < 4e-6


def test_degenerate_lights_give_finite_numbers(glsl, rng):
    """On, in and behind lights, and lights without size."""
    n = single(directions(rng, 64))
    zero = np.zeros((64, 3), np.float32)
    inputs = {"n": n, "z": zero}
    a, one = "vec3(0.0, 1.0, 0.0)", "vec3(1.0)"
    calls = [
        f"sphere_irradiance(z, n, z, 0.0, {one})",
        f"sphere_irradiance(z, n, z, 1.0, {one})",
        f"sphere_irradiance(z, n, z + {a}, 1.0, {one})",
        f"disc_irradiance(z, n, z, {a}, 1.0, {one}, true)",
        f"disc_irradiance(z, n, z, {a}, 0.0, {one}, true)",
        f"disc_irradiance(z, n, z + vec3(1.0, 0.0, 0.0), {a}, 1.0, {one}, true)",
        f"disc_irradiance(z, n, z + vec3(1.0, -1e-20, 0.0), {a}, 1.0, {one}, true)",
        f"disc_irradiance(z, n, z + vec3(0.3, 1e-20, 0.0), {a}, 1.0, {one}, true)",
        f"disc_irradiance(z, {a}, z + vec3(0.0, 1e-3, 0.0), {a}, 1.0, {one}, true)",
        f"disc_irradiance(z, vec3(1.0, 0.0, 0.0), z + {a}, {a}, 1.0, {one}, true)",
        f"rectangle_irradiance(z, n, z, vec3(1.0), vec3(1.0), {one}, true)",
        f"rectangle_irradiance(z, n, z, vec3(0.0), vec3(0.0), {one}, true)",
        f"rectangle_irradiance(z, n, z, vec3(1.0, 0.0, 0.0), {a}, {one}, true)",
        f"rectangle_irradiance(z, n, z + vec3(1.0), vec3(1.0, 0.0, 0.0), {a}, {one}, true)",
    ]
    for call in calls:
        found = glsl("lights", call, inputs, 3)
        assert np.all(np.isfinite(found)), call
        assert found.min() >= 0
        assert found.max() <= np.pi * 1.0001
        dark = glsl("lights", call.replace(one, "vec3(0.0)"), inputs, 3)
        assert not dark.any(), call


def test_arctangent(glsl, rng):
    y, x = single(rng.normal(size=(2, COUNT)) * 10 ** rng.uniform(-6, 6, (2, COUNT)))
    y[:100], x[100:200] = 0, 0
    found = glsl("lights", "arctangent(y, x)", {"y": y, "x": x})
    # Polynomial 3e-8, and a few roundings of numbers up to pi
    assert np.abs(found - np.arctan2(y.astype(float), x.astype(float))).max() < 1e-6


def test_arctangent_rest(glsl):
    z = single(np.linspace(1e-6, np.tan(np.pi / 8) ** 2, COUNT))
    t = np.sqrt(z.astype(float))
    found = glsl("lights", "arctangent_rest(z)", {"z": z})
    # The polynomial, 8e-8 where t is largest, and a rounding of .06
    assert np.abs(found - (np.arctan(t) / t - 1)).max() < 1e-7


def test_the_two_sums_over_a_disc_agree(glsl, rng):
    """At R / D = .2 both are good: `disc_strips` to .2^8, `disc_arc_and_chord` to 1e-7 / .2^2."""
    x, y = single(rng.uniform(-0.5, 0.5, (2, 2000)))
    k, m = single(rng.uniform(-0.95, 0.95, (2, 2000)))
    R = single(np.full(2000, 0.2))
    h = single(np.sqrt(1 - x.astype(float) ** 2 - y.astype(float) ** 2 - 0.04))
    # The normal that puts the horizon at k: s (x + R k) + m h = 0
    s = single(1 / np.hypot(1, (x + 0.2 * k) / h))
    m = single(-s * (x + 0.2 * k) / h)
    inputs = {"x": x, "y": y, "k": k, "h": h, "m": m, "s": s, "R": R, "t": single(np.arccos(k))}
    strips = glsl("lights", "disc_strips(vec2(x, y), h, R, s, k, t, 7)", inputs)
    a = np.hypot(x, y).astype(float)
    near, far = np.sqrt((a - 0.2) ** 2 + h**2), np.sqrt((a + 0.2) ** 2 + h**2)
    S = near * far
    inputs |= {"rim": single(np.stack([near, far, 1 - (1 - 0.08) / S], -1))}
    arc = glsl("lights", "disc_arc_and_chord(vec2(x, y), h, R, m, s, k, t, rim)", inputs)
    assert np.abs(strips - arc).max() < PROMISE * np.pi * 0.04
    assert strips.max() > 0.02


def test_polygon_edge(glsl, rng):
    """The edge's angle times the cosine of its plane's normal, wherever the first corner is."""
    r0, q, e, n = single(rng.normal(size=(4, 4000, 3)))
    n = single(unit(n.astype(float)))
    wr, we, wn = wide([r0, e, n])
    r = wr + wide([q])[0]
    across = np.cross(r, we)
    size = np.linalg.norm(across, axis=1)
    expected = np.arctan2(size, np.sum(r * (r + we), 1)) * np.sum(across * wn, 1) / size
    inputs = {"r0": r0, "q": q, "e": e, "n": n}
    found = glsl("lights", "polygon_edge(r0, q, e, n, cross(n, r0), 0.0, false)", inputs)
    # Cross products of numbers up to 4 round by 1e-6
    assert np.abs(found - expected)[size > 0.1].max() < 5e-5
    # A far edge that leaves out its share of what sums to 0
    inputs["q"], inputs["e"] = single(q * 0.001), single(e * 0.001)
    inputs["r0"] = single(unit(r0.astype(float)))
    w0, wq, we = wide([inputs["r0"], inputs["q"], inputs["e"]])
    across = np.cross(w0 + wq, we)
    size = np.linalg.norm(across, axis=1)
    whole = np.arctan2(size, np.sum((w0 + wq) * (w0 + wq + we), 1))
    expected = whole * np.sum(across * wn, 1) / size - np.sum(np.cross(w0, we) * wn, 1) / np.sum(
        w0 * w0, 1
    )
    found = glsl("lights", "polygon_edge(r0, q, e, n, cross(n, r0), dot(r0, r0), false)", inputs)
    # Terms of up to 4^2 * 1e-6, each to 2^-23: without the level they would be good to 4e-10 only
    assert np.abs(found - expected).max() < 2e-11
    assert np.abs(expected).max() > 3e-6
