"""Stages that studies run, through the store: what was baked once is not baked again.

A bake's price is the processor's time of its first run, which is noted beside the answers.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from time import process_time
from typing import Any, TypeVar

import numpy as np

from bake.rays import RayScene
from bake.recipe import Source, Stage
from bake.store import Store
from formats.files import atomic
from formats.mesh import Mesh

Result = TypeVar("Result")

SHORT = 0.5  # seconds


@dataclass
class Bakes:
    """A store, made when it is first needed, and the file that notes what bakes took."""

    folder: Path
    times: Path

    @cached_property
    def store(self) -> Store:
        """The store."""
        return Store(self.folder)

    def seconds(self, key: str) -> float:
        """Return the processor's seconds of a bake, 0 where they are not known."""
        try:
            return float(json.loads(self.times.read_bytes())[key])
        except (OSError, ValueError, KeyError, TypeError):
            return 0.0

    def note(self, key: str, seconds: float) -> None:
        """Remember what a bake took."""
        try:
            known = json.loads(self.times.read_bytes())
        except (OSError, ValueError):
            known = {}
        self.times.parent.mkdir(parents=True, exist_ok=True)
        text = json.dumps({**known, key: round(seconds, 4)}, indent=0, sort_keys=True)
        atomic.write_bytes(self.times, (text + "\n").encode())


_bakes: ContextVar[Bakes | None] = ContextVar("bakes", default=None)
_known: dict[int, tuple[Mesh, Source[Mesh]]] = {}


@contextmanager
def into(folder: Path, times: Path) -> Iterator[None]:
    """Let studies find and leave the results of stages in the store of a folder; `times` notes
    their seconds."""
    token = _bakes.set(Bakes(folder, times))
    try:
        yield
    finally:
        _bakes.reset(token)


def store() -> Store | None:
    """Return the store in use."""
    bakes = _bakes.get()
    return bakes.store if bakes else None


def remembered(source: Source[Mesh]) -> Mesh:
    """Read a mesh that stages can then be run on through the store."""
    mesh = source.load()
    _known[id(mesh)] = mesh, source
    return mesh


def run(
    stage: Stage, mesh: Mesh, load: Callable[[Path], Result], *, params: Any
) -> tuple[Result, float]:
    """Return what a stage makes of a mesh, and the processor's seconds that it took.

    Meshes that are `remembered` go through the store in use, others are baked here.
    """
    bakes, known = _bakes.get(), _known.get(id(mesh))
    if bakes is None or known is None:
        made, seconds = processor_seconds(stage, mesh, params=params)
        return made, seconds  # type: ignore[return-value]
    _warmed()
    started = process_time()
    entry = bakes.store.run(stage, known[1], params=params)
    spent = process_time() - started
    if not entry.hit:
        bakes.note(entry.key, spent)
    return load(entry.path), bakes.seconds(entry.key) or entry.seconds


@cache
def _warmed() -> None:
    """Load what first calls load: it is no bake's price."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    start, toward = (np.array([v], np.float32) for v in ((0.1, 0.1, 1), (0, 0, -1)))
    RayScene(corners, np.array([[0, 1, 2]])).intersect(start, toward)


def processor_seconds(
    function: Callable[..., Result], *values: Any, **named: Any
) -> tuple[Result, float]:
    """Call a function; return its result and the processor time of all threads, in seconds.

    On a machine with other work to do, that says more than the clock on the wall. What takes less
    than SHORT is called again, and the faster counts: the first call also loads and allocates.
    """
    least = np.inf
    for _ in range(2):
        started = process_time()
        result = function(*values, **named)
        least = min(least, process_time() - started)
        if least > SHORT:
            break
    return result, least
