"""The thin lens against the lens equation, and what a lens cannot be."""

import numpy as np
import pytest

from maths.optics import circle_of_confusion, lod, pixels, texels, vertical_field_of_view
from maths.transforms import perspective

LENS = {"focal_length": 0.05, "f_number": 1.8}


def test_equals_ray_tracing_through_the_lens_equation(rng: np.random.Generator) -> None:
    f, focus, d = 0.05, rng.uniform(0.3, 50, 200), rng.uniform(0.2, 80, 200)
    # Cone from the aperture to the image of the point, cut by the sensor
    sensor, image = 1 / (1 / f - 1 / focus), 1 / (1 / f - 1 / d)
    truth = f / 1.8 * np.abs(image - sensor) / image
    found = circle_of_confusion(d, f, 1.8, focus)
    # Both differences of images lose up to 4 digits: the aperture times 1e-12
    assert np.allclose(found, truth, rtol=0, atol=1e-13)


def test_formula() -> None:
    d = np.array([0.5, 1.0, 3.0, 1e6])
    truth = (0.05 / 1.8) * 0.05 * np.abs(d - 3) / (d * (3 - 0.05))
    assert np.allclose(circle_of_confusion(d, **LENS, focus_distance=3.0), truth, rtol=1e-12)


@pytest.mark.parametrize("focus", [0.0501, 0.2, 3.0, 1e6])
def test_zero_at_focus_and_growing_both_ways(focus: float) -> None:
    assert circle_of_confusion(focus, **LENS, focus_distance=focus) == 0
    nearer = circle_of_confusion(np.linspace(focus, 0.05, 50), **LENS, focus_distance=focus)
    farther = circle_of_confusion(focus * np.geomspace(1, 1e6, 50), **LENS, focus_distance=focus)
    assert np.all(np.diff(nearer) > 0)
    assert np.all(np.diff(farther) > 0)


def test_every_distance_is_finite_and_bounded() -> None:
    d = np.array([-np.inf, -5.0, 0.0, 1e-300, 0.05, 1e6, 1e300, np.inf])
    found = circle_of_confusion(d, **LENS, focus_distance=2.0)
    aperture = 0.05 / 1.8
    assert np.all(np.isfinite(found))
    # Up to the focal length the circle is the aperture
    assert np.allclose(found[:5], aperture, rtol=1e-14)
    assert np.isclose(found[-1], aperture * 0.05 / 1.95, rtol=1e-14)


@pytest.mark.parametrize(
    ("distance", "f", "number", "focus"),
    [
        (np.nan, 0.05, 1.8, 2.0),
        (1.0, 0.05, 1.8, 0.05),
        (1.0, 0.05, 1.8, 0.01),
        (1.0, 0.05, 1.8, np.inf),
        (1.0, 0.0, 1.8, 2.0),
        (1.0, 0.05, 0.0, 2.0),
        (1.0, np.nan, 1.8, 2.0),
    ],
)
def test_lenses_that_cannot_be_are_refused(distance, f, number, focus) -> None:
    with pytest.raises(ValueError, match="lens"):
        circle_of_confusion(distance, f, number, focus)


def test_texels_and_pixels_agree_with_the_projection() -> None:
    # A sprite of 0.01 m a texel at 4 m, on 720 lines of 24 mm
    clip = perspective(0.05, 0.024, 1.0, 0.1, 100.0)
    ndc = [(clip @ [0, y, -4.0, 1])[1] / 4.0 for y in (0.0, 0.01)]
    pixels_a_texel = (ndc[1] - ndc[0]) * 720 / 2
    coc = 0.0007
    assert np.isclose(
        texels(coc, 4.0, 0.05, 0.01), pixels(coc, 720, 0.024) / pixels_a_texel, rtol=1e-14
    )


def test_level_is_the_logarithm_within_its_limits() -> None:
    assert lod([0.0, 0.5, 1.0, 2.0, 8.0], 1.0).tolist() == [0, 0, 0, 1, 3]
    assert lod(8.0, 2.0) == 4
    assert lod([1e30, np.inf], 1.0, 6.5).tolist() == [6.5, 6.5]


def test_field_of_view_matches_the_projection() -> None:
    half = 0.5 * vertical_field_of_view(0.05, 0.024)
    clip = perspective(0.05, 0.024, 1.5, 0.1, np.inf) @ [0, np.tan(half), -1.0, 1.0]
    assert np.isclose(clip[1] / clip[3], 1, rtol=1e-14)
