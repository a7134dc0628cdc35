"""How large the panel is drawn on screens of all densities."""

import pytest

from runtime import window_open


@pytest.mark.parametrize(
    ("content", "size", "pixels", "expected"),
    [
        # An ordinary screen; one whose units are pixels (X11); one whose units are larger (macOS)
        (1.0, (960, 540), (960, 540), 1.0),
        (2.0, (960, 540), (960, 540), 2.0),
        (2.0, (960, 540), (1920, 1080), 1.0),
        (1.5, (960, 540), (1440, 810), 1.0),
        # Quarters; never smaller than on an ordinary screen; minimised
        (1.3, (960, 540), (960, 540), 1.25),
        (0.5, (960, 540), (960, 540), 1.0),
        (1.0, (0, 0), (0, 0), 1.0),
    ],
)
def test_the_panel_has_the_density_of_the_screen(content, size, pixels, expected):
    assert window_open.scale(content, size, pixels) == expected
