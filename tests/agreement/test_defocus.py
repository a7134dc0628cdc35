"""The lens as a gather: the shader's functions against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from maths import defocus

pytestmark = pytest.mark.gpu
N = 4096
FEW = 8 * 2.0**-24  # of a value: a handful of roundings to 24 bits


@pytest.fixture
def draw():
    random = np.random.default_rng(7)
    return lambda low, high: random.uniform(low, high, N).astype(np.float32)


def test_signed_radius_and_back(glsl, draw):
    depth, farthest, focus = draw(0.5, 1.0), draw(1.0, 100.0), draw(2.0, 200.0)
    inputs = {"depth": depth, "farthest": farthest, "focus": focus}
    found = glsl("defocus", "signed_radius(depth, farthest, focus)", inputs)
    expected = defocus.signed_radius(depth, farthest, focus)
    np.testing.assert_allclose(found, expected, rtol=FEW, atol=FEW * 100 * 100)
    radius = draw(-50.0, 0.9) * np.minimum(farthest, 1.0)
    inputs = {"radius": radius, "farthest": farthest, "focus": focus}
    found = glsl("defocus", "depth_of_radius(radius, farthest, focus)", inputs)
    expected = defocus.depth_of_radius(radius, farthest, focus)
    np.testing.assert_allclose(found, expected, rtol=FEW, atol=FEW * 50)


def test_kernels(glsl, draw):
    radius, distance, texel = draw(0.0, 40.0), draw(0.0, 40.0), draw(1.0, 4.0)
    found = glsl("defocus", "kernel_radius(radius)", {"radius": radius})
    np.testing.assert_allclose(found, defocus.kernel_radius(radius), rtol=FEW)
    radius = radius + texel / 2
    inputs = {"distance": distance, "radius": radius, "texel": texel}
    found = glsl("defocus", "disc_share(distance, radius, texel)", inputs)
    # The ramp takes the difference of two numbers of up to 42 pixels
    inside = 42 * FEW / (np.pi * radius**2)
    expected = defocus.disc_share(distance, radius, texel)
    assert np.all(np.abs(found - expected) <= 2 * FEW * expected + inside)


def test_weight_of_a_radius_is_light_and_a_little_coverage(glsl, draw):
    layer = np.stack([draw(0.0, 4.0) for _ in range(4)], axis=1)
    found = glsl("defocus", "radius_weight(layer)", {"layer": layer})
    np.testing.assert_allclose(found, layer @ [0.2126, 0.7152, 0.0722, 0.02], rtol=FEW)


def test_shares(glsl, draw):
    radius, than, distance = draw(0.0, 6.0), draw(-6.0, 6.0), draw(0.0, 12.0)
    found = glsl("defocus", "layered(radius)", {"radius": radius})
    np.testing.assert_allclose(found, defocus.layered(radius), atol=4 * FEW)
    inputs = {"radius": radius, "than": than, "distance": distance}
    found = glsl("defocus", "behind(radius, than, distance)", inputs)
    # The slope of the step is at most 3 over the least slack, over numbers of up to 12
    expected = defocus.behind(radius, than, distance)
    np.testing.assert_allclose(found, expected, atol=36 * FEW)
