"""Rows of the panel: a label, a control as wide as there is room, and a way back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from imgui_bundle import imgui

from maths.colour import srgb_decode, srgb_encode
from runtime import gui

LABEL = 96.0  # units from the left to the controls
BACK = 26.0  # units for the way back
NAMED = 76.0  # units of what surrounds a name to unfold
UNDO, PLAY, PAUSE, COPY = "\uf2ea", "\uf04b", "\uf04c", "\uf0c5"


class Parts:
    """What rows have in common. scale : of sizes."""

    def __init__(self, scale: float, bold: Any) -> None:
        self.scale, self._bold = scale, bold

    def section(self, name: str, opened: bool = True) -> bool:
        """Begin a section that may be folded; True where it is open."""
        imgui.separator()
        imgui.push_font(self._bold, gui.TEXT)
        imgui.push_style_var(imgui.StyleVar_.frame_padding, imgui.ImVec2(0, 5 * self.scale))
        flags = imgui.TreeNodeFlags_
        found = imgui.collapsing_header(name, flags.default_open if opened else flags.none)
        imgui.pop_style_var()
        imgui.pop_font()
        return bool(found)

    def check(self, label: str, on: bool) -> bool | None:
        """Return the new state of a small box to tick, None where it stayed."""
        imgui.push_style_var(imgui.StyleVar_.frame_padding, imgui.ImVec2(2, 2) * self.scale)
        changed, found = imgui.checkbox(label, on)
        imgui.pop_style_var()
        return bool(found) if changed else None

    def row(self, label: str, note: str = "") -> None:
        """Begin a row: the next item fills the room beside the label."""
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(label)
        if note:
            tip(note)
        imgui.same_line(LABEL * self.scale)
        imgui.set_next_item_width(-BACK * self.scale)

    def choice(self, label: str, chosen: bool) -> bool:
        """Return whether a small one of several choices is taken now."""
        imgui.push_style_var(imgui.StyleVar_.frame_padding, imgui.ImVec2(2, 2) * self.scale)
        taken = imgui.radio_button(label, chosen)
        imgui.pop_style_var()
        return bool(taken)

    @property
    def room(self) -> float:
        """What a way back takes at the right."""
        return BACK * self.scale

    def beside(self, names: Iterable[str]) -> None:
        """Go on in the same line, right of where the longest of some names to unfold ends."""
        longest = max(imgui.calc_text_size(name).x for name in names)
        imgui.same_line(max(LABEL * self.scale, longest + NAMED * self.scale))

    def back(self, name: str, changed: bool, note: str = "as the scene has it") -> bool:
        """End a row with a way back where something changed; True where it is taken."""
        size = imgui.ImVec2((BACK - 8.0) * self.scale, 0)
        right(size.x)
        if not changed:
            imgui.dummy(size)
            return False
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*gui.ACCENT, 1.0))
        with bare():
            taken = imgui.button(f"{UNDO}##{name}", size)
        imgui.pop_style_color()
        tip(note)
        return bool(taken)

    def slider(
        self, name: str, value: float, low: float, high: float, form: str, log: bool = False
    ) -> float | None:
        """Return the new value of a slider, None where it stayed."""
        flags = imgui.SliderFlags_.logarithmic if log else imgui.SliderFlags_.none
        changed, found = imgui.slider_float(f"##{name}", value, low, high, form, flags)
        if log:
            share = np.log(max(value, low) / low) / np.log(high / low)
        else:
            share = (value - low) / (high - low)
        filled(float(share), self.scale)
        return float(found) if changed else None

    def drag(
        self, name: str, value: float, low: float, high: float, form: str = "%.3g"
    ) -> float | None:
        """Return the new value of a number that may be of any size, None where it stayed."""
        speed = max(abs(value), 1e-3) * 0.01
        changed, found = imgui.drag_float(f"##{name}", value, speed, low, high, form)
        return float(np.clip(found, low, high)) if changed else None

    def swatch(self, name: str, rgb: Sequence[float]) -> list[float] | None:
        """Return the new hue of linear light, its largest channel 1; None where it stayed."""
        shown = np.asarray(srgb_encode(np.clip(np.asarray(rgb, np.float64), 0.0, 1.0)))
        kinds = imgui.ColorEditFlags_
        changed, found = imgui.color_edit3(
            f"##{name}", shown.tolist(), kinds.no_inputs | kinds.no_label | kinds.picker_hue_wheel
        )
        if not changed:
            return None
        linear = np.asarray(srgb_decode(np.clip(np.array(list(found)[:3]), 0.0, 1.0)))
        return [float(each) for each in linear / max(float(linear.max()), 1e-6)]

    def light(
        self, name: str, value: Sequence[float], most: float, form: str = "%.3g"
    ) -> tuple[float, float, float] | None:
        """Edit light (3,) as a hue and its largest channel; the new one, None where it stayed."""
        rgb = np.asarray(value, np.float64)
        top = float(rgb.max())
        hue = rgb / top if top > 0 else np.ones(3)
        new = self.swatch(f"{name} hue", hue.tolist())
        imgui.same_line()
        imgui.set_next_item_width(-BACK * self.scale)
        strength = self.drag(name, top, 0.0, most, form)
        if new is None and strength is None:
            return None
        found = np.asarray(new if new is not None else hue) * (
            top if strength is None else strength
        )
        return float(found[0]), float(found[1]), float(found[2])


def right(width: float) -> None:
    """Go on in the same line with something of `width` at the right edge."""
    imgui.same_line()
    room = imgui.get_content_region_avail().x - width
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))


def filled(share: float, scale: float) -> None:
    """Fill the last item from the left, as far as a slider stands."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    wide = (high.x - low.x) * min(max(share, 0.0), 1.0)
    if wide < 1.0:
        return
    strong = imgui.is_item_active() or imgui.is_item_hovered()
    code = imgui.color_convert_float4_to_u32(imgui.ImVec4(*gui.ACCENT, 0.34 if strong else 0.24))
    ink, right = imgui.get_window_draw_list(), imgui.ImVec2(low.x + wide, high.y)
    ink.push_clip_rect(low, right, True)
    ink.add_rect_filled(low, high, code, 5.0 * scale)
    ink.pop_clip_rect()


@contextmanager
def bare() -> Iterator[None]:
    """Buttons without a ground, until they are under the cursor."""
    imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(0, 0, 0, 0))
    imgui.push_style_var(imgui.StyleVar_.frame_padding, imgui.ImVec2(2, 4))
    yield
    imgui.pop_style_var()
    imgui.pop_style_color()


def tip(text: str) -> None:
    """Say more about the last item where the cursor rests on it."""
    flags = imgui.HoveredFlags_
    if imgui.is_item_hovered(flags.for_tooltip | flags.allow_when_disabled):
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(22 * imgui.get_font_size())
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()
