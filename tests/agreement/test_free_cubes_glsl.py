"""Cubes that lie free: entry, visible sides and points on them, GLSL against numpy."""

import numpy as np
import pytest

pytestmark = pytest.mark.gpu
ROUND = 2e-4  # float32, lengths up to 30, slopes to 1e3 near the edges that are left out


def slabs(start, d, place):
    """Length, axis and hit of rays (m, 3) against cubes (m, 4), the slow way."""
    low, high = place[:, :3] - place[:, 3:], place[:, :3] + place[:, 3:]
    with np.errstate(divide="ignore"):
        ends = np.sort(np.stack([(low - start) / d, (high - start) / d]), axis=0)
    first, last = ends[0].max(axis=1), ends[1].min(axis=1)
    return first, last, ends[0].argmax(axis=1)


def test_rays_enter_where_slabs_meet(glsl, rng):
    start = rng.uniform(-8, 8, (2000, 3))
    place = np.concatenate([rng.uniform(-8, 8, (2000, 3)), rng.uniform(0.5, 3, (2000, 1))], axis=1)
    d = place[:, :3] + 1.2 * place[:, 3:] * rng.uniform(-1, 1, (2000, 3)) - start
    d[::7] = -d[::7]
    inputs = {k: v.astype(np.float32) for k, v in {"a": start, "d": d, "c": place}.items()}
    call = "vec2(0.0); float fall; float t = cube_entry(a, d, c, fall); value = vec2(t, fall)"
    found = glsl("free_cubes", call, inputs, 2)
    first, last, axis = slabs(start, d, place)
    # Leave out what rounding may decide either way
    sure = (np.abs(last - first) > 1e-3) & (np.abs(last) > 1e-3) & (np.abs(first) > 1e-3)
    meets = (first <= last) & (last > 0)
    assert meets[sure].mean() > 0.3
    assert (~meets[sure]).mean() > 0.1
    np.testing.assert_array_equal(found[sure, 0] >= 0, meets[sure])
    chosen = sure & meets
    np.testing.assert_allclose(found[chosen, 0], np.maximum(first, 0)[chosen], atol=ROUND)
    outside = chosen & (first > 0)
    fall = np.abs(d[np.arange(len(d)), axis]) / np.linalg.norm(d, axis=1)
    np.testing.assert_allclose(found[outside, 1], fall[outside], atol=ROUND)


def test_points_lie_on_visible_sides_evenly(glsl, rng):
    count = 3000
    start = np.tile(np.float32([[3.0, 0.2, -2.0]]), (count, 1))
    place = np.tile(np.float32([[0.5, 0.4, 0.1, 1.0]]), (count, 1))
    u = rng.random((count, 3)).astype(np.float32)
    sides = glsl("free_cubes", "cube_sides(a, c)", {"a": start, "c": place}, 3)
    # Above and below it lies within the cube's height: that side is not seen
    np.testing.assert_array_equal(sides[0], [1, 0, -1])
    point = glsl(
        "free_cubes", "cube_point(cube_sides(a, c), c, u)", {"a": start, "c": place, "u": u}, 3
    )
    local = point - place[:, :3]
    on_x, on_z = np.abs(local[:, 0] - 1) < 1e-6, np.abs(local[:, 2] + 1) < 1e-6
    assert np.all(on_x | on_z)
    # Each side has half of the points, within 4 standard errors, spread over all of it
    assert abs(on_x.mean() - 0.5) < 4 * 0.5 / np.sqrt(count)
    for chosen, across in ((on_x, (1, 2)), (on_z, (0, 1))):
        spread = local[chosen][:, across]
        error = 1 / np.sqrt(3 * chosen.sum())
        assert np.all(np.abs(spread.mean(axis=0)) < 4 * error)
        assert np.all(np.abs(spread).max(axis=0) > 0.98)
        assert np.all(np.abs(spread).max(axis=0) <= 1 + 1e-6)
