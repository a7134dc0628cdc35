"""Discs over pixels: they sum to one, have a disc's variance, and do nothing when small."""

import numpy as np
import pytest

from maths import defocus, optics


def grid(radius: float) -> tuple[np.ndarray, np.ndarray]:
    reach = int(radius) + 3
    x, y = np.meshgrid(*[np.arange(-reach, reach + 1.0)] * 2)
    return x, np.hypot(x, y)


@pytest.mark.parametrize("radius", [0.0, 0.1, 0.25])
def test_half_a_pixel_across_covers_its_own_pixel_only(radius: float) -> None:
    _, away = grid(1)
    share = defocus.disc_share(away, defocus.kernel_radius(radius), 1.0)
    assert np.count_nonzero(share) == 1


@pytest.mark.parametrize("radius", [0.25, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0, 8.3])
def test_a_disc_over_pixels_keeps_light_and_variance(radius: float) -> None:
    x, away = grid(radius)
    share = defocus.disc_share(away, defocus.kernel_radius(radius), 1.0)
    # Pixels along the rim do not average out: a twentieth where the disc is one pixel, measured
    assert share.sum() == pytest.approx(1.0, abs=0.05)
    # A disc has a variance of r^2 / 4 an axis; at 0.8 it is .043 pixels^2 off, at 2 7 %, measured
    variance = (share * x * x).sum() / share.sum()
    assert variance == pytest.approx(radius**2 / 4, rel=0.075, abs=0.045)


def test_the_signed_radius_is_half_the_circle_of_confusion() -> None:
    near, focal, number, focus = 0.1, 0.05, 2.0, 3.0
    distance = np.geomspace(0.2, 1e4, 50)
    farthest = optics.pixels(optics.circle_of_confusion(np.inf, focal, number, focus), 360, 0.024)
    found = defocus.signed_radius(1 - near / distance, farthest / 2, focus / near)
    circle = optics.circle_of_confusion(distance, focal, number, focus)
    expected = np.sign(distance - focus) * optics.pixels(circle, 360, 0.024) / 2
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_a_plane_is_affine_in_the_signed_radius() -> None:
    # Slopes of planes seen through a lens stay under what `behind` takes for an edge
    rows = np.arange(200.0)
    radius = defocus.signed_radius(1 - 0.1 * rows / 800, 16.0, 30.0)
    np.testing.assert_allclose(np.diff(radius, 2), 0.0, atol=1e-12)
    assert defocus.behind(radius[10], radius[0], 10.0) == 0.0
