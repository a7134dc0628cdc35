"""What hands do to a player: look around, play, light, focus, compare, take pictures.

No window here: `runtime.window` hands over keys, buttons and pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from formats.errors import BakelightError
from formats.files import image
from runtime import orbit, subject, switches
from runtime.camera import Camera
from runtime.edits import Edits
from runtime.player import Player
from runtime.wipe import Truth, Wipe

HELP = (
    ("left drag", "orbit"),
    ("middle or shift drag", "pan"),
    ("wheel", "come nearer, go farther"),
    ("right drag", "look round"),
    ("W A S D  Q E", "fly, shift faster"),
    ("F", "frame all that is there"),
    ("double click or C", "focus under the cursor"),
    (", .", "focus nearer, farther"),
    ("space", "play, pause"),
    ("left right  Home", "a frame, shift a second; to the start"),
    ("L drag  [ ] - =", "move the sun"),
    ("Tab", "compare: truth, kept picture, without an effect"),
    ("K", "keep this picture to compare with"),
    ("P", "take a picture, shift an EXR"),
    ("R", "reload the scene"),
    ("0", "back to the scene's own view"),
    ("H", "hide or show the panel"),
    ("F1 or ?", "this list"),
    ("Esc", "quit"),
)
TURN = np.radians(5.0)  # of the sun a key
FEELING = 0.006  # radians a pixel of drag
SPEED = 0.7  # of flying: distances to the target a second
FASTER = 4.0
FLIGHT = {"d": (1, 0, 0), "a": (-1, 0, 0), "e": (0, 1, 0), "q": (0, -1, 0), "w": (0, 0, 1)}
FLIGHT["s"] = (0, 0, -1)
NO_LENS = "this scene calls for no lens: add camera.lens and bake it again"
WriteExr = Callable[[Path, Any], None]


class Viewer:
    """The state behind the window.

    player : of the scene. pictures : folder for screenshots. say : where messages go. truth :
    traces what is seen, None where nothing can. write_exr : writes (path, radiance (h, w, 3)), None
    where nothing can. reload : reads the scene's files again, given the time shown; None where
    there are none. edits : what hands changed of the scene; set them
    by `edit`. size : of the whole picture, pixels: while things move a window may draw fewer.
    failed : one line on why the last key could not do what it is for, None where it could.
    """

    def __init__(
        self,
        player: Player,
        pictures: Path,
        say: Callable[[str], None] = print,
        time: float = 0.0,
        *,
        truth: Truth | None = None,
        write_exr: WriteExr | None = None,
        reload: Callable[[float], None] | None = None,
    ) -> None:
        self.player, self.pictures, self.say = player, pictures, say
        self.time, self.start = time, time
        self.playing = self.quitting = self.helping = False
        self.changed = self.panel = True
        self.size = player.targets.size
        self.edits = Edits()
        self.failed: str | None = None
        self.wipe = Wipe(truth)
        self._write_exr, self._reload = write_exr, reload
        self._held: set[str] = set()
        self._cursor = (0.0, 0.0)
        self._choose_effect()

    @property
    def base(self) -> Any:
        """The scene as its file has it."""
        return self.player.own

    @property
    def camera(self) -> Camera:
        """The camera that the next frame looks through."""
        return self.player.camera or Camera.of_scene(self.player.scene, self.time)

    @camera.setter
    def camera(self, camera: Camera) -> None:
        self.player.camera = camera
        self.changed = True

    def take(self, player: Player) -> None:
        """Go on with another player, such as one of a scene read again; edits stay."""
        self.player = player
        self._choose_effect()
        self.edit(self.edits)

    def edit(self, edits: Edits) -> None:
        """Show the scene with these changes."""
        self.edits = edits
        self.apply(edits)
        self.changed = True

    def apply(self, edits: Edits, player: Player | None = None) -> None:
        """Let the player, or one that may take its place, draw these changes."""
        player = player or self.player
        player.change(edits.of(player.own), hidden=edits.hidden, off=edits.off)

    def _choose_effect(self) -> None:
        """Let there be an effect to compare without."""
        found = switches.switches(self.player, self.base, self.edits)
        names = [switch.name for switch in found if switch.free]
        if self.wipe.effect not in names:
            self.wipe.effect = names[-1] if names else ""

    # handlers: names of keys and buttons, pixels of the picture

    def key(self, name: str, shift: bool = False) -> None:
        """React to a key that goes down."""
        self._held.add(name)
        action = self._actions(shift).get(name)
        if action:
            self.failed, self.changed = None, True
            try:
                action()
            except (BakelightError, OSError) as error:
                # Such as a picture on a full disk
                self.failed = _line(error)

    def release(self, name: str) -> None:
        """React to a key or button that comes up."""
        self._held.discard(name)

    def let_go(self) -> None:
        """Hold nothing any more: the window lost the keyboard."""
        self._held.clear()

    def button(self, name: str) -> None:
        """React to a mouse button (left, middle, right) that goes down."""
        self._held.add(name)

    def double_click(self) -> None:
        """React to a double click at the cursor."""
        self.focus_cursor()
        self.changed = True

    def cursor(self, x: float, y: float, shift: bool = False) -> None:
        """React to the mouse at pixel (x, y), y down."""
        dx, dy = x - self._cursor[0], y - self._cursor[1]
        self._cursor = (x, y)
        height = self.size[1]
        if "left" in self._held and "l" in self._held:
            self.turn_sun(FEELING * dx, -FEELING * dy)
        elif "middle" in self._held or ("left" in self._held and shift):
            self.camera = orbit.pan(self.camera, -dx / height, dy / height)
        elif "left" in self._held:
            self.camera = orbit.orbit(self.camera, -FEELING * dx, FEELING * dy)
        elif "right" in self._held:
            self.camera = orbit.look(self.camera, -FEELING * dx, -FEELING * dy)

    def wheel(self, steps: float) -> None:
        """React to the wheel: towards the target for positive steps."""
        self.camera = orbit.dolly(self.camera, steps)

    def _actions(self, shift: bool) -> dict[str, Callable[[], None]]:
        rate = self.player.scene.time.frame_rate
        step = 1.0 if shift else 1.0 / rate
        return {
            "space": lambda: self._toggle("playing"),
            "left_arrow": lambda: self.seek(self.time - step),
            "right_arrow": lambda: self.seek(self.time + step),
            "home": lambda: self.seek(0.0),
            "[": lambda: self.turn_sun(-TURN, 0.0),
            "]": lambda: self.turn_sun(TURN, 0.0),
            "-": lambda: self.turn_sun(0.0, -TURN),
            "=": lambda: self.turn_sun(0.0, TURN),
            "f": self.frame,
            "c": self.focus_cursor,
            ",": lambda: self.focus_by(1 / 1.05),
            ".": lambda: self.focus_by(1.05),
            "r": self.reload,
            "0": self.reset,
            "p": self.radiance if shift else self.screenshot,
            "k": self.keep,
            "tab": self.wipe.next,
            "h": lambda: self._toggle("panel"),
            "f1": lambda: self._toggle("helping"),
            "?": lambda: self._toggle("helping"),
            "escape": self._escape,
        }

    def _toggle(self, name: str) -> None:
        setattr(self, name, not getattr(self, name))

    def _escape(self) -> None:
        self.quitting, self.helping = not self.helping, False

    # what they do

    def seek(self, time: float) -> None:
        """Go to a time, round the end of the animation to its start."""
        duration = self.player.scene.time.duration
        self.time = time % duration if duration > 0 else 0.0
        self.changed = True

    def turn_sun(self, azimuth: float, elevation: float) -> None:
        """Turn the first sun, radians."""
        a, e = self.player.sun_turn
        self.player.sun_turn = (a + azimuth, e + elevation)
        self.changed = True

    def frame(self) -> None:
        """Look from the same side at all that is shown, focused on its middle."""
        found = subject.points(self.player, self.time)
        if not len(found):
            self.say("there is nothing to frame")
            return
        camera = orbit.frame(self.camera, found, self.size[0] / self.size[1])
        distance = float(np.linalg.norm(camera.target - camera.position))
        self.camera = orbit.focus(camera, distance) if self.has_lens else camera

    def focus_cursor(self) -> None:
        """Focus on what is under the cursor, and turn about it from now on."""
        if self.changed:
            # The depth below is that of the last frame
            self.player.draw(self.time)
        drawn = self.player.targets.size
        at = (c * d / s for c, d, s in zip(self._cursor, drawn, self.size, strict=True))
        distance = subject.distance(self.player, *at)
        if distance is None:
            self.say("there is nothing under the cursor")
            return
        self.camera = orbit.hold(self.camera, distance)
        if self.has_lens:
            self._focus(distance)
        else:
            self.say(f"turning about what is {distance:.2f} m away")

    def focus_by(self, factor: float) -> None:
        """Move the plane of focus by a factor."""
        if self.has_lens:
            self._focus((self.camera.focus_distance or 1.0) * factor)
        else:
            self.say(NO_LENS)

    @property
    def has_lens(self) -> bool:
        """Whether anything here blurs by the lens."""
        blurs = {"depth_of_field", "defocus"}.intersection(self.player.called)
        return bool(blurs) and self.camera.focus_distance is not None

    def _focus(self, distance: float) -> None:
        self.camera = orbit.focus(self.camera, distance)
        self.say(f"focus at {self.camera.focus_distance:.2f} m")

    def reset(self) -> None:
        """Go back to the scene's own camera, sun and first moment."""
        self.player.camera, self.player.sun_turn = None, (0.0, 0.0)
        self.time, self.playing = self.start, False
        self.changed = True

    def reload(self) -> None:
        """Read the scene's files again."""
        if self._reload is None:
            self.say("nothing to reload: a baked folder alone has no scene file")
        else:
            self._reload(self.time)

    def keep(self) -> None:
        """Keep the picture to compare with."""
        self.player.targets.resize(self.size)
        self.wipe.keep(self.player.frame(self.time))
        self.say("kept: drag the line to compare with what comes")

    # pictures

    def screenshot(self) -> Path:
        """Write the frame as a PNG file of the next free number; return its path."""
        path = self._free(".png")
        self.player.targets.resize(self.size)
        image.write(path, self.player.frame(self.time)[..., :3])
        self.say(f"picture {path}")
        return path

    def radiance(self) -> None:
        """Write scene-linear radiance as an EXR file of the next free number."""
        if self._write_exr is None:
            self.say("nothing here writes EXR: use bakelight view, or render")
            return
        path = self._free(".exr")
        self.player.targets.resize(self.size)
        self._write_exr(path, self.player.linear(self.time)[..., :3])
        self.say(f"picture {path}")

    def _free(self, suffix: str) -> Path:
        name = self.player.scene.name
        self.pictures.mkdir(parents=True, exist_ok=True)
        taken = {p.name for p in self.pictures.glob(f"{name}-*{suffix}")}
        free = next(n for n in range(1, 10**6) if f"{name}-{n:04}{suffix}" not in taken)
        return self.pictures / f"{name}-{free:04}{suffix}"

    # time

    def advance(self, seconds: float) -> None:
        """Let time pass where the scene plays, and fly while keys are held."""
        if self.playing:
            self.seek(self.time + seconds)
        way = np.sum([FLIGHT[k] for k in self._held & FLIGHT.keys()] or [(0, 0, 0)], axis=0)
        if way.any():
            camera = self.camera
            metres = SPEED * seconds * float(np.linalg.norm(camera.position - camera.target))
            if self._held & {"left_shift", "right_shift"}:
                metres *= FASTER
            self.camera = orbit.fly(camera, *(metres * way).tolist())

    @property
    def moving(self) -> bool:
        """Whether time passes or the camera flies."""
        return self.playing or bool(self._held & FLIGHT.keys())


def _line(error: Exception) -> str:
    """Say in a line what a key met on the machine."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error).replace("\n", " ")
