"""A scene baked again beside its window, while the window goes on."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from formats import scene as scenes
from formats.errors import BakelightError
from pipelines.beside import Beside, Ended, Tell
from runtime.live import Step


@dataclass(frozen=True)
class Request:
    """A bake to do: scene file, asset root, build folder, threads (0: one a core)."""

    path: Path
    root: Path | None
    build: Path
    threads: int = 0


def bake(request: Request, tell: Tell) -> None:
    """Bake; tell (asset, percent) as it goes on, then the folder."""
    from bake import workers
    from pipelines.price_kept import bake_again

    workers.use(request.threads)
    last: tuple[str, int] = ("", -1)

    def progress(asset: str, fraction: float) -> None:
        nonlocal last
        now = asset, int(100 * fraction)
        tell(now if now != last else None)
        last = now

    done = bake_again(
        request.path, root=request.root, build_folder=request.build, on_progress=progress
    )
    tell(done.folder)


class Rebake:
    """One bake beside the window, as runtime.live.Live wants it. beside : does `bake`."""

    def __init__(self, beside: Beside, request: Request) -> None:
        self._beside = beside
        self._step = Step(busy=f"baking {request.path.stem}")
        self._folder: Path | None = None
        beside.ask(request)

    def poll(self) -> Step:
        """Return where it is."""
        for message in self._beside.poll():
            self._take(message)
        return self._step

    def _take(self, message: Any) -> None:
        if isinstance(message, Ended):
            folder = None if message.error else self._folder
            self._step = Step(error=message.error, folder=folder)
        elif isinstance(message, Path):
            self._folder = message
        else:
            self._step = Step(busy="baking {} {} %".format(*message))

    def close(self) -> None:
        """Stop it where it runs still; the store is made for that."""
        if self._step.busy is not None:
            self._beside.stop()


def watched(path: Path, root: Path | None, folder: Path) -> tuple[Path, ...]:
    """Return the files that a baked scene depends on, and those that its file names now.

    folder : the baked scene, whose manifest knows what else its sources are made of.
    """
    found = [path.resolve()]
    with suppress(BakelightError, OSError):
        found += scenes.load(path, root).sources.values()
    with suppress(OSError, ValueError, KeyError):
        found += map(Path, json.loads((folder / "manifest.json").read_text())["sources"])
    return tuple(dict.fromkeys(found))
