"""A small window on a baked scene: look around, play, move the sun, focus, take pictures.

The only module that imports glfw (an extra: pip install 'bakelight[view]').
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from formats.errors import MachineError
from formats.files import image
from runtime import capture, orbit
from runtime.camera import Camera
from runtime.player import Player

HELP = """\
left drag orbit, middle or shift drag pan, wheel dolly
space play or pause, arrows one frame, shift arrows one second, home to the start
hold L and drag to move the sun, or [ ] round and - = up and down
F focus on the middle, , . focus nearer and farther
R reset, P picture, H this help, Esc quit"""
TURN = np.radians(5.0)  # of the sun a key
FEELING = 0.006  # radians a pixel of drag


class Viewer:
    """The state behind the window, moved by the handlers; `view` owns the window itself.

    player : of the scene. pictures : folder for screenshots. say : where messages go.
    """

    def __init__(
        self, player: Player, pictures: Path, say: Callable[[str], None] = print, time: float = 0.0
    ) -> None:
        self.player, self.pictures, self.say = player, pictures, say
        self.time, self.start = time, time
        self.playing = self.quitting = False
        self.changed = True
        self._held: set[str] = set()
        self._cursor = (0.0, 0.0)

    @property
    def camera(self) -> Camera:
        """The camera that the next frame looks through."""
        return self.player.camera or Camera.of_scene(self.player.scene, self.time)

    @camera.setter
    def camera(self, camera: Camera) -> None:
        self.player.camera = camera
        self.changed = True

    # handlers: names of keys and buttons, pixels

    def key(self, name: str, shift: bool = False) -> None:
        """React to a key that goes down."""
        self._held.add(name)
        action = self._actions(shift).get(name)
        if action:
            action()
            self.changed = True

    def release(self, name: str) -> None:
        """React to a key or button that comes up."""
        self._held.discard(name)

    def button(self, name: str) -> None:
        """React to a mouse button (left, middle, right) that goes down."""
        self._held.add(name)

    def cursor(self, x: float, y: float, shift: bool = False) -> None:
        """React to the mouse at pixel (x, y), y down."""
        dx, dy = x - self._cursor[0], y - self._cursor[1]
        self._cursor = (x, y)
        height = self.player.targets.size[1]
        if "left" in self._held and "l" in self._held:
            self.turn_sun(FEELING * dx, -FEELING * dy)
        elif "middle" in self._held or ("left" in self._held and shift):
            self.camera = orbit.pan(self.camera, -dx / height, dy / height)
        elif "left" in self._held:
            self.camera = orbit.orbit(self.camera, -FEELING * dx, FEELING * dy)

    def wheel(self, steps: float) -> None:
        """React to the wheel: towards the target for positive steps."""
        self.camera = orbit.dolly(self.camera, steps)

    def _actions(self, shift: bool) -> dict[str, Callable[[], None]]:
        rate = self.player.scene.time.frame_rate
        step = 1.0 if shift else 1.0 / rate
        return {
            "space": lambda: setattr(self, "playing", not self.playing),
            "left_arrow": lambda: self.seek(self.time - step),
            "right_arrow": lambda: self.seek(self.time + step),
            "home": lambda: self.seek(0.0),
            "[": lambda: self.turn_sun(-TURN, 0.0),
            "]": lambda: self.turn_sun(TURN, 0.0),
            "-": lambda: self.turn_sun(0.0, -TURN),
            "=": lambda: self.turn_sun(0.0, TURN),
            "f": self.focus_centre,
            ",": lambda: self.focus_by(1 / 1.05),
            ".": lambda: self.focus_by(1.05),
            "r": self.reset,
            "p": self.screenshot,
            "h": lambda: self.say(HELP),
            "escape": lambda: setattr(self, "quitting", True),
        }

    # what they do

    def seek(self, time: float) -> None:
        """Go to a time, round the end of the animation to its start."""
        duration = self.player.scene.time.duration
        self.time = time % duration if duration > 0 else 0.0

    def turn_sun(self, azimuth: float, elevation: float) -> None:
        """Turn the first sun, radians."""
        a, e = self.player.sun_turn
        self.player.sun_turn = (a + azimuth, e + elevation)
        self.changed = True

    def focus_centre(self) -> None:
        """Focus on what stands in the middle of the picture."""
        sets = [
            np.column_stack([s.positions, s.crown * s.scale, s.asset.height * s.scale])
            for s in self.player.sprites
        ]
        ground = self.player.scene.ground.height if self.player.scene.ground else None
        self._focus(orbit.distance_at_centre(self.camera, sets, ground))

    def focus_by(self, factor: float) -> None:
        """Move the plane of focus by a factor."""
        self._focus((self.camera.focus_distance or 1.0) * factor)

    def _focus(self, distance: float) -> None:
        if "depth_of_field" not in self.player.called:
            self.say("this scene calls for no lens: add camera.lens and bake it again")
            return
        self.camera = orbit.focus(self.camera, distance)
        self.say(f"focus at {self.camera.focus_distance:.2f} m")

    def reset(self) -> None:
        """Go back to the scene's own camera, sun and first moment."""
        self.player.camera, self.player.sun_turn = None, (0.0, 0.0)
        self.time, self.playing = self.start, False

    def screenshot(self) -> Path:
        """Write the frame as a PNG file of the next free number; return its path."""
        name = self.player.scene.name
        self.pictures.mkdir(parents=True, exist_ok=True)
        taken = {p.name for p in self.pictures.glob(f"{name}-*.png")}
        free = next(n for n in range(1, 10**6) if f"{name}-{n:04}.png" not in taken)
        path = self.pictures / f"{name}-{free:04}.png"
        image.write(path, self.player.frame(self.time)[..., :3])
        self.say(f"picture {path}")
        return path

    def advance(self, seconds: float) -> None:
        """Let time pass where the scene plays."""
        if self.playing:
            self.seek(self.time + seconds)
            self.changed = True


def view(
    folder: str | Path,
    *,
    size: tuple[int, int] = (960, 540),
    time: float = 0.0,
    pictures: str | Path = ".",
) -> None:
    """Open a window on a baked scene and stay until it is closed.

    pictures : folder for screenshots. Raises MachineError without glfw or a display.
    """
    glfw = _glfw()
    capture.prepare()
    window = _window(glfw, size)
    try:
        context = capture.window_context(glfw.get_proc_address)
        with Player(
            folder, size=glfw.get_framebuffer_size(window), context=context, roaming=True
        ) as player:
            glfw.set_window_title(window, f"{player.scene.name} - bakelight")
            viewer = Viewer(player, Path(pictures), _say, time)
            _connect(glfw, window, viewer)
            _say(HELP)
            _loop(glfw, window, viewer)
    finally:
        glfw.terminate()


def _loop(glfw: Any, window: Any, viewer: Viewer) -> None:
    player = viewer.player
    last = clock.perf_counter()
    while not (viewer.quitting or glfw.window_should_close(window)):
        # Sleep while nothing moves
        if viewer.playing or viewer.changed:
            glfw.poll_events()
        else:
            glfw.wait_events_timeout(0.25)
        now = clock.perf_counter()
        viewer.advance(now - last)
        last = now
        if viewer.changed:
            viewer.changed = False
            player.draw(viewer.time)
            player.ctx.copy_framebuffer(player.ctx.screen, player.targets.target("picture"))
            glfw.swap_buffers(window)


def _glfw() -> Any:
    try:
        import glfw
    except ImportError:
        remedy = "pip install 'bakelight[view]', or render without a window: bakelight render"
        raise MachineError("window", "glfw", "not installed", remedy) from None
    # Errors come back as values; a warning for each would bury the one line that helps
    glfw.ERROR_REPORTING = "ignore"
    if not glfw.init():
        remedy = "run it where DISPLAY or WAYLAND_DISPLAY is set, or use bakelight render"
        raise MachineError("window", "display", "none", remedy)
    return glfw


def _window(glfw: Any, size: tuple[int, int]) -> Any:
    for hint, value in (
        (glfw.CONTEXT_VERSION_MAJOR, 3),
        (glfw.CONTEXT_VERSION_MINOR, 3),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
        (glfw.OPENGL_FORWARD_COMPAT, True),
    ):
        glfw.window_hint(hint, value)
    window = glfw.create_window(*size, "bakelight", None, None)
    if not window:
        glfw.terminate()
        raise MachineError("window", "OpenGL 3.3", "none", capture.REMEDY)
    glfw.make_context_current(window)
    glfw.swap_interval(1)
    return window


def _connect(glfw: Any, window: Any, viewer: Viewer) -> None:
    names = {getattr(glfw, f"KEY_{c.upper()}"): c for c in "fhlpr"}
    names |= {glfw.KEY_SPACE: "space", glfw.KEY_ESCAPE: "escape", glfw.KEY_HOME: "home"}
    names |= {glfw.KEY_LEFT: "left_arrow", glfw.KEY_RIGHT: "right_arrow"}
    names |= {glfw.KEY_LEFT_BRACKET: "[", glfw.KEY_RIGHT_BRACKET: "]"}
    names |= {glfw.KEY_MINUS: "-", glfw.KEY_EQUAL: "=", glfw.KEY_COMMA: ",", glfw.KEY_PERIOD: "."}
    buttons = {glfw.MOUSE_BUTTON_LEFT: "left", glfw.MOUSE_BUTTON_MIDDLE: "middle"}

    def shifted() -> bool:
        sides = (glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT)
        return any(glfw.get_key(window, key) == glfw.PRESS for key in sides)

    def on_key(_: Any, key: int, __: int, action: int, ___: int) -> None:
        if action == glfw.RELEASE:
            viewer.release(names.get(key, ""))
        else:
            viewer.key(names.get(key, ""), shifted())

    def on_button(_: Any, button: int, action: int, __: int) -> None:
        act = viewer.release if action == glfw.RELEASE else viewer.button
        act(buttons.get(button, ""))

    def on_resize(_: Any, width: int, height: int) -> None:
        if width > 0 and height > 0:
            viewer.player.targets.resize((width, height))
            viewer.changed = True

    def on_refresh(_: Any) -> None:
        viewer.changed = True

    glfw.set_key_callback(window, on_key)
    glfw.set_mouse_button_callback(window, on_button)
    glfw.set_cursor_pos_callback(window, lambda _, x, y: viewer.cursor(x, y, shifted()))
    glfw.set_scroll_callback(window, lambda _, __, steps: viewer.wheel(steps))
    glfw.set_framebuffer_size_callback(window, on_resize)
    glfw.set_window_refresh_callback(window, on_refresh)


def _say(text: str) -> None:
    print(text, flush=True)
