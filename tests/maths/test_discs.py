"""Discs out of focus: all light is kept, and both ends are what they must be."""

import numpy as np
import pytest

from maths import discs


def integral(mean: float, width: float) -> float:
    """Of a profile over the plane, by the midpoint rule."""
    r = (np.arange(200_000) + 0.5) / 200_000 * (mean + width)
    return float((discs.profile(r, mean, width) * 2 * np.pi * r).mean() * (mean + width))


@pytest.mark.parametrize(("mean", "width"), [(1.0, 0.0), (1.0, 0.3), (2.0, 2.0), (0.5, 0.1)])
def test_the_light_is_the_integral(mean: float, width: float) -> None:
    # 2e5 steps over a jump: 1e-5
    assert discs.light(mean, width) == pytest.approx(integral(mean, width), rel=2e-5)


@pytest.mark.parametrize("blur", [0.0, 0.01, 0.5, 1.0, 7.0])
def test_blur_keeps_all_light(blur: float) -> None:
    mean, width, gain = (float(each) for each in discs.blurred(1.0, 0.6, blur))
    assert gain * integral(mean, width) == pytest.approx(float(discs.light(0.7, 0.3)), rel=1e-4)
    assert width <= mean


def test_in_focus_it_is_itself_and_far_out_of_focus_the_lens_disc() -> None:
    assert [float(each) for each in discs.blurred(1.0, 0.6, 0.0)] == [0.7, 0.3, 1.0]
    mean, width, gain = (float(each) for each in discs.blurred(1e-3, 0.0, 1.0))
    assert (mean, width) == (1.0, 1e-3)
    assert gain == pytest.approx(1e-6, rel=1e-5)


def test_it_is_near_the_true_convolution_of_two_discs() -> None:
    """Of a hard disc of radius 1 by one of .4, from their overlap: r at which a half is left."""
    rng = np.random.default_rng(1)
    angle, radius = rng.uniform(0, 2 * np.pi, 40_000), 0.4 * np.sqrt(rng.random(40_000))
    mean, width, gain = discs.blurred(1.0, 0.0, 0.4)
    for r in np.linspace(0, 1.6, 17):
        x, y = r + radius * np.cos(angle), radius * np.sin(angle)
        true = float((np.hypot(x, y) < 1.0).mean())
        # The shape of the edge differs: .05 measured
        assert abs(float(gain * discs.profile(r, mean, width)) - true) < 0.07
