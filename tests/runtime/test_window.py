"""The window's own steps that need no window; tests/pipelines/test_window.py opens real ones."""

from types import SimpleNamespace

from runtime.window import Window


class Resized:
    """Tells sizes one call after the other, as of a window that hands resize meanwhile."""

    def __init__(self, *sizes):
        self.sizes = list(sizes)

    def get_framebuffer_size(self, _):
        return self.sizes.pop(0) if len(self.sizes) > 1 else self.sizes[0]

    get_window_size = get_framebuffer_size


def test_units_and_pixels_are_of_one_moment():
    # It grew between the two calls: by their ratio, letters would be 640 times as dense
    window = SimpleNamespace(_handle=None, size=(640, 360), pixels=(640, 360))
    window._glfw = Resized((1, 1), (1, 1), (640, 360), (640, 360))
    Window._measure(window)
    assert window.size == window.pixels == (640, 360)


def test_the_first_measure_and_one_of_an_unchanged_window():
    window = SimpleNamespace(_handle=None, size=(0, 0), pixels=(0, 0), _glfw=Resized((960, 540)))
    for _ in range(2):
        Window._measure(window)
        assert window.size == window.pixels == (960, 540)
