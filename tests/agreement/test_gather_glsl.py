"""Small pieces of the gather: GLSL against numpy."""

import numpy as np
import pytest

pytestmark = pytest.mark.gpu


def test_axes_of_faces(glsl, rng):
    p = rng.normal(size=(200, 3)).astype(np.float32)
    for axis in range(3):
        order = [axis, (axis + 1) % 3, (axis + 2) % 3]
        found = glsl("texel_places", f"to_face({axis}, p)", {"p": p}, 3)
        np.testing.assert_array_equal(found, p[:, order])
        found = glsl("texel_places", f"from_face({axis}, to_face({axis}, p))", {"p": p}, 3)
        np.testing.assert_array_equal(found, p)
        for down in (0, 1):
            call = f"vec3(normal_of({2 * axis + down}))"
            normal = glsl("texel_places", call, {"p": p[:1]}, 3)[0]
            assert normal[axis] == 1 - 2 * down
            assert np.abs(normal).sum() == 1


def test_texels_on_faces(glsl, rng):
    cell = rng.integers(0, 400, (500, 3)).astype(np.float32)
    p = (cell + rng.uniform(0.001, 0.999, (500, 3))).astype(np.float32)
    for face in range(6):
        call = f"vec2(texel_on({face}, ivec3(c), p, 4))"
        found = glsl("texel_places", call, {"c": cell, "p": p}, 2)
        u, v = (face // 2 + 1) % 3, (face // 2 + 2) % 3
        expected = np.floor((p - cell)[:, [u, v]] * 4)
        np.testing.assert_array_equal(found, expected)
    # Points that rounding put beyond the cell are its edge's
    found = glsl("texel_places", "vec2(texel_on(0, ivec3(c), c + 1.01, 4))", {"c": cell}, 2)
    assert np.all(found == 3)


def test_lat_long_maps_look_along_minus_z(glsl, rng):
    u, v = rng.uniform(0.01, 0.99, (2, 500))
    p, q = 2 * np.pi * (u - 0.5), np.pi * v
    d = np.stack([np.sin(p) * np.sin(q), np.cos(q), -np.cos(p) * np.sin(q)], axis=1)
    found = glsl("texel_places", "lat_long(3.0 * d)", {"d": d.astype(np.float32)}, 2)
    # acos and atan of drivers
    np.testing.assert_allclose(found, np.stack([u, v], axis=1), atol=2e-4)
    up = glsl("texel_places", "lat_long(d)", {"d": np.float32([[0, 1, 0], [0, -1, 0]])}, 2)
    np.testing.assert_allclose(up[:, 1], [0, 1], atol=1e-4)


def test_light_of_sums(glsl, rng):
    direct = rng.uniform(0, 9, (300, 4)).astype(np.float32)
    direct[:, 3] = rng.integers(-1, 40, 300)
    indirect = rng.uniform(0.1, 5, (300, 4)).astype(np.float32)
    before = rng.uniform(0, 5, (300, 4)).astype(np.float32)
    before[:, 3] = rng.integers(0, 2, 300)
    inputs = {"a": direct, "b": indirect, "c": before}
    found = glsl("gathered", "settled_light(a, b, c, 0.25)", inputs, 3)
    light = direct[:, :3] / np.maximum(direct[:, 3:], 1) + indirect[:, :3] / indirect[:, 3:]
    # Half of what was shown is gone after four passes
    share = before[:, 3:] * 0.5 ** (direct[:, 3:] / 4)
    np.testing.assert_allclose(found, light + (before[:, :3] - light) * share, rtol=1e-4, atol=1e-4)
    found = glsl("gathered", "is_known(a, c)", {"a": direct, "c": before})
    expected = np.where(direct[:, 3] < 0, 0, np.minimum(direct[:, 3] + before[:, 3], 1))
    np.testing.assert_array_equal(found, expected)
