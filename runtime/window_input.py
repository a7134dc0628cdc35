"""Keys, mouse and changes of a glfw window, handed to the panel or to the viewer."""

from __future__ import annotations

import time as clocks
from collections.abc import Callable
from typing import Any

from imgui_bundle import imgui

DOUBLE = 0.35  # seconds between the clicks of a double click
REPEATED = {"left_arrow", "right_arrow", "[", "]", "-", "=", ",", "."}
BUTTONS = ("left", "right", "middle")


class Input:
    """The callbacks of one window.

    window : runtime.window.Window, with the viewer, the sizes and the panel.
    """

    def __init__(self, glfw: Any, handle: Any, window: Any) -> None:
        self._glfw, self._handle, self._window = glfw, handle, window
        self._names, self._panel_keys = _names(glfw), _panel_keys(glfw)
        self._at = (0.0, 0.0)
        self._moved = False  # the cursor, since the panel was drawn last
        self._held: list[tuple[Callable[..., None], tuple[Any, ...]]] = []  # input for after that
        self._drag: str | None = None  # who has the button that is down: picture, panel or line
        self._clicked = -1.0
        self._cursors: dict[int, Any] = {}
        self._errors: list[Exception] = []
        for event, react in (
            ("key", self._key),
            ("char", self._char),
            ("mouse_button", self._in_turn(self._button)),
            ("cursor_pos", self._in_turn(self._cursor)),
            ("scroll", self._in_turn(self._scroll)),
            ("framebuffer_size", self._changed),
            ("window_refresh", self._changed),
            ("window_focus", self._focus),
            ("window_content_scale", self._dense),
        ):
            getattr(glfw, f"set_{event}_callback")(handle, self._kept(react))

    def check(self) -> None:
        """Raise the first exception of a callback."""
        if self._errors:
            raise self._errors[0]

    def _kept(self, react: Callable[..., None]) -> Callable[..., None]:
        """Return a callback whose exceptions `check` raises: glfw prints and forgets them."""

        def reacting(*said: Any) -> None:
            try:
                react(*said)
            except Exception as error:
                self._errors.append(error)

        return reacting

    def _in_turn(self, react: Callable[..., None]) -> Callable[..., None]:
        """Return a callback that waits for the next frame where it has to know what is under the
        cursor: what the panel says of that is as old as its last frame."""
        asks = react in (self._button, self._scroll)

        def reacting(*said: Any) -> None:
            if self._held or (asks and self._moved):
                self._held.append((reacting, said))
                self._window.stir()
            else:
                react(*said)

        return reacting

    @property
    def _over_panel(self) -> bool:
        """Whether the cursor is on the panel, or on something of it that lies over the picture."""
        window = self._window
        return bool(self._at[0] >= window.picture_width or window.io.want_capture_mouse)

    def drawn(self) -> None:
        """Take in what waited for a frame, then give the cursor the shape of what it is on."""
        self._moved = False
        held, self._held = self._held, []
        for react, said in held:
            self._kept(react)(*said)
        self._shape()

    def _shape(self) -> None:
        glfw, shape = self._glfw, None
        if self._drag == "line" or (not self._over_panel and self._on_line()):
            shape = glfw.HRESIZE_CURSOR
        elif self._over_panel and imgui.get_mouse_cursor() == imgui.MouseCursor_.text_input:
            shape = glfw.IBEAM_CURSOR
        if shape is not None and shape not in self._cursors:
            self._cursors[shape] = glfw.create_standard_cursor(shape)
        glfw.set_cursor(self._handle, self._cursors.get(shape) if shape is not None else None)

    def _on_line(self) -> bool:
        window = self._window
        return bool(window.overlay.on_line(self._at[0], window.picture_width))

    # callbacks

    def _key(self, _: Any, key: int, __: int, action: int, mods: int) -> None:
        glfw, window = self._glfw, self._window
        window.stir()
        name, io = self._names.get(key, ""), window.io
        down = action != glfw.RELEASE
        if key in self._panel_keys:
            io.add_key_event(self._panel_keys[key], down)
        for modifier, bit in ((imgui.Key.mod_ctrl, 2), (imgui.Key.mod_shift, 1)):
            io.add_key_event(modifier, bool(mods & bit))
        if not down:
            window.viewer.release(name)
        elif not io.want_text_input and not mods & ~1:
            if name == "/" and mods & 1:
                name = "?"
            if action == glfw.PRESS or name in REPEATED:
                window.viewer.key(name, bool(mods & 1))

    def _char(self, _: Any, code: int) -> None:
        self._window.io.add_input_character(code)
        self._window.stir()

    def _button(self, _: Any, button: int, action: int, mods: int) -> None:
        window, viewer = self._window, self._window.viewer
        window.stir()
        down = action == self._glfw.PRESS
        if button >= len(BUTTONS):
            return
        window.io.add_mouse_button_event(button, down)
        name = BUTTONS[button]
        if not down:
            self._drag = None
            viewer.release(name)
            return
        self._drag = "panel" if self._over_panel else "picture"
        if self._drag == "picture" and name == "left" and self._on_line():
            self._drag = "line"
        if self._drag != "picture":
            return
        viewer.button(name)
        now = clocks.perf_counter()
        if name == "left" and not mods:
            if now - self._clicked < DOUBLE:
                viewer.double_click()
                now = -1.0
            self._clicked = now

    def _cursor(self, _: Any, x: float, y: float) -> None:
        window = self._window
        window.stir()
        if (x, y) != self._at and self._drag == "picture":
            self._clicked = -1.0
        self._moved |= (x, y) != self._at
        self._at = (x, y)
        window.io.add_mouse_pos_event(x, y)
        if self._drag == "line":
            window.viewer.wipe.at = min(max(x / max(window.picture_width, 1.0), 0.0), 1.0)
        elif self._drag != "panel":
            density = window.pixels[0] / max(window.size[0], 1)
            window.viewer.cursor(x * density, y * density, self._shifted)

    @property
    def _shifted(self) -> bool:
        glfw = self._glfw
        sides = (glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT)
        return any(glfw.get_key(self._handle, key) == glfw.PRESS for key in sides)

    def _scroll(self, _: Any, x: float, y: float) -> None:
        self._window.stir()
        if self._over_panel:
            self._window.io.add_mouse_wheel_event(x, y)
        else:
            self._window.viewer.wheel(y)

    def _changed(self, *_: Any) -> None:
        self._window.viewer.changed = True
        self._window.stir()

    def _dense(self, *_: Any) -> None:
        self._window.dress()

    def _focus(self, _: Any, focused: int) -> None:
        self._window.io.add_focus_event(bool(focused))
        if not focused:
            self._drag = None
            self._window.viewer.let_go()
        self._window.stir()


def _names(glfw: Any) -> dict[int, str]:
    """Keys by the names that the viewer calls them."""
    names = {getattr(glfw, f"KEY_{c.upper()}"): c for c in "acdefhklpqrsw0"}
    names |= {glfw.KEY_SPACE: "space", glfw.KEY_ESCAPE: "escape", glfw.KEY_HOME: "home"}
    names |= {glfw.KEY_LEFT: "left_arrow", glfw.KEY_RIGHT: "right_arrow", glfw.KEY_TAB: "tab"}
    names |= {glfw.KEY_LEFT_BRACKET: "[", glfw.KEY_RIGHT_BRACKET: "]", glfw.KEY_F1: "f1"}
    names |= {glfw.KEY_MINUS: "-", glfw.KEY_EQUAL: "=", glfw.KEY_COMMA: ",", glfw.KEY_PERIOD: "."}
    names |= {glfw.KEY_LEFT_SHIFT: "left_shift", glfw.KEY_RIGHT_SHIFT: "right_shift"}
    return names | {glfw.KEY_SLASH: "/"}


def _panel_keys(glfw: Any) -> dict[int, Any]:
    """Keys by which a number is typed into the panel."""
    key = imgui.Key
    found = {
        glfw.KEY_ENTER: key.enter, glfw.KEY_KP_ENTER: key.keypad_enter, glfw.KEY_TAB: key.tab,
        glfw.KEY_ESCAPE: key.escape, glfw.KEY_BACKSPACE: key.backspace, glfw.KEY_END: key.end,
        glfw.KEY_DELETE: key.delete, glfw.KEY_LEFT: key.left_arrow, glfw.KEY_HOME: key.home,
        glfw.KEY_RIGHT: key.right_arrow, glfw.KEY_UP: key.up_arrow, glfw.KEY_DOWN: key.down_arrow,
        glfw.KEY_A: key.a, glfw.KEY_C: key.c, glfw.KEY_V: key.v, glfw.KEY_X: key.x,
        glfw.KEY_Z: key.z, glfw.KEY_Y: key.y,
    }  # fmt: skip
    return found
