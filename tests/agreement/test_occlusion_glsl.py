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


def test_shares(glsl):
    r = np.geomspace(1e-3, 1e6, 200)
    found = glsl("occlusion", "disc_share(r, 0.7)", {"r": r})
    # A root and five products, no cancellation however far
    np.testing.assert_allclose(found, occlusion_shadow.disc_share(r, 0.7), rtol=1e-6)


def test_falloffs(glsl, points):
    found = glsl("occlusion", "occlusion_falloff(p, vec3(2.0, 0.5, 1.0))", {"p": points})
    expected = occlusion_shadow.occlusion_falloff(points, EXTENT)
    np.testing.assert_allclose(found, expected, rtol=2e-6)
