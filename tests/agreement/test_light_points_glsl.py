"""Points on lights, GLSL against numpy: directions, how far, and radiance over density."""

import numpy as np
import pytest

from maths.sampling import orthonormal_basis, uniform_cone
from maths.transforms import normalise

pytestmark = pytest.mark.gpu
POINT = "vec4(0.0); LightPoint p = {}; value = vec4(p.d, p.reach)"
LIGHT = "vec3(0.0); LightPoint p = {}; value = p.light"


def inputs(**arrays):
    return {name: np.asarray(values, np.float32) for name, values in arrays.items()}


def in_cone(axis, half_angle, u):
    a, b = orthonormal_basis(axis)
    local = uniform_cone(u, half_angle)
    return local[:, :1] * a + local[:, 1:2] * b + local[:, 2:] * axis


def test_cones(glsl, rng):
    axis, u = normalise(rng.normal(size=(1000, 3))), rng.random((1000, 2))
    axis[:3] = [[0, 0, 1], [0, 0, -1], [1, 0, 0]]
    half = rng.uniform(0.001, np.pi, 1000)
    tall = 2 * np.sin(half / 2) ** 2
    found = glsl("light_points", "in_cone(a, t, u)", inputs(a=axis, t=tall, u=u), 3)
    # Seven digits; near the edge of a wide cone sines lose half of them
    np.testing.assert_allclose(found, in_cone(axis, half, u), atol=2e-3)
    assert np.quantile(np.abs(found - in_cone(axis, half, u)), 0.99) < 1e-5


def test_suns(glsl, rng):
    axis, u = normalise(rng.normal(size=(500, 3))), rng.random((500, 2))
    radius, light = np.radians(rng.uniform(0, 45, 500)), rng.uniform(0, 5, (500, 3))
    radius[:10] = 0
    given = inputs(a=np.concatenate([axis, radius[:, None]], axis=1), e=light, u=u)
    found = glsl("light_points", POINT.format("sun_point(a, e, u)"), given, 4)
    np.testing.assert_allclose(found[:, :3], in_cone(axis, radius, u), atol=1e-5)
    assert (found[:, 3] > 1e29).all()
    # The mean of light times the cosine to the sun's own direction is its irradiance
    sent = glsl("light_points", LIGHT.format("sun_point(a, e, u)"), given, 3)
    np.testing.assert_allclose(sent, light * (2 / (1 + np.cos(radius)))[:, None], rtol=1e-5)


def test_spheres(glsl, rng):
    start, u = rng.uniform(-4, 4, (1000, 3)), rng.random((1000, 2))
    place, light = np.append(rng.uniform(-4, 4, 3), 1.5), np.array([3.0, 2.0, 1.0])
    given = inputs(a=start, c=np.tile(place, (1000, 1)), e=np.tile(light, (1000, 1)), u=u)
    found = glsl("light_points", POINT.format("sphere_point(a, c, e, u)"), given, 4)
    offset = place[:3] - start
    distance = np.linalg.norm(offset, axis=1)
    out = distance > place[3]
    half = np.where(out, np.arcsin(np.minimum(1, place[3] / distance)), np.pi)
    expected = in_cone(offset / distance[:, None], half, u)
    np.testing.assert_allclose(found[out, :3], expected[out], atol=1e-4)
    assert not found[~out, 3].any()
    # On the ball, on the side that is seen; at the rim a rounding of 1e-7 is 1e-3 of the way
    end = start + found[:, 3:] * found[:, :3] - place[:3]
    np.testing.assert_allclose(np.linalg.norm(end[out], axis=1), place[3], atol=3e-3)
    assert (np.sum(end[out] * found[out, :3], axis=1) < 1e-2).all()
    sent = glsl("light_points", LIGHT.format("sphere_point(a, c, e, u)"), given, 3)
    solid = 4 * np.pi * np.sin(half / 2) ** 2
    np.testing.assert_allclose(sent, solid[:, None] * light, rtol=1e-4)


def test_discs(glsl, rng):
    start, u = rng.uniform(-4, 4, (1000, 3)), rng.random((1000, 2))
    axis, light = normalise(rng.normal(size=3)), np.array([3.0, 2.0, 1.0])
    place = np.append(rng.uniform(-4, 4, 3), 1.5)
    columns = {"c": place, "n": axis, "e": light}
    given = inputs(a=start, u=u, **{k: np.tile(v, (1000, 1)) for k, v in columns.items()})
    for both in (False, True):
        call = f"disc_point(a, c, n, e, {str(both).lower()}, u)"
        found = glsl("light_points", POINT.format(call), given, 4)
        end = start + found[:, 3:] * found[:, :3] - place[:3]
        np.testing.assert_allclose(end @ axis, 0, atol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(end, axis=1), 1.5 * np.sqrt(u[:, 0]), atol=1e-5)
        fall = -(found[:, :3].astype(float) @ axis)
        fall = np.abs(fall) if both else np.maximum(fall, 0)
        solid = np.pi * 1.5**2 * fall / found[:, 3].astype(float) ** 2
        sent = glsl("light_points", LIGHT.format(call), given, 3)
        np.testing.assert_allclose(sent, solid[:, None] * light, rtol=1e-4, atol=1e-6)
    # Behind a one-sided one there is nothing
    assert np.mean(fall == 0) < 0.01
