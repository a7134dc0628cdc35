"""A player that follows its files: shaders, scene and sources; a broken edit leaves the last one.

Files are looked at four times a second and taken when they have been at rest for a moment, since
editors write in steps. What changed leads to a new player beside the old one, on the same context;
only when it has drawn a frame is the old one closed, so both are on the card for that long.
"""

from __future__ import annotations

import re
import time as clocks
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from formats.errors import BakelightError
from runtime import shader
from runtime.player import Player

SHADERS = Path(__file__).parent
INTERVAL = 0.25  # seconds between looks at the files
REST = 0.2  # seconds without a change until an edit counts as whole
GONE = 1.5  # seconds until a file that is not there counts as deleted: some editors rename
_PLACE = re.compile(r"^.*?([\w.-]+\.(?:frag|vert|glsl):\d+\b.*)$", re.M)

Print = tuple[int, int, int] | None


@dataclass(frozen=True)
class Step:
    """Where a bake is. busy : what it does, None when it has ended. error : why it failed, one
    line. folder : the baked scene, None where it failed or goes on."""

    busy: str | None = None
    error: str | None = None
    folder: Path | None = None


class Rebuild(Protocol):
    """A bake beside the window; made to be started, asked often, and stopped at any time."""

    def poll(self) -> Step:
        """Return where it is; costs next to nothing."""

    def close(self) -> None:
        """Stop it if it runs still."""


def nothing() -> tuple[Path, ...]:
    """No files."""
    return ()


def carry(old: Player, new: Player) -> None:
    """Give a new player what hands did to the old one: size, camera, sun, reuse."""
    new.targets.resize(old.targets.size)
    new.camera, new.sun_turn, new.reuse = old.camera, old.sun_turn, old.reuse


class Live:
    """The last good player, and what is to be said of the edits since.

    make : gives a player of a baked folder, on a context that is current whenever `poll` and
    `reload` are called. watched : the files that a bake depends on, asked again after each bake;
    a change of one starts `rebuild`. carry : takes what must survive from the old player to the
    new one. shaders : the folder whose .frag, .vert and .glsl files are followed. clock : seconds.
    Raises what `make` raises for the first player.
    """

    def __init__(
        self,
        make: Callable[[Path], Player],
        folder: Path,
        *,
        watched: Callable[[], Iterable[Path]] = nothing,
        rebuild: Callable[[], Rebuild] | None = None,
        carry: Callable[[Player, Player], None] = carry,
        shaders: Path = SHADERS,
        clock: Callable[[], float] = clocks.perf_counter,
    ) -> None:
        self._make, self._folder, self._watched = make, folder, watched
        self._rebuild, self._carry, self._clock = rebuild, carry, clock
        self._paths = tuple(watched())
        self._shaders = _Files(lambda: _shader_files(shaders))
        self._sources = _Files(lambda: self._paths)
        self._baking: Rebuild | None = None
        self._errors: dict[str, str] = {}
        self._looked = clock()
        self.busy: str | None = None
        self.reloads = 0
        self.player = make(folder)

    @property
    def error(self) -> str | None:
        """What is wrong with the latest edits, a line each; None where all is well."""
        return "\n".join(self._errors.values()) or None

    def poll(self, time: float = 0.0) -> bool:
        """Look whether files changed or a bake went on; True where something to show changed.

        time : seconds, of the frame by which a new player is tried.
        """
        before = self.error, self.busy, self.reloads
        now = self._clock()
        if now - self._looked >= INTERVAL:
            self._looked = now
            if self._sources.changed(now) and self._rebuild:
                self._bake()
            if self._shaders.changed(now):
                self._renew(time)
        if self._baking:
            self._follow(self._baking.poll(), time)
        return before != (self.error, self.busy, self.reloads)

    def reload(self, time: float = 0.0) -> None:
        """Take everything anew, as if all files had changed."""
        self._sources.take()
        self._shaders.take()
        if self._rebuild:
            self._bake()
        else:
            self._renew(time)

    def close(self) -> None:
        """Stop a bake and free the player."""
        self._stop()
        self.player.close()

    # bakes

    def _bake(self) -> None:
        self._stop()
        if self._rebuild:
            self._baking, self.busy = self._rebuild(), "baking"

    def _stop(self) -> None:
        if self._baking:
            self._baking.close()
        self._baking, self.busy = None, None

    def _follow(self, step: Step, time: float) -> None:
        self.busy = step.busy
        if step.busy is not None:
            return
        self._stop()
        self._errors.pop("bake", None)
        if step.error is not None:
            self._errors["bake"] = step.error
        if step.folder is not None:
            self._folder = step.folder
            # Other files may be named now; what changed during the bake still counts as changed
            self._paths = tuple(self._watched())
            self._sources.listed_anew()
            self._renew(time)

    # players

    def _renew(self, time: float) -> None:
        """Put a new player in the place of the old one, if it can draw."""
        shader.forget()
        new: Player | None = None
        try:
            new = self._make(self._folder)
            self._carry(self.player, new)
            _try(new, time)
        except Exception as error:  # an edit can break anything
            if new is not None:
                new.close()
            self._errors["player"] = told(error)
            return
        self._errors.pop("player", None)
        self.player.close()
        self.player = new
        self.reloads += 1


def told(error: Exception) -> str:
    """Return one line on what broke: `file:line: message` for shaders and our own code.

    >>> told(shader.ShaderError("GLSL Compiler failed\\n\\nfog.glsl:7: error: `x' undeclared"))
    "fog.glsl:7: error: `x' undeclared"
    """
    if isinstance(error, BakelightError):
        return str(error)
    text = str(error)
    if isinstance(error, shader.ShaderError):
        if place := _PLACE.search(text):
            return place[1].strip()
        lines = [line.strip() for line in text.splitlines()]
        return ": ".join([line for line in lines if line.strip("=")][:3]) or "shader error"
    first = text.strip().splitlines()[0] if text.strip() else ""
    frames = [
        f
        for f in traceback.extract_tb(error.__traceback__)
        if Path(f.filename).is_relative_to(SHADERS)
    ]
    where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}: " if frames else ""
    return f"{where}{type(error).__name__}: {first}"


def _try(player: Player, time: float) -> None:
    """Draw a frame, and raise RuntimeError for what OpenGL refused in it."""
    _ = player.ctx.error
    player.draw(time)
    if (error := player.ctx.error) != "GL_NO_ERROR":
        raise RuntimeError(f"OpenGL refuses to draw: {error}")


def _shader_files(folder: Path) -> Iterable[Path]:
    return (f for f in folder.rglob("*") if f.suffix in (".frag", ".vert", ".glsl"))


class _Files:
    """Files, and whether they changed since they were last taken and have come to rest."""

    def __init__(self, listed: Callable[[], Iterable[Path]]) -> None:
        self._listed = listed
        self._since = 0.0
        self.take()

    def changed(self, now: float) -> bool:
        """Tell once for each change, when it is at rest at `now` seconds."""
        seen = self._look()
        if seen != self._seen:
            self._seen, self._since = seen, now
        gone = None in seen.values() or not self._taken.keys() <= seen.keys()
        rest = GONE if gone else REST
        if seen == self._taken or now - self._since < rest:
            return False
        self._taken = seen
        return True

    def take(self) -> None:
        """Count everything as seen."""
        self._taken = self._seen = self._look()

    def listed_anew(self) -> None:
        """Count files that are listed for the first time as seen; forget those listed no more."""
        seen = self._look()
        self._taken = {file: self._taken.get(file, found) for file, found in seen.items()}

    def _look(self) -> dict[Path, Print]:
        return {file: _print(file) for file in self._listed()}


def _print(file: Path) -> Print:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
