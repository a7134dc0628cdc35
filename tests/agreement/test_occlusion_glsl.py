"""Where a shadow is looked up: GLSL against numpy."""

import numpy as np
import pytest

from maths import occlusion_shadow

pytestmark = pytest.mark.gpu
EXTENT = np.array([2.0, 0.5, 1.0])


@pytest.fixture
def points():
    """Inside, on the faces, far outside, and the middle."""
    rng = np.random.default_rng(0)
    spread = rng.normal(size=(400, 3)) * np.exp(rng.uniform(-3, 5, (400, 1)))
    return np.concatenate([spread, np.eye(3), -np.eye(3), np.zeros((1, 3))]).astype(np.float32)


def test_places(glsl, points):
    found = glsl("occlusion", "occlusion_place(p)", {"p": points}, 3)
    # One division and one sum in float32
    np.testing.assert_allclose(found, occlusion_shadow.occlusion_place(points), atol=3e-7)
    assert found.min() >= 0
    assert found.max() <= 1


def test_warps(glsl, points):
    place = occlusion_shadow.occlusion_place(points).astype(np.float32)
    found = glsl("occlusion", "occlusion_warp(place, 0.5)", {"place": place}, 3)
    # Four products of numbers up to 1.5, one division
    expected = occlusion_shadow.occlusion_warp(place, 0.5)
    np.testing.assert_allclose(found, expected, atol=4e-7)
    assert np.abs(expected - place).max() > 0.04


def test_shares(glsl):
    r = np.geomspace(1e-3, 1e6, 200)
    found = glsl("occlusion", "disc_share(r, 0.7)", {"r": r})
    # A root and five products, no cancellation however far
    np.testing.assert_allclose(found, occlusion_shadow.disc_share(r, 0.7), rtol=1e-6)


def test_falloffs(glsl, points):
    found = glsl("occlusion", "occlusion_falloff(p, vec3(2.0, 0.5, 1.0))", {"p": points})
    expected = occlusion_shadow.occlusion_falloff(points, EXTENT)
    np.testing.assert_allclose(found, expected, rtol=2e-6)


def test_lobes(glsl, points):
    n = points[:-1] / np.linalg.norm(points[:-1], axis=1, keepdims=True)
    n = np.concatenate([n, np.zeros((1, 3))]).astype(np.float32)
    lobe = (f"receiver_lobe(n)[{j}]" for j in range(9))
    found = [glsl("occlusion", each, {"n": n}) for each in lobe]
    # Three products in float32 of numbers up to 1.1
    expected = occlusion_shadow.receiver_lobe(n)
    np.testing.assert_allclose(np.stack(found, axis=-1), expected, atol=3e-7)


def test_shares_of_receivers(glsl):
    rng = np.random.default_rng(1)
    hidden, facing = rng.normal(size=(2, 500)).astype(np.float32) * 0.4
    call = "receiver_share(vec3(hidden), vec3(facing)).x"
    found = glsl("occlusion", call, {"hidden": hidden, "facing": facing})
    np.testing.assert_allclose(found, occlusion_shadow.receiver_share(hidden, facing), atol=2e-7)
    assert 0.2 < np.mean(found == 1) < 0.9
    assert np.any((found > 0) & (found < 1))
