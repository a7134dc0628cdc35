"""imgui drawn by moderngl: context, look, input, and what it shows put on the screen.

The only modules that import imgui_bundle are this one and the panel's (an extra:
pip install 'bakelight[view]'). Import this one before glfw, or two libglfw get loaded.
"""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import imgui_bundle
import moderngl
import numpy as np
from imgui_bundle import imgui

from runtime.shader import Programs, set_uniforms

HERE = Path(__file__).parent
FONTS = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
TEXT, HEADING, SMALL = 15.0, 20.0, 12.5
STRIDE = 20  # bytes of a vertex: position 2f, place 2f, colour 4 bytes

INK, DIM, ACCENT = (0.87, 0.88, 0.90), (0.53, 0.55, 0.60), (0.91, 0.66, 0.34)
GROUND, RAISED, LIFTED = (0.082, 0.086, 0.102), (0.137, 0.145, 0.169), (0.19, 0.20, 0.235)
WARNING = (0.45, 0.13, 0.11)


class Gui:
    """One imgui context on one moderngl context.

    scale : of sizes and text, 1 on a screen of ordinary density.
    """

    def __init__(self, ctx: Any, scale: float = 1.0) -> None:
        self._ctx = ctx
        self._context = imgui.create_context()
        self.io = imgui.get_io()
        self.io.set_ini_filename("")
        self.io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
        limit = int(ctx.info["GL_MAX_TEXTURE_SIZE"])
        platform = imgui.get_platform_io()
        platform.renderer_texture_max_width = platform.renderer_texture_max_height = limit
        self.scale = scale
        self.bold = _fonts(self.io)
        _look(scale)
        self._programs = Programs(ctx)
        self._program = self._programs.get(HERE / "gui.vert", HERE / "gui.frag")
        self._textures: dict[int, Any] = {}
        self._vertices = self._indices = self._array = None

    def clipboard(self, glfw: Any, handle: Any) -> None:
        """Copy and paste by the clipboard of a window."""

        def get(_: Any) -> str:
            return (glfw.get_clipboard_string(handle) or b"").decode(errors="replace")

        platform = imgui.get_platform_io()
        platform.platform_get_clipboard_text_fn = get
        platform.platform_set_clipboard_text_fn = lambda _, text: glfw.set_clipboard_string(
            handle, text
        )

    # a frame

    def begin(self, size: tuple[int, int], pixels: tuple[int, int], seconds: float) -> None:
        """Begin a frame of a window of `size` units and `pixels`, `seconds` after the last."""
        self.io.display_size = imgui.ImVec2(*size)
        density = [p / max(s, 1) for p, s in zip(pixels, size, strict=True)]
        self.io.display_framebuffer_scale = imgui.ImVec2(*density)
        self.io.delta_time = max(seconds, 1e-4)
        imgui.new_frame()

    def end(self, target: Any) -> None:
        """Draw what was asked for since `begin` over a framebuffer."""
        imgui.render()
        data = imgui.get_draw_data()
        for texture in imgui.get_platform_io().textures:
            if texture.status != imgui.ImTextureStatus.ok:
                self._update(texture)
        width, height = data.display_size
        if width <= 0 or height <= 0:
            return
        target.use()
        self._ctx.enable_only(moderngl.BLEND)
        self._ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        set_uniforms(self._program, {"window": (width, height), "glyphs": 0})
        data.scale_clip_rects(data.framebuffer_scale)
        try:
            for commands in data.cmd_lists:
                self._draw(target, commands)
        finally:
            target.scissor = None

    def _draw(self, target: Any, commands: Any) -> None:
        vertices = _bytes(commands.vtx_buffer, STRIDE)
        indices = _bytes(commands.idx_buffer, imgui.INDEX_SIZE)
        if not vertices or not indices:
            return
        array = self._filled(vertices, indices)
        bottom = target.height
        for command in commands.cmd_buffer:
            left, top, right, low = (int(side) for side in command.clip_rect)
            left, top = max(left, 0), max(top, 0)
            if right <= left or low <= top or not command.elem_count:
                continue
            target.scissor = left, bottom - low, right - left, low - top
            self._textures[command.tex_ref.get_tex_id()].use(0)
            array.render(moderngl.TRIANGLES, vertices=command.elem_count, first=command.idx_offset)

    def _filled(self, vertices: bytes, indices: bytes) -> Any:
        """Return a vertex array of these bytes; its buffers only grow."""
        grown = False
        for name, data in (("_vertices", vertices), ("_indices", indices)):
            buffer = getattr(self, name)
            if buffer is None or buffer.size < len(data):
                if buffer is not None:
                    buffer.release()
                buffer = self._ctx.buffer(reserve=2 * len(data), dynamic=True)
                setattr(self, name, buffer)
                grown = True
            else:
                buffer.orphan()
            buffer.write(data)
        if grown:
            if self._array is not None:
                self._array.release()
            content = [(self._vertices, "2f 2f 4f1", "position", "place", "colour")]
            self._array = self._ctx.vertex_array(
                self._program, content, self._indices, index_element_size=imgui.INDEX_SIZE
            )
        return self._array

    def _update(self, texture: Any) -> None:
        """Make, change or free a texture of glyphs as imgui asks."""
        status = imgui.ImTextureStatus
        if texture.status == status.want_create:
            made = self._ctx.texture((texture.width, texture.height), 4, texture.get_pixels_array())
            made.repeat_x = made.repeat_y = False
            self._textures[made.glo] = made
            texture.set_tex_id(made.glo)
            texture.set_status(status.ok)
        elif texture.status == status.want_updates:
            size = texture.height, texture.width, 4
            pixels = np.asarray(texture.get_pixels_array()).reshape(size)
            made = self._textures[texture.tex_id]
            for r in texture.updates:
                part = np.ascontiguousarray(pixels[r.y : r.y + r.h, r.x : r.x + r.w])
                made.write(part.tobytes(), viewport=(r.x, r.y, r.w, r.h))
            texture.set_status(status.ok)
        elif texture.status == status.want_destroy:
            self._textures.pop(texture.tex_id).release()
            texture.set_tex_id(0)
            texture.set_status(status.destroyed)

    @property
    def objects(self) -> int:
        """Things that it holds on the card."""
        parts = (self._program, self._vertices, self._indices, self._array)
        return len(self._textures) + sum(part is not None for part in parts)

    def release(self) -> None:
        """Free what it made."""
        for made in (*self._textures.values(), self._array, self._vertices, self._indices):
            if made is not None:
                made.release()
        for texture in imgui.get_platform_io().textures:
            texture.set_tex_id(0)
            texture.set_status(imgui.ImTextureStatus.destroyed)
        self._programs.release()
        imgui.destroy_context(self._context)


def _bytes(buffer: Any, stride: int) -> bytes:
    return ctypes.string_at(buffer.data_address(), buffer.size() * stride) if buffer.size() else b""


def _fonts(io: Any) -> Any:
    """Load the fonts; returns the bold one."""
    io.fonts.add_font_from_file_ttf(str(FONTS / "Roboto" / "Roboto-Regular.ttf"), TEXT)
    merged = imgui.ImFontConfig()
    merged.merge_mode = True
    merged.glyph_min_advance_x = TEXT
    icons = str(FONTS / "Font_Awesome_6_Free-Solid-900.otf")
    io.fonts.add_font_from_file_ttf(icons, TEXT - 2.0, merged)
    return io.fonts.add_font_from_file_ttf(str(FONTS / "Roboto" / "Roboto-Bold.ttf"), TEXT)


def _look(scale: float) -> None:
    """Set sizes and colours: dark and quiet, one warm accent."""
    style = imgui.get_style()
    imgui.style_colors_dark(style)
    style.window_padding, style.frame_padding = imgui.ImVec2(16, 14), imgui.ImVec2(8, 4)
    style.item_spacing, style.item_inner_spacing = imgui.ImVec2(8, 6), imgui.ImVec2(6, 4)
    style.window_rounding = style.window_border_size = style.child_border_size = 0.0
    style.frame_rounding = style.grab_rounding = style.scrollbar_rounding = 5.0
    style.popup_rounding, style.popup_border_size = 8.0, 0.0
    style.scrollbar_size, style.grab_min_size = 10.0, 12.0
    style.separator_text_border_size, style.indent_spacing = 1.0, 12.0
    style.disabled_alpha = 0.42
    style.hover_delay_normal, style.hover_stationary_delay = 0.35, 0.08
    kinds = imgui.Col_
    colours = {
        kinds.text: INK, kinds.text_disabled: DIM, kinds.window_bg: GROUND,
        kinds.popup_bg: (*RAISED, 0.98), kinds.frame_bg: RAISED, kinds.frame_bg_hovered: LIFTED,
        kinds.frame_bg_active: LIFTED, kinds.button: RAISED, kinds.button_hovered: LIFTED,
        kinds.button_active: (*ACCENT, 0.5), kinds.header: (*GROUND, 0.0),
        kinds.header_hovered: RAISED, kinds.header_active: LIFTED, kinds.check_mark: ACCENT,
        kinds.checkbox_selected_bg: RAISED, kinds.slider_grab: (*ACCENT, 0.0),
        kinds.slider_grab_active: (*ACCENT, 0.0), kinds.separator: RAISED,
        kinds.scrollbar_bg: GROUND,
        kinds.scrollbar_grab: LIFTED, kinds.scrollbar_grab_hovered: DIM,
        kinds.scrollbar_grab_active: DIM, kinds.text_selected_bg: (*ACCENT, 0.35),
        kinds.border: (*LIFTED, 0.6), kinds.nav_cursor: (*ACCENT, 0.0),
    }  # fmt: skip
    for kind, colour in colours.items():
        style.set_color_(kind, imgui.ImVec4(*colour, *(1.0,) * (4 - len(colour))))
    style.scale_all_sizes(scale)
    style.font_scale_dpi = scale
