"""The window: a baked scene, a panel, and hands on both.

glfw and imgui-bundle come with an extra: pip install 'bakelight[view]'.
"""

from __future__ import annotations

import time as clocks
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from formats import interrupts
from runtime import capture, switches, window_open
from runtime.live import Live, Rebuild, nothing
from runtime.live import carry as live_carry
from runtime.pace import Pace
from runtime.pass_history import History
from runtime.player import Player
from runtime.screen import Screen
from runtime.truth import Truth
from runtime.viewer import Viewer, WriteExr

SHADERS = Path(__file__).parent
AWAKE = 0.6  # seconds of frames after the last input, in which the panel comes to rest
STILL = 0.3  # seconds without a change until the truth is traced
SLEEP = 0.25  # seconds between looks at files while nothing moves
FINE = 0.2  # seconds without a change until a coarse picture is drawn in full
STEP = 1 / 60  # seconds between frames of the panel alone, and looks at a tracing
HASTE = 0.05  # seconds a frame in which light among cubes settles
PANEL = 320  # units
LEAST = 480  # units of width below which there is no room for a panel

Tell = Callable[[dict[str, Any]], None]


def view(
    folder: str | Path,
    *,
    size: tuple[int, int] = (960, 540),
    time: float = 0.0,
    pictures: str | Path = ".",
    watched: Callable[[], Iterable[Path]] = nothing,
    rebuild: Callable[[], Rebuild] | None = None,
    truth: Truth | None = None,
    write_exr: WriteExr | None = None,
    tell: Tell | None = None,
    shaders: Path = SHADERS,
) -> None:
    """Open a window on a baked scene and stay until it is closed.

    size : of the picture, where the screen has room. pictures : folder for screenshots. watched,
    rebuild, shaders : see `runtime.live.Live`. truth, write_exr : see `runtime.viewer.Viewer`.
    tell : takes what happens as dicts with `event`: opened, drawn (each time the picture comes to
    rest), said, baking, reloaded, error, closed. Raises MachineError without glfw, imgui-bundle or
    a display.
    """
    glfw = window_open.toolkit()
    capture.prepare()
    handle = window_open.window(glfw, (size[0] + PANEL, size[1]))
    shown: Window | None = None
    live: Live | None = None
    try:
        context = capture.window_context(glfw.get_proc_address)

        def make(baked: Path) -> Player:
            player = Player(baked, size=size, context=context, roaming=True)
            player.haste = HASTE
            return player

        def carry(old: Player, new: Player) -> None:
            live_carry(old, new)
            viewer.apply(viewer.edits, new)

        live = Live(
            make, Path(folder), watched=watched, rebuild=rebuild, carry=carry, shaders=shaders
        )
        viewer = Viewer(
            live.player,
            Path(pictures),
            time=time,
            truth=truth,
            write_exr=write_exr,
            reload=live.reload,
        )
        glfw.set_window_title(handle, f"{live.player.scene.name} - bakelight")
        shown = Window(glfw, handle, context, viewer, live, tell or _print)
        shown.run()
    finally:
        if shown is not None:
            shown.release()
        if live is not None:
            live.close()
        glfw.terminate()


class Window:
    """A glfw window with a picture at the left and the panel at the right."""

    def __init__(
        self, glfw: Any, handle: Any, ctx: Any, viewer: Viewer, live: Live, tell: Tell
    ) -> None:
        # Only a window needs imgui-bundle
        from runtime.window_input import Input

        self._glfw, self._handle, self._ctx, self._tell = glfw, handle, ctx, tell
        self.viewer, self.live, self.history = viewer, live, History()
        self._screen, self._gui = Screen(ctx), None
        self._drawn, self._told = 0, -1
        self._moved = self._awake = self._last = clocks.perf_counter()
        self._shown = self._shows = self._last  # the panel, the picture
        self._unrest = self._stale = False
        self._pace = Pace()
        self._error: str | None = None
        self.size = self.pixels = (0, 0)  # of the window: units, pixels
        self._measure()
        self._dress()
        viewer.say = self._say
        self._input = Input(glfw, handle, self)

    def _dress(self) -> None:
        """Make the panel for the density of the screen that the window is on."""
        from runtime.gui import Gui
        from runtime.overlay import Overlay
        from runtime.panel import Panel

        self._stale = False
        content, _ = self._glfw.get_window_content_scale(self._handle)
        self._scale = window_open.scale(content, self.size, self.pixels)
        if self._gui is not None:
            self._gui.release()
        self._gui: Any = Gui(self._ctx, self._scale)
        self._gui.clipboard(self._glfw, self._handle)
        self._panel = Panel(self.viewer, self.history, self._scale, self._gui.bold)
        self.overlay = Overlay(self.viewer, self._scale, self._gui.bold)

    # what input asks for

    @property
    def io(self) -> Any:
        """Of imgui."""
        return self._gui.io

    def _measure(self) -> None:
        """Take over the window's size in units and in pixels, both of one moment."""
        glfw, before = self._glfw, None
        self.size = glfw.get_window_size(self._handle)
        # Hands resize it between two calls: the ratio of one size to another would be no density
        while before != self.size:
            before = self.size
            self.pixels = glfw.get_framebuffer_size(self._handle)
            self.size = glfw.get_window_size(self._handle)

    @property
    def picture_width(self) -> int:
        """Units from the left that the picture fills."""
        width, _ = self.size
        room = width >= LEAST * self._scale
        return width - round(PANEL * self._scale) if self.viewer.panel and room else width

    def stir(self) -> None:
        """Note input: the panel needs some frames to come to rest."""
        self._awake = clocks.perf_counter() + AWAKE

    def dress(self) -> None:
        """Take over the density of another screen with the next frame."""
        self._stale = self.viewer.changed = True

    # the loop

    def run(self) -> None:
        """Stay until the window is closed."""
        glfw, viewer = self._glfw, self.viewer
        self._tell({"event": "opened", "scene": viewer.player.scene.name, "size": self.size})
        with interrupts.held() as ctrl_c:
            while not (viewer.quitting or ctrl_c.asked or glfw.window_should_close(self._handle)):
                self._wait()
                self._input.check()
                now = clocks.perf_counter()
                self._follow()
                viewer.advance(now - self._last)
                self._last = now
                self._measure()
                if min(self.pixels) > 0 and self._wanted(now):
                    self._frame(now)
        self._tell({"event": "closed"})

    @property
    def _moving(self) -> bool:
        """Whether the next picture will differ from the last."""
        return self.viewer.moving or self.viewer.changed or self._unrest

    @property
    def _coarse(self) -> bool:
        """Whether a finer picture is to come."""
        return bool(self.viewer.player.targets.size != self.viewer.size)

    def _wait(self) -> None:
        """Sleep as long as nothing is to be done."""
        minimised = min(self._glfw.get_framebuffer_size(self._handle)) <= 0
        if self._moving and not minimised:
            self._glfw.poll_events()
        elif not minimised and self._restless(self._last):
            self._glfw.wait_events_timeout(STEP)
        else:
            self._glfw.wait_events_timeout(SLEEP)

    @property
    def _refining(self) -> bool:
        """Whether a finer or a traced picture is to come."""
        return self._coarse or self.viewer.wipe.waiting

    def _restless(self, now: float) -> bool:
        """Whether something is to be drawn soon, if only the panel coming to rest."""
        return now < self._awake or self._refining

    def _follow(self) -> None:
        """Take over what became of edited files."""
        viewer, live = self.viewer, self.live
        if live.poll(viewer.time):
            self.stir()
        if live.player is not viewer.player:
            viewer.take(live.player)
            self._tell({"event": "reloaded"})
        if live.busy and not self.overlay.busy:
            self._tell({"event": "baking"})
        self.overlay.error, self.overlay.busy = live.error, live.busy
        self.overlay.failed = viewer.failed
        error = "\n".join(each for each in (live.error, viewer.failed) if each) or None
        if error != self._error:
            self._error = error
            self._tell({"event": "error", "text": error})

    def _wanted(self, now: float) -> bool:
        """Tell whether something is to be drawn."""
        rests = not (self._moving or self._refining) and now - self._moved >= FINE
        if rests and self._told != self._drawn:
            self._told, size = self._drawn, list(self.viewer.player.targets.size)
            rest = {"frames": self._drawn, "time": self.viewer.time, "size": size}
            self._tell({"event": "drawn", **rest, "gl": self._ctx.error})
        return self._moving or self._restless(now) or self.overlay.outdated(now)

    def _frame(self, now: float) -> None:
        if self._stale:
            self._dress()
        window, pixels = self.size, self.pixels
        viewer, player = self.viewer, self.viewer.player
        wide = round(self.picture_width * pixels[0] / max(window[0], 1))
        size = min(max(1, wide), pixels[0]), pixels[1]
        if size != viewer.size:
            viewer.size, viewer.changed = size, True
        if viewer.changed or viewer.moving:
            self._moved = now
        moving = now - self._moved < FINE
        drawn = self._pace.size(size, moving)
        if player.targets.size == drawn and self._light_first(now):
            player.settle()
        elif self._moving or player.targets.size != drawn:
            self._draw(drawn, moving)
        still = now - self._moved > STILL and not self._unrest
        if viewer.wipe.follow(player, viewer.time, viewer.edits, still):
            self.stir()
        if (picture := viewer.wipe.picture) is not None:
            self._screen.write(picture)
        both = viewer.wipe.mode == "effect" or picture is not None
        divider = viewer.wipe.at if both else 0.0
        screen = self._screen.show(player.targets.texture("picture"), size, pixels, divider)
        self._gui.begin(window, pixels, now - self._shown)
        self._shown = now
        if self.picture_width < window[0]:
            self._panel.draw(self.picture_width, PANEL * self._scale, window[1])
        self.overlay.draw(self.picture_width, window[1], window[0], now)
        self._gui.end(screen)
        self._input.drawn()
        self._glfw.swap_buffers(self._handle)

    def _light_first(self, now: float) -> bool:
        """Whether light should settle for a while, as long as a frame takes, before it is shown."""
        viewer = self.viewer
        if viewer.changed or viewer.moving or not self._unrest:
            return False
        took = 1e-3 * sum(self.history.last.values())
        return now - self._shows < took and not viewer.player.settled

    def _draw(self, size: tuple[int, int], moving: bool) -> None:
        """Draw the picture, and the one that it is compared with, in `size` pixels."""
        viewer, player = self.viewer, self.viewer.player
        viewer.changed = False
        player.targets.resize(size)
        self._draw_other()
        player.draw(viewer.time)
        self._unrest, self._shows = not player.settled, clocks.perf_counter()
        self.history.add(player.targets.milliseconds, player.skipped)
        if self._drawn:
            # The first frame also compiles; rays of light among cubes cost the same at any size
            spent = sum(ms for name, ms in self.history.last.items() if name != "gather")
            self._pace.took(spent, moving)
        self._drawn += 1

    def _draw_other(self) -> None:
        """Draw the frame without an effect, where that is what is compared."""
        viewer, player, effect = self.viewer, self.viewer.player, self.viewer.wipe.effect
        if viewer.wipe.mode != "effect":
            return
        edits = switches.switched(player, viewer.base, viewer.edits, effect, False)
        if edits is None:
            viewer.wipe.choose("off")
            return
        viewer.apply(edits)
        player.draw(viewer.time)
        self._screen.keep(player.targets.target("picture", dtype="f1"))
        viewer.apply(viewer.edits)

    def _say(self, text: str) -> None:
        self.overlay.say(text, clocks.perf_counter())
        self._tell({"event": "said", "text": text})
        self.stir()

    def release(self) -> None:
        """Free what the window made on the card, and stop a tracing."""
        self.viewer.wipe.stop()
        self._screen.release()
        self._gui.release()


def _print(event: dict[str, Any]) -> None:
    if event["event"] in ("said", "error") and event["text"]:
        print(event["text"], flush=True)
