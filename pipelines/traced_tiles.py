"""What an interrupted reference had traced waits in the store's folder for the next run of it."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bake import publish, recipe, reference, syntax, tiles
from bake.store import SYNTAX
from formats.scene import Scene
from pipelines import bake_scene, current


@contextmanager
def kept(path: Path, scene: Scene, params: reference.Params, build_folder: Path) -> Iterator[None]:
    """Let `reference.render` of the scene in `path` go on where it ended.

    What was traced goes when the block ends well, and is swept as that of bakes is.
    """
    store = build_folder / "store"
    try:
        folder = store / _name(path, scene, params, store)
    except OSError:
        # What reads the files says which of them cannot be read
        yield
        return
    with tiles.shelf(folder, f"the reference of {scene.name}", _say):
        yield
    publish.discard(folder)


def _name(path: Path, scene: Scene, params: reference.Params, store: Path) -> str:
    """Name the tiles by all that a picture depends on: code, machine, knobs, and every file."""
    syntax.remember(store / SYNTAX)
    known = recipe.of(reference.render, (), params)
    known |= {"scene": current.digest(path), "sources": bake_scene.sources_of(scene)}
    return f"{publish.TILES}{hashlib.sha256(recipe.text(known)).hexdigest()}"


def _say(message: str) -> None:
    print(message, file=sys.stderr, flush=True)
