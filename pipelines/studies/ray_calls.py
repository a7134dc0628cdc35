"""The rays that a bake casts: counted, or recorded to be cast again without the bake."""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import local
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import billboard, workers
from bake.rays import RayScene
from bake.shading import Surface
from formats.mesh import Mesh


@dataclass(frozen=True)
class Call:
    """One call of Embree: origins (n, 3), directions (n, 3) or (1, 3), and what was asked."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    query: dict[str, Any]


@dataclass
class Recorder:
    """Stands where a scene of embreex does: answers like it and keeps what it was asked.

    keep : hold on to the arrays, tile by tile, for `replay`; otherwise only `rays` are counted.
    """

    scene: Any
    keep: bool
    rays: int = 0
    tiles: list[list[Call]] = field(default_factory=list)
    mine: local = field(default_factory=local)

    def begin(self) -> None:
        """Open a tile of the calling thread."""
        self.mine.calls = []
        self.tiles.append(self.mine.calls)

    def run(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], **query: Any
    ) -> Any:
        """Do as embreex does."""
        self.rays += len(origins)
        if self.keep:
            self.mine.calls.append(Call(origins, directions, query))
        return self.scene.run(origins, directions, **query)


class RecordedScene(RayScene):
    """A scene that lets a Recorder listen in."""

    def __init__(self, mesh: Mesh, *, keep: bool) -> None:
        super().__init__(mesh.vertices, mesh.faces)
        self.recorder = Recorder(self._scene, keep)
        self._scene = self.recorder


def cast(mesh: Mesh, params: billboard.Params, *, keep: bool = False) -> Recorder:
    """Cast the rays of billboard.trace(mesh, params=params), tile by tile, on one thread."""
    scene = RecordedScene(mesh, keep=keep)
    surface = Surface(mesh, scene, params.transmission, params.gloss)
    frame, lights = billboard.frame_of(mesh, params), billboard.lights_of(params)
    texels = frame.width * frame.height
    for view in range(params.views):
        for start in range(0, texels, billboard.TILE):
            scene.recorder.begin()
            span = (view, start, min(start + billboard.TILE, texels))
            billboard._tile(surface, frame, lights, params, span)
    return scene.recorder


def replay(recorder: Recorder) -> None:
    """Cast the recorded rays again and nothing else, with as many threads as bakes use."""

    def tile(calls: list[Call]) -> None:
        for call in calls:
            recorder.scene.run(call.origins, call.directions, **call.query)

    workers.map_tiles(tile, recorder.tiles)
