"""A window on a scene that follows its files, with the traced truth beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from formats import scene as scenes
from pipelines import current
from pipelines.beside import Beside
from pipelines.rebake import Rebake, Request, bake, watched
from runtime import window_open


def view_scene(
    path: Path,
    *,
    size: tuple[int, int],
    root: Path | None,
    build_folder: Path,
    threads: int = 0,
    as_json: bool = False,
) -> None:
    """Open a scene in a window until it is closed. MachineError where there is no display.

    An edit of the scene, or of what it is made from, is baked in a process beside the window, and
    taken where it can be. threads : of bakes and tracings, 0 for one a core. as_json : print what
    happens (see runtime.window.view) as JSON, a line each.
    """
    scene = scenes.load(path, root)
    # Before a bake that may take minutes
    window_open.toolkit()
    folder = current.ensure(path, scene, root, build_folder)
    from pipelines.truth import Truth
    from runtime.window import view

    bakes, truth = Bakes(path, root, build_folder, threads), Truth(path, scene.root, threads)
    try:
        view(
            folder,
            size=size,
            pictures=build_folder / "renders",
            watched=lambda: watched(path, root, folder),
            rebuild=bakes.start,
            truth=truth,
            write_exr=_write_exr,
            tell=_print if as_json else None,
        )
    finally:
        bakes.close()
        truth.close()


class Bakes:
    """Bakes of one scene beside its window, by one process that stays."""

    def __init__(self, path: Path, root: Path | None, build: Path, threads: int = 0) -> None:
        self._request = Request(path, root, build, threads)
        self._beside = Beside(bake)
        self._code = ""

    def start(self) -> Rebake:
        """Begin a bake, in a new process where the code of bakes has changed."""
        code = current.code()
        if code != self._code:
            self._beside.stop()
        self._code = code
        return Rebake(self._beside, self._request)

    def close(self) -> None:
        """End the process beside."""
        self._beside.stop()


def _write_exr(path: Path, radiance: Any) -> None:
    import numpy as np

    from formats.files import exr

    exr.write(path, {"beauty": np.ascontiguousarray(radiance)})


def _print(event: dict[str, Any]) -> None:
    click.echo(json.dumps(event, sort_keys=True, default=str))
