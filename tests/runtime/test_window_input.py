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

    def get_key(self, *_):
        return hash("RELEASE")


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


class Desk:
    """A window 960 units wide whose panel begins at 640, and a list of it that hangs over 100."""

    def __init__(self):
        self.io = SimpleNamespace(want_capture_mouse=False)
        self.io.add_mouse_pos_event = lambda *at: setattr(self, "at", at)
        self.io.add_mouse_button_event = self.io.add_mouse_wheel_event = lambda *_: None
        self.seen = []
        self.viewer = SimpleNamespace(
            cursor=lambda x, y, _: self.seen.append((round(x), round(y))),
            button=self.seen.append,
            release=lambda name: self.seen.append("released"),
            wheel=self.seen.append,
        )
        self.picture_width, self.size, self.pixels = 640, (960, 540), (960, 540)
        self.overlay = SimpleNamespace(on_line=lambda *_: False)
        self.stir = lambda: None

    def frame(self, made):
        """Draw the panel, which then tells what it wants."""
        self.io.want_capture_mouse = self.at[0] >= 640 or abs(self.at[0] - 100) < 20
        made.drawn()


@pytest.fixture
def desk(monkeypatch):
    from runtime import window_input

    monkeypatch.setattr(window_input.imgui, "get_mouse_cursor", lambda: 0)
    window, glfw = Desk(), Toolkit()
    return window, glfw, window_input.Input(glfw, None, window)


@pytest.mark.parametrize("last", [900.0, 100.0, 400.0])
@pytest.mark.parametrize(("now", "taker"), [(300.0, "picture"), (100.0, "panel"), (700.0, "panel")])
def test_a_button_right_after_a_move_goes_where_the_cursor_is(desk, last, now, taker):
    """Also before the panel could say whether it wants the mouse there."""
    window, glfw, made = desk
    move, press = (
        glfw.callbacks[f"set_{name}_callback"] for name in ("cursor_pos", "mouse_button")
    )
    move(None, last, 10.0)
    window.frame(made)
    move(None, now, 150.0)
    press(None, 0, glfw.PRESS, 0)
    window.frame(made)
    assert made._drag == taker


def test_a_drag_between_two_frames_keeps_its_order(desk):
    window, glfw, made = desk
    move, press = (
        glfw.callbacks[f"set_{name}_callback"] for name in ("cursor_pos", "mouse_button")
    )
    move(None, 100.0, 10.0)
    window.frame(made)
    window.seen.clear()
    move(None, 300.0, 150.0)
    press(None, 0, glfw.PRESS, 0)
    move(None, 340.0, 160.0)
    press(None, 0, glfw.RELEASE, 0)
    # Up waits too: where it goes is known when the panel has seen the cursor there
    window.frame(made)
    window.frame(made)
    assert window.seen == [(300, 150), "left", (340, 160), "released"]
    made.check()


def test_the_wheel_waits_for_the_panel_too(desk):
    window, glfw, made = desk
    move = glfw.callbacks["set_cursor_pos_callback"]
    move(None, 100.0, 10.0)
    window.frame(made)
    move(None, 300.0, 150.0)
    glfw.callbacks["set_scroll_callback"](None, 0.0, 2.0)
    window.frame(made)
    assert window.seen[-1] == 2.0


def test_what_breaks_after_it_waited_is_raised_too(desk):
    window, glfw, made = desk
    window.viewer.button = lambda name: 1 / 0
    glfw.callbacks["set_cursor_pos_callback"](None, 300.0, 150.0)
    glfw.callbacks["set_mouse_button_callback"](None, 0, glfw.PRESS, 0)
    made.check()
    window.frame(made)
    with pytest.raises(ZeroDivisionError):
        made.check()
