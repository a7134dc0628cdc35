"""How a window comes to be: glfw, imgui-bundle, a display, and a size that fits it."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from formats.errors import MachineError
from runtime import capture

REMEDY = "pip install 'bakelight[view]', or render without a window: bakelight render"


def toolkit() -> Any:
    """Return glfw, ready for windows. MachineError where it, imgui-bundle or a display lacks."""
    # imgui-bundle before glfw, or two libglfw get loaded
    found = {}
    for package, module in (("imgui-bundle", "imgui_bundle"), ("glfw", "glfw")):
        try:
            found[package] = import_module(module)
        except ImportError:
            raise MachineError("window", package, "not installed", REMEDY) from None
    glfw: Any = found["glfw"]
    # Errors come back as values; a warning for each would bury the one line that helps
    glfw.ERROR_REPORTING = "ignore"
    if not glfw.init():
        remedy = "run it where DISPLAY or WAYLAND_DISPLAY is set, or use bakelight render"
        raise MachineError("window", "display", "none", remedy)
    return glfw


def window(glfw: Any, size: tuple[int, int]) -> Any:
    """Return a window of `size`, its OpenGL context current; smaller where the screen is."""
    for hint, value in (
        (glfw.CONTEXT_VERSION_MAJOR, 3),
        (glfw.CONTEXT_VERSION_MINOR, 3),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
        (glfw.OPENGL_FORWARD_COMPAT, True),
        (glfw.SCALE_TO_MONITOR, True),
    ):
        glfw.window_hint(hint, value)
    wide, high = size
    if (monitor := glfw.get_primary_monitor()) is not None:
        _, _, most_wide, most_high = glfw.get_monitor_workarea(monitor)
        wide, high = min(wide, most_wide or wide), min(high, most_high or high)
    handle = glfw.create_window(wide, high, "bakelight", None, None)
    if not handle:
        glfw.terminate()
        raise MachineError("window", "OpenGL 3.3", "none", capture.REMEDY)
    glfw.make_context_current(handle)
    glfw.swap_interval(1)
    return handle


def scale(content: float, size: tuple[int, int], pixels: tuple[int, int]) -> float:
    """Return window units a unit of the panel: 2 where a dense screen counts pixels.

    content : scale of the screen.  size, pixels : of the window, in units and in pixels.
    """
    return max(1.0, round(4 * content * max(size[0], 1) / max(pixels[0], 1)) / 4)
