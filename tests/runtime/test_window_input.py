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
