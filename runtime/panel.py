"""The panel at the right: time, camera, lights, picture, what is shown, effects, compare, times."""

from __future__ import annotations

from typing import Any

import numpy as np
from imgui_bundle import imgui

from runtime import gui, panel_scene, switches
from runtime.panel_parts import PAUSE, PLAY, UNDO, Parts, filled, right, tip
from runtime.pass_history import FRAMES, History
from runtime.viewer import Viewer

COLOURS = (
    (0.91, 0.66, 0.34), (0.42, 0.60, 0.72), (0.76, 0.45, 0.38), (0.52, 0.66, 0.47),
    (0.62, 0.52, 0.70), (0.80, 0.76, 0.58), (0.36, 0.48, 0.52), (0.70, 0.58, 0.50),
)  # fmt: skip
"""Of passes in the graph, in turn."""
STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0)
"""Round numbers for the top of the graph."""
COMPARED = {"off": "off", "truth": "truth", "kept": "kept", "effect": "without"}


class Panel:
    """Draws the panel of a viewer.

    history : times of the last frames.
    """

    def __init__(self, viewer: Viewer, history: History, scale: float, bold: Any) -> None:
        self._viewer, self._history = viewer, history
        self._parts, self._bold = Parts(scale, bold), bold

    def draw(self, left: float, width: float, height: float) -> None:
        """Draw it from `left` on, window units."""
        viewer, parts, scale = self._viewer, self._parts, self._parts.scale
        imgui.set_next_window_pos(imgui.ImVec2(left, 0))
        imgui.set_next_window_size(imgui.ImVec2(width, height))
        flags = imgui.WindowFlags_
        fixed = flags.no_title_bar | flags.no_resize | flags.no_move | flags.no_collapse
        imgui.begin("panel", None, fixed | flags.no_saved_settings | flags.no_nav)
        self._title()
        self._time()
        if parts.section("Camera"):
            panel_scene.camera(parts, viewer)
        if parts.section("Lights"):
            panel_scene.lights(parts, viewer)
        if parts.section("Picture"):
            panel_scene.picture(parts, viewer)
        if parts.section("Shown", opened=False):
            panel_scene.shown(parts, viewer)
        if parts.section("Effects", opened=False):
            panel_scene.effects(parts, viewer)
        if parts.section("Compare", opened=False):
            self._compare()
        if parts.section("Times", opened=False):
            self._times()
        imgui.dummy(imgui.ImVec2(0, 8 * scale))
        imgui.end()

    def _title(self) -> None:
        viewer = self._viewer
        imgui.push_font(self._bold, gui.HEADING)
        imgui.text_unformatted(viewer.player.scene.name)
        imgui.pop_font()
        changed = viewer.edits != type(viewer.edits)()
        if changed:
            label = f"{UNDO} undo all"
            right(imgui.calc_text_size(label).x + 2 * imgui.get_style().frame_padding.x)
            if imgui.small_button(label):
                viewer.edit(type(viewer.edits)())
            tip("everything as the scene's file has it")
        width, height = viewer.player.targets.size
        spent = self._history.usual
        imgui.push_font(None, gui.SMALL)
        took = f"{spent:.1f} ms" if spent < 1000 else f"{spent / 1000:.1f} s"
        imgui.text_disabled(f"{width} x {height}     {took}     F1 lists the keys")
        imgui.pop_font()

    def _time(self) -> None:
        viewer, scale = self._viewer, self._parts.scale
        duration = viewer.player.scene.time.duration
        if duration <= 0:
            return
        size = imgui.ImVec2(34 * scale, 0)
        if imgui.button(f"{PAUSE if viewer.playing else PLAY}##play", size):
            viewer.key("space")
            viewer.release("space")
        tip("pause (space)" if viewer.playing else "play (space)")
        imgui.same_line()
        imgui.set_next_item_width(-1)
        changed, time = imgui.slider_float("##time", viewer.time, 0.0, duration, "%.2f s")
        filled(viewer.time / duration, scale)
        if changed:
            viewer.seek(min(time, duration * (1 - 1e-6)))

    def _compare(self) -> None:
        viewer, parts = self._viewer, self._parts
        wipe = viewer.wipe
        free = [s for s in switches.switches(viewer.player, viewer.base, viewer.edits) if s.free]
        names = [switch.name for switch in free]
        for mode, label in COMPARED.items():
            there = mode in wipe.modes
            imgui.begin_disabled(not there)
            if parts.choice(label, wipe.mode == mode):
                wipe.choose(mode)
                viewer.changed = True
            imgui.end_disabled()
            if mode == "kept" and not there:
                tip("K keeps the picture")
            imgui.same_line()
        imgui.new_line()
        if wipe.effect in names:
            parts.row("effect", "the picture left of the line goes without it")
            at = names.index(wipe.effect)
            changed, at = imgui.combo("##effect", at, [switch.label for switch in free])
            if changed:
                wipe.effect = names[at]
                wipe.choose("effect")
                viewer.changed = True

    # times

    def _times(self) -> None:
        history, scale = self._history, self._parts.scale
        names = history.names
        colours = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
        self._graph(colours, imgui.ImVec2(imgui.get_content_region_avail().x, 72 * scale))
        mean, last = history.mean(), history.last
        for name in names:
            self._chip(colours[name])
            imgui.text_unformatted(name.replace("_", " "))
            spent = f"{last[name]:.2f} ms" if name in last else f"({mean[name]:.2f} ms)"
            tip("in brackets: not in the last frame; its mean over the frames of the graph")
            right(imgui.calc_text_size(spent).x)
            imgui.text_disabled(spent)
        profile = self._viewer.player.profile
        imgui.push_font(None, gui.SMALL)
        imgui.push_text_wrap_pos(0.0)
        imgui.text_disabled(
            f"{profile['programs']} programs, {profile['textures']} textures, "
            f"{profile['bytes'] / 1e6:.0f} MB, {profile['draw_calls']} draws\n"
            f"{profile['timing']}\n{profile['renderer']}"
        )
        imgui.pop_text_wrap_pos()
        imgui.pop_font()

    def _graph(self, colours: dict[str, tuple[float, float, float]], size: Any) -> None:
        """Draw a bar a frame, its passes on one another, the newest at the right."""
        corner, ink = imgui.get_cursor_screen_pos(), imgui.get_window_draw_list()
        far = imgui.ImVec2(corner.x + size.x, corner.y + size.y)
        ink.add_rect_filled(corner, far, _code(gui.RAISED), 5.0 * self._parts.scale)
        top = _round_up(self._history.most)
        step = size.x / FRAMES
        first = FRAMES - len(self._history.frames)
        codes = {name: _code(colour) for name, colour in colours.items()}
        for i, frame in enumerate(self._history.frames, start=first):
            low = far.y
            for name, spent in frame.items():
                high = max(low - size.y * spent / top, corner.y)
                left = corner.x + i * step
                ink.add_rect_filled(
                    imgui.ImVec2(left, high),
                    imgui.ImVec2(left + max(step - 0.5, 0.5), low),
                    codes.get(name, 0),
                )
                low = high
        place = imgui.ImVec2(corner.x + 6, corner.y + 3)
        imgui.push_font(None, gui.SMALL)
        ink.add_text(place, _code(gui.DIM), f"{top:g} ms")
        imgui.pop_font()
        imgui.dummy(size)

    def _chip(self, colour: tuple[float, float, float]) -> None:
        side = 8 * self._parts.scale
        at, line = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
        low = imgui.ImVec2(at.x, at.y + 0.5 * (line - side))
        high = imgui.ImVec2(low.x + side, low.y + side)
        imgui.get_window_draw_list().add_rect_filled(low, high, _code(colour), 2.0)
        imgui.dummy(imgui.ImVec2(side, line))
        imgui.same_line()


def _code(colour: tuple[float, ...]) -> int:
    full = (*colour, 1.0)[:4] if len(colour) == 3 else colour
    return int(imgui.color_convert_float4_to_u32(imgui.ImVec4(*full)))


def _round_up(most: float) -> float:
    """Return the next of 1, 1.5, 2, 3, 5, 7, 10 ... that is not below.

    >>> [_round_up(most) for most in (0.0, 3.2, 16.6)]
    [1.0, 5.0, 20.0]
    """
    if most <= 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(most))
    return float(next(power * each for each in STEPS if power * each >= most))
