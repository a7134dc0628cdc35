"""Callbacks of a window, without one."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

pytest.importorskip("imgui_bundle")


class Toolkit:
    """Keeps callbacks as glfw does; any constant is a number of its own."""

    def __init__(self):
        self.callbacks = {}

    def __getattr__(self, name):
        if name.startswith("set_"):
            return lambda handle, react: self.callbacks.__setitem__(name, react)
        return hash(name)


def test_what_breaks_in_a_callback_is_raised_by_the_loop():
    from runtime.window_input import Input

    def broken():
        raise ZeroDivisionError("once")

    glfw = Toolkit()
    made = Input(glfw, None, SimpleNamespace(dress=broken))
    assert len(glfw.callbacks) == 9
    made.check()
    glfw.callbacks["set_window_content_scale_callback"](None, 1.0, 1.0)
    with pytest.raises(ZeroDivisionError, match="once"):
        made.check()


@pytest.mark.parametrize(("last", "taker"), [(900.0, "picture"), (100.0, "panel")])
def test_a_button_right_after_a_move_goes_where_the_cursor_is(monkeypatch, last, taker):
    """The panel still wants the mouse, for its last frame saw it there: off the panel that is old,
    over the picture it is a list that hangs over it."""
    from runtime import window_input

    monkeypatch.setattr(window_input.imgui, "get_mouse_cursor", lambda: 0)
    viewer = SimpleNamespace(button=lambda name: None)
    io = SimpleNamespace(want_capture_mouse=True, add_mouse_button_event=lambda *_: None)
    window = SimpleNamespace(
        io=io, viewer=viewer, picture_width=640, stir=lambda: None, overlay=SimpleNamespace()
    )
    window.overlay.on_line = lambda *_: False
    glfw = Toolkit()
    made = window_input.Input(glfw, None, window)
    made._at = (last, 10.0)
    made.shape()
    made._at = (200.0, 150.0)
    glfw.callbacks["set_mouse_button_callback"](None, 0, glfw.PRESS, 0)
    assert made._drag == taker
