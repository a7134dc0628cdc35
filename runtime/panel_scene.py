"""Sections of the panel on the scene: camera, lights, picture, what is shown, effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from imgui_bundle import imgui

from formats.meshes import EFFECTS
from runtime import orbit, switches
from runtime.edits import EMITTED, PLACES, Knob, LightEdit, knobs
from runtime.panel_parts import COPY, Parts, tip
from runtime.viewer import Viewer

NARROW = 512.0
"""Widest range of a slider; other numbers are dragged."""
OPEN = 2
"""Lights up to which all are unfolded."""


def camera(parts: Parts, viewer: Viewer) -> None:
    """Lens and place of the camera."""
    now = viewer.camera
    lens = viewer.has_lens
    millimetres = 1e3 * now.focal_length
    parts.row("focal length", "of the camera, for a sensor of its height")
    if (new := parts.slider("focal", millimetres, 10.0, 300.0, "%.0f mm", log=True)) is not None:
        viewer.camera = replace(now, focal_length=new * 1e-3)
    if lens and now.f_number is not None and now.focus_distance is not None:
        parts.row("aperture", "focal length over the width of the opening: less blurs more")
        if (new := parts.slider("f", now.f_number, 0.5, 64.0, "f/%.2g", log=True)) is not None:
            viewer.camera = replace(now, f_number=new)
        parts.row("focus", "distance of the plane of focus; double click on what is to be sharp")
        least = 1.05 * now.focal_length
        new = parts.slider("focus", now.focus_distance, max(least, 0.05), 100.0, "%.2f m", log=True)
        if new is not None:
            viewer.camera = orbit.focus(now, new)
    half = imgui.ImVec2(0.5 * (imgui.get_content_region_avail().x - 8 * parts.scale), 0)
    if imgui.button(f"{COPY}  copy as TOML", half):
        imgui.set_clipboard_text(orbit.as_toml(viewer.camera))
        viewer.say("copied: [camera] for the scene file")
    tip(orbit.as_toml(now))
    imgui.same_line()
    with_own = viewer.player.camera is None and viewer.player.sun_turn == (0.0, 0.0)
    imgui.begin_disabled(with_own)
    if imgui.button("the scene's own", half):
        viewer.reset()
    imgui.end_disabled()


def lights(parts: Parts, viewer: Viewer) -> None:
    """Every light and lamp, and those that the plan left out."""
    base, edits = viewer.base, viewer.edits
    lamps = base.voxels.lamps if base.voxels is not None else ()
    unfolded = len(base.lights) + len(lamps) <= OPEN
    names = _names(base.lights), _names(lamps)
    for lamp, found in ((False, base.lights), (True, lamps)):
        kept = edits.lamps if lamp else edits.lights
        for i, light in enumerate(found):
            name = names[lamp][i]
            imgui.push_id(f"{lamp} {i}")
            edit = kept.get(i, LightEdit())
            new = _light(parts, viewer, light, (name, *names[0], *names[1]), edit, unfolded)
            if new != edit:
                viewer.edit(viewer.edits.light(i, new, lamp))
            imgui.pop_id()
    for light in viewer.player.plan.get("lights", []):
        if not light["kept"]:
            imgui.text_disabled(f"{light['type']}, left out")
            tip(light["reason"])


def _names(found: Any) -> list[str]:
    """Name lights by their type, with a number where several are of one."""
    kinds = [getattr(light, "type", "lamp") for light in found]
    return [
        kind if kinds.count(kind) == 1 else f"{kind} {kinds[: i + 1].count(kind)}"
        for i, kind in enumerate(kinds)
    ]


def _light(
    parts: Parts,
    viewer: Viewer,
    light: Any,
    names: tuple[str, ...],
    edit: LightEdit,
    unfolded: bool,
) -> LightEdit:
    """Draw a light, the first of `names`, and return what hands change of it."""
    kind = getattr(light, "type", "lamp")
    if (on := parts.check("##on", edit.on)) is not None:
        edit = replace(edit, on=on)
    imgui.same_line()
    flags = imgui.TreeNodeFlags_
    kinds = flags.default_open if unfolded else flags.none
    imgui.push_style_var(imgui.StyleVar_.frame_padding, imgui.ImVec2(0, 4 * parts.scale))
    opened = imgui.tree_node_ex(names[0], kinds | flags.frame_padding | flags.span_label_width)
    imgui.pop_style_var()
    keyed = getattr(light, EMITTED.get(kind, "radiance"))
    emitted = np.asarray(keyed.at(viewer.time), np.float64)
    if not emitted.any():
        # Out at this moment
        emitted = np.asarray(keyed.extremes[1], np.float64)
    hue = np.broadcast_to(emitted, (3,)) / max(float(emitted.max()), 1e-9)
    parts.beside(names)
    if (new := parts.swatch("hue", (hue * edit.tint).tolist())) is not None:
        tint = np.asarray(new) / np.maximum(hue, 1e-3)
        edit = replace(edit, tint=(float(tint[0]), float(tint[1]), float(tint[2])))
    imgui.same_line()
    imgui.set_next_item_width(-parts.room)
    if (new := parts.slider("factor", edit.factor, 0.01, 100.0, "x %.2f", log=True)) is not None:
        edit = replace(edit, factor=new)
    tip(f"{EMITTED.get(kind, 'radiance')} of the file times this")
    if parts.back("light", edit != LightEdit()):
        edit = LightEdit()
    if not opened:
        return edit
    edit = _turn(parts, kind, edit)
    if kind not in ("sun", "environment"):
        edit = _move(parts, viewer, light, kind, edit)
    imgui.tree_pop()
    return edit


def _turn(parts: Parts, kind: str, edit: LightEdit) -> LightEdit:
    turn = [float(np.degrees(each)) for each in edit.turn]
    names = {"sun": ("azimuth", "elevation"), "environment": ("turn",)}.get(kind, ())
    for i, name in enumerate(names):
        parts.row(name, "degrees added to the file's")
        most = 90.0 if i else 180.0
        if (new := parts.slider(name, turn[i], -most, most, "%+.0f deg")) is not None:
            turn[i] = new
            edit = replace(edit, turn=(float(np.radians(turn[0])), float(np.radians(turn[1]))))
    return edit


def _move(parts: Parts, viewer: Viewer, light: Any, kind: str, edit: LightEdit) -> LightEdit:
    place = getattr(light, PLACES.get(kind, "position")).at(viewer.time)
    parts.row("position", "metres; what moves is shifted")
    shown = (np.asarray(place) + edit.move).tolist()
    changed, found = imgui.drag_float3("##place", shown, 0.01, 0.0, 0.0, "%.2f")
    if changed:
        move = np.array(list(found)[:3]) - place
        edit = replace(edit, move=(float(move[0]), float(move[1]), float(move[2])))
    return edit


def picture(parts: Parts, viewer: Viewer) -> None:
    """Every number, colour and choice of what finishes the picture."""
    for table, found in knobs(viewer.player.scene.picture, viewer.time).items():
        called = table in viewer.player.called
        imgui.push_id(table)
        imgui.dummy(imgui.ImVec2(0, 0))
        imgui.text_unformatted(table.replace("_", " "))
        if not called:
            imgui.same_line()
            imgui.text_disabled("left out")
        imgui.begin_disabled(not called)
        for knob in found:
            new = _knob(parts, knob)
            if new is not None:
                viewer.edit(viewer.edits.value(knob.path, knob.set(new)))
            if parts.back(knob.path, knob.path in viewer.edits.values):
                viewer.edit(viewer.edits.value(knob.path, None))
        imgui.end_disabled()
        imgui.pop_id()


def _knob(parts: Parts, knob: Knob) -> Any:
    spec, value = knob.spec, knob.value
    note = f"{spec.doc}{f', {spec.unit}' if spec.unit else ''}"
    parts.row(knob.label, note if knob.keyed is None or knob.keyed.constant else f"{note}; moves")
    if spec.kind == "text":
        at = spec.choices.index(value)
        changed, at = imgui.combo("##choice", at, list(spec.choices))
        return spec.choices[at] if changed else None
    if spec.kind == "integer":
        changed, found = imgui.slider_int(f"##{knob.path}", value, int(spec.low), int(spec.high))
        return found if changed else None
    if spec.kind == "flag":
        return parts.check(f"##{knob.path}", value)
    if np.size(value) == 3:
        return parts.light(knob.path, value, spec.high)
    if np.size(value) == 2:
        changed, pair = imgui.slider_float2(
            f"##{knob.path}", list(value), spec.low, spec.high, "%.2f"
        )
        return list(pair)[:2] if changed else None
    if spec.unit == "EV":
        return parts.slider(knob.path, float(value), -8.0, 8.0, "%+.2f EV")
    if spec.high - spec.low <= NARROW:
        return parts.slider(knob.path, float(value), spec.low, spec.high, "%.3g")
    return parts.drag(knob.path, float(value), spec.low, spec.high)


def shown(parts: Parts, viewer: Viewer) -> None:
    """What stands in the scene, and what casts a shadow."""
    base = viewer.base
    rows = [
        (f"mesh/{m.name}", m.name, m.shadow is not None and "occlusion" in viewer.player.called)
        for m in base.meshes
        if EFFECTS[m.lighting] in viewer.player.called
    ]
    rows += [(f"billboard/{b.name}", b.name, bool(b.shadow)) for b in base.billboards]
    rows += [(f"billboard/particles/{p.name}", p.name, False) for p in base.particles]
    casts = any(shadow for _, _, shadow in rows)
    for key, name, shadow in rows:
        _shown(parts, viewer, key, name)
        if casts and shadow:
            imgui.same_line(imgui.get_window_width() - 110 * parts.scale)
            _shown(parts, viewer, f"shadow/{name}", "shadow")


def _shown(parts: Parts, viewer: Viewer, key: str, name: str) -> None:
    if (on := parts.check(f"{name}##{key}", key not in viewer.edits.hidden)) is not None:
        viewer.edit(viewer.edits.show(key, on))


def effects(parts: Parts, viewer: Viewer) -> None:
    """Every effect of the plan: what is on, what may go, what was left out and why."""
    every = switches.switches(viewer.player, viewer.base, viewer.edits)
    called, others = ([s for s in every if s.called is way] for way in (True, False))
    _switches(parts, viewer, called)
    if others:
        imgui.dummy(imgui.ImVec2(0, 0))
        imgui.text_disabled("left out by the plan")
        _switches(parts, viewer, others)


def _switches(parts: Parts, viewer: Viewer, found: list[switches.Switch]) -> None:
    """Two in a row."""
    half = 0.5 * imgui.get_content_region_avail().x + imgui.get_cursor_pos_x()
    for i, switch in enumerate(found):
        if i % 2:
            imgui.same_line(half)
        imgui.begin_disabled(not switch.free)
        on = parts.check(switch.label, switch.on)
        tip(switch.why if switch.free or not switch.called else f"{switch.why}; others need it")
        imgui.end_disabled()
        if on is not None:
            player, edits = viewer.player, viewer.edits
            viewer.edit(switches.switched(player, viewer.base, edits, switch.name, on) or edits)
