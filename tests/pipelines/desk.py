"""A virtual desk: an X server without a screen, a window manager, hands, and windows on scenes."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ImageGrab, features

Event = dict[str, Any]
TOOLS = ("Xvfb", "openbox", "xdotool")
PATIENCE = 120.0  # seconds until a test gives up: machines may be busy
SCREEN = (1000, 700)
WORDS = 50  # rows
SMALL = (320, 200)
VIEW = f"""
import json, sys
from runtime.window import view
view(sys.argv[1], size={SMALL}, tell=lambda event: print(json.dumps(event), flush=True))
"""


def require() -> None:
    """Skip the test where something is not installed, by name."""
    for tool in TOOLS:
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")
    for package in ("imgui_bundle", "glfw"):
        pytest.importorskip(package)
    if not features.check("xcb"):
        pytest.skip("Pillow takes no screenshots here: it was made without xcb")


@contextmanager
def desk() -> Iterator[Desk]:
    """Give an X display of its own with openbox on it."""
    require()
    read, write = os.pipe()
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    screen = "{}x{}x24".format(*SCREEN)
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", screen, "-nolisten", "tcp"],
        pass_fds=(write,),
        **quiet,
    )
    os.close(write)
    with os.fdopen(read) as stream:
        name = ":" + stream.readline().strip()
    made = Desk(name)
    manager = subprocess.Popen(["openbox", "--sm-disable"], env=made.environment, **quiet)
    try:
        # A window manager that is there says so on the root window
        wait_until(lambda: made.hand("get_desktop", check=False) == "0", "openbox did not start")
        yield made
    finally:
        for process in (manager, server):
            process.terminate()
            process.wait(timeout=20)


def wait_until(condition: Callable[[], Any], what: str, seconds: float = PATIENCE) -> Any:
    """Return what a condition gives as soon as that is something; fail after a while."""
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, what
        time.sleep(0.02)
    return found


class Desk:
    """A display by its name."""

    def __init__(self, name: str) -> None:
        self.name = name
        gone = ("WAYLAND_DISPLAY", "XDG_SESSION_TYPE")
        self.environment = {k: v for k, v in os.environ.items() if k not in gone}
        self.environment |= {"DISPLAY": name}

    def hand(self, *words: object, check: bool = True) -> str:
        """Do something with xdotool; return what it says."""
        command = ["xdotool", *(str(word) for word in words)]
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True)
        assert not check or done.returncode == 0, done.stderr
        return done.stdout.strip()

    def shot(self) -> NDArray[np.int16]:
        """Return the screen (h, w, 3), 0..255."""
        return np.asarray(ImageGrab.grab(xdisplay=self.name).convert("RGB"), np.int16)

    def window(self, scene: Path, build: Path, cwd: Path) -> Opened:
        """Open `bakelight view --json` on a scene and wait for a picture, at rest or not."""
        options = ["--json", "--size", "320x300", "--build", str(build), "--jobs", "1"]
        words = ["-m", "pipelines.cli", "view", str(scene), *options]
        return self._window(words, scene.stem, cwd)

    def baked(self, folder: Path, name: str) -> Opened:
        """Open a window on a baked folder, whatever the code was that baked it."""
        return self._window(["-c", VIEW, str(folder)], name, Path.cwd())

    @contextmanager
    def _window(self, words: list[str], name: str, cwd: Path) -> Iterator[Seen]:
        seen = Seen(self, words, cwd)
        try:
            seen.wait("opened")
            seen.find(name)
            wait_until(lambda: seen.shot()[:, :100].any(), "no picture")
            yield seen
        finally:
            seen.kill()


Opened = AbstractContextManager["Seen"]


class Seen:
    """A running window: what it tells, what it shows, and hands on it."""

    def __init__(self, desk: Desk, words: list[str], cwd: Path) -> None:
        self._desk = desk
        self.process = subprocess.Popen(
            [sys.executable, *words],
            cwd=cwd,
            env=desk.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.events: list[Event] = []
        self.errors: list[str] = []
        self._threads = [threading.Thread(target=read) for read in (self._listen, self._complain)]
        for thread in self._threads:
            thread.start()
        self.id = ""

    def _listen(self) -> None:
        for line in self.process.stdout or ():
            self.events.append(json.loads(line) | {"number": len(self.events)})

    def _complain(self) -> None:
        for line in self.process.stderr or ():
            self.errors.append(line)

    # what it tells

    def wait(self, event: str, after: int = 0, **said: Any) -> Event:
        """Return the first such event from number `after` on; `said` may hold functions."""

        def fits(found: Event) -> bool:
            return found["event"] == event and all(
                value(found[key]) if callable(value) else found[key] == value
                for key, value in said.items()
            )

        def look() -> Event | None:
            found = next((e for e in self.events[after:] if fits(e)), None)
            if found is None:
                assert self.process.poll() is None, "".join(self.errors)
            return found

        found: Event = wait_until(look, f"no {event} {said}; {self.events[after:]}")
        assert found.get("gl", "GL_NO_ERROR") == "GL_NO_ERROR"
        return found

    @contextmanager
    def drawing(self, **said: Any) -> Iterator[None]:
        """Do something, then wait until the window has drawn and come to rest."""
        before = self.events[-1:]
        count = len(self.events)
        frames = max((e["frames"] for e in self.events if e["event"] == "drawn"), default=0)
        yield
        assert self.events[count - 1 : count] == before
        self.wait("drawn", count, frames=lambda n: n > frames, **said)

    # hands

    def find(self, name: str) -> None:
        """Find the window by its title, and put the mouse on the picture."""
        title = f"^{name} - bakelight$"
        search = ("search", "--onlyvisible", "--name", title)
        self.id = wait_until(lambda: self._desk.hand(*search, check=False), "no window")
        self.hand("windowactivate", "--sync", self.id)

    def hand(self, *words: object) -> str:
        """Do something with xdotool."""
        return self._desk.hand(*words)

    def move(self, x: float, y: float) -> None:
        """Put the mouse on a pixel of the window."""
        self.hand("mousemove", "--window", self.id, round(x), round(y))

    def key(self, *names: str) -> None:
        """Press keys one after the other."""
        self.hand("key", *names)

    def click(self, x: float, y: float) -> None:
        """Press and release the left button on a pixel of the window."""
        self.move(x, y)
        # Down for more than a frame, as a finger is
        self.hand("mousedown", 1, "sleep", 0.1, "mouseup", 1)

    def drag(self, start: tuple[int, int], end: tuple[int, int], button: int = 1) -> None:
        """Drag from a pixel of the window to another.

        A button that goes down holds the mouse until the window manager has looked at it. Where
        that takes long, X merges all moves of that time into the last: the drag has to arrive.
        """
        self.move(*start)
        x, y = self._mouse()
        arrived = (x + end[0] - start[0], y + end[1] - start[1])
        self.hand("mousedown", button)
        self.move(*end)
        wait_until(lambda: self._mouse() == arrived, f"the mouse does not come to {arrived}")
        self.hand("mouseup", button)

    def _mouse(self) -> tuple[int, int]:
        """Where the mouse is on the screen."""
        said = self.hand("getmouselocation", "--shell")
        place = dict(line.split("=") for line in said.splitlines())
        return int(place["X"]), int(place["Y"])

    # what it shows

    @property
    def size(self) -> tuple[int, int]:
        """Of the window, pixels."""
        said = self.hand("getwindowgeometry", "--shell", self.id).splitlines()
        found = dict(line.split("=") for line in said)
        return int(found["WIDTH"]), int(found["HEIGHT"])

    def shot(self) -> NDArray[np.int16]:
        """Return what the screen shows of the window (h, w, 3), the mouse out of the way."""
        self.move(0, 0)
        x, y = self._mouse()
        width, height = self.size
        return self._desk.shot()[y : y + height, x : x + width]

    def picture(self) -> NDArray[np.int16]:
        """Return what the screen shows of the scene, over the rows where words come up."""
        drawn = (e["size"] for e in reversed(self.events) if e["event"] == "drawn")
        size = next(drawn, SMALL)
        return self.shot()[: size[1] - WORDS, : size[0]]

    # ends

    def end(self) -> tuple[int, str]:
        """Wait until the process has ended; return its exit code and what it complained of."""
        code = self.process.wait(timeout=PATIENCE)
        for thread in self._threads:
            thread.join(timeout=PATIENCE)
        return code, "".join(self.errors)

    def interrupt(self) -> None:
        """Press Ctrl-C in the terminal."""
        self.process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """End it in any case."""
        self.process.kill()
        self.end()
        for stream in (self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()
