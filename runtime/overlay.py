"""What lies over the picture: errors, a bake under way, words, keys, the line of a comparison."""

from __future__ import annotations

from typing import Any

from imgui_bundle import imgui

from runtime import gui
from runtime.viewer import HELP, Viewer

GRIP = 14.0  # units about the line by which it is taken


class Overlay:
    """Draws over a picture of `width` by `height` window units.

    error, busy : as `runtime.live.Live` has them. failed : as `runtime.viewer.Viewer` has it.
    seconds : that a word stays.
    """

    seconds = 3.0

    def __init__(self, viewer: Viewer, scale: float, bold: Any) -> None:
        self._viewer, self._scale, self._bold = viewer, scale, bold
        self.error: str | None = None
        self.failed: str | None = None
        self.busy: str | None = None
        self._word, self._until = "", 0.0

    def say(self, text: str, now: float) -> None:
        """Show a word for a while."""
        self._word, self._until = text, now + self.seconds

    def outdated(self, now: float) -> bool:
        """Whether a word that was drawn has had its time."""
        return bool(self._word) and now >= self._until

    def draw(self, width: float, height: float, window: float, now: float) -> None:
        """Draw all that there is, at `now` seconds. window : its width."""
        if self._viewer.wipe.mode != "off":
            self._line(width, height)
        if self.error or self.failed:
            self._banner(width)
        if self.outdated(now):
            self._word = ""
        bottom = height - 14 * self._scale
        for text in (word for word in (self.busy, self._word) if word):
            bottom -= self._pill(text, 14 * self._scale, bottom) + 8 * self._scale
        if self._viewer.helping:
            self._help(window, height)

    def on_line(self, x: float, width: float) -> bool:
        """Tell whether the line of a comparison is taken at `x`."""
        wipe = self._viewer.wipe
        return wipe.mode != "off" and abs(x - wipe.at * width) < GRIP * self._scale

    @staticmethod
    def _flags() -> int:
        flags = imgui.WindowFlags_
        return int(
            flags.no_decoration
            | flags.no_saved_settings
            | flags.no_nav
            | flags.no_move
            | flags.no_focus_on_appearing
            | flags.always_auto_resize
        )

    def _banner(self, width: float) -> None:
        imgui.set_next_window_pos(imgui.ImVec2(0, 0))
        wide = imgui.ImVec2(width, 0)
        imgui.set_next_window_size_constraints(wide, imgui.ImVec2(width, 1e4))
        imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(*gui.WARNING, 0.94))
        imgui.begin("error", None, self._flags())
        imgui.push_text_wrap_pos(width - 20 * self._scale)
        for error in (self.error, self.failed):
            if error:
                imgui.text_unformatted(error)
        if self.error:
            imgui.push_font(None, gui.SMALL)
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(1, 1, 1, 0.6))
            imgui.text_unformatted("The last good picture stays. Mend the file, or R tries again.")
            imgui.pop_style_color()
            imgui.pop_font()
        imgui.pop_text_wrap_pos()
        imgui.end()
        imgui.pop_style_color()

    def _pill(
        self,
        text: str,
        left: float,
        bottom: float,
        right: bool = False,
        ink: tuple[float, ...] = gui.INK,
    ) -> float:
        """Draw words on a dark ground up from `bottom`; returns its height.

        right : they end at `left`.
        """
        draw, pad = imgui.get_background_draw_list(), 8 * self._scale
        size = imgui.calc_text_size(text)
        if right:
            left -= size.x + 2 * pad
        low = imgui.ImVec2(left, bottom - size.y - pad)
        high = imgui.ImVec2(left + size.x + 2 * pad, bottom)
        draw.add_rect_filled(low, high, _code((*gui.GROUND, 0.82)), 6 * self._scale)
        draw.add_text(imgui.ImVec2(left + pad, low.y + 0.5 * pad), _code((*ink, 1.0)), text)
        return float(high.y - low.y)

    def _line(self, width: float, height: float) -> None:
        wipe, ink, scale = self._viewer.wipe, imgui.get_background_draw_list(), self._scale
        x = wipe.at * width
        ink.add_line(
            imgui.ImVec2(x, 0), imgui.ImVec2(x, height), _code((1, 1, 1, 0.85)), 1.5 * scale
        )
        middle, white = 0.5 * height, _code((1, 1, 1, 0.95))
        ink.add_circle_filled(imgui.ImVec2(x, middle), 11 * scale, _code((*gui.GROUND, 0.9)))
        ink.add_circle(imgui.ImVec2(x, middle), 11 * scale, white, 0, 1.5 * scale)
        for side in (-1, 1):
            tip, back = x + side * 7 * scale, x + side * 3 * scale
            ink.add_triangle_filled(
                imgui.ImVec2(tip, middle),
                imgui.ImVec2(back, middle - 4 * scale),
                imgui.ImVec2(back, middle + 4 * scale),
                white,
            )
        top = 44 * scale
        self._pill(wipe.label, x - 12 * scale, top, right=True)
        self._pill("live", x + 12 * scale, top)
        for note in wipe.notes:
            top += 30 * scale
            self._pill(note, x - 12 * scale, top, right=True, ink=gui.DIM)

    def _help(self, width: float, height: float) -> None:
        middle = imgui.ImVec2(0.5 * width, 0.5 * height)
        imgui.set_next_window_pos(middle, imgui.Cond_.always, imgui.ImVec2(0.5, 0.5))
        imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(*gui.RAISED, 0.98))
        imgui.push_style_var(imgui.StyleVar_.window_rounding, 10 * self._scale)
        imgui.push_style_var(imgui.StyleVar_.window_padding, imgui.ImVec2(22, 18))
        imgui.begin("keys", None, self._flags())
        imgui.push_font(self._bold, gui.HEADING)
        imgui.text_unformatted("Keys")
        imgui.pop_font()
        imgui.dummy(imgui.ImVec2(0, 2 * self._scale))
        for keys, what in HELP:
            imgui.text_colored(imgui.ImVec4(*gui.ACCENT, 1.0), keys)
            imgui.same_line(200 * self._scale)
            imgui.text_unformatted(what)
        imgui.end()
        imgui.pop_style_var(2)
        imgui.pop_style_color()


def _code(colour: tuple[float, ...]) -> int:
    return int(imgui.color_convert_float4_to_u32(imgui.ImVec4(*colour)))
