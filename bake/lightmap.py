"""Light of a world of cubes that does not change, gathered by rays from the texels of its faces.

With a target, rounds double the rays until the relative error is below it.

The light on a texel is that at its centre. Sums are float64. Memory: 256 MB of ray ends, 700 bytes
a texel of the world, 10 MB a thread.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import voxel_faces, workers
from bake.lightmap_lights import Lamp, LampRays
from bake.lightmap_rays import Tracer
from bake.lightmap_rounds import MOST, SETS, Gathering
from bake.lightmap_surface import Surface
from formats.environment import Environment
from formats.errors import InputError
from formats.lightmap import Faces, Lightmap
from formats.voxels import Voxels

FIRST = 64
"""Rays a texel of the first round, where there is a target."""


@dataclass(frozen=True)
class Params:
    """Knobs. texels : along a cell side.  rays : a texel, at most; as many go to glowing faces
    again.  bounces : how often light is handed on; -1 for all.  target : relative error at which
    rays end, RMS over texels; 0 casts all.  below : light the lowest side, too.  sky : factor on
    the environment.  sample_lights : aim rays at what glows.  spread : evenly spread rays, or
    independent ones to compare with."""

    texels: int = 2
    rays: int = 1024
    bounces: int = -1
    target: float = 0.02
    below: bool = False
    sky: float = 1.0
    sample_lights: bool = True
    spread: bool = True

    def check(self) -> None:
        """Raise InputError for the first knob out of its range."""
        ranges = {
            "texels": (1, voxel_faces.MAX_TEXELS),
            "rays": (SETS, 1 << 20),
            "bounces": (-1, MOST),
            "target": (0, 1),
            "sky": (0, 1e6),
        }
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError("lightmap", name, value, f"choose from {low} to {high}")


def light(
    voxels: Voxels,
    environment: Environment | None = None,
    *,
    params: Params,
    progress: workers.Progress = workers.silent,
) -> Lightmap:
    """Lay out the faces of a world and gather their light.

    Raises InputError for knobs out of range and for a world without faces.
    """
    params.check()
    voxels = voxels.checked()
    faces = voxel_faces.layout(
        voxels.cells,
        texels=params.texels,
        cell_size=voxels.cell_size,
        origin=voxels.origin,
        below=params.below,
    )
    sky = None if environment is None else environment.radiance
    return gather(voxels, faces, params=params, progress=progress, environment=sky)


def gather(
    voxels: Voxels,
    faces: Faces,
    *,
    params: Params,
    progress: workers.Progress = workers.silent,
    environment: NDArray[np.float32] | None = None,
    lamps: tuple[Lamp, ...] = (),
    seed: int = 0,
) -> Lightmap:
    """Gather the light of a world on to a layout; faces that are not exposed now get none.

    environment : (h, w, 3) lat-long radiance that rays out of the world see; None for black.
    lamps : lights that are no cells.  seed : of the rays, for those who gather more than once.
    """
    params.check()
    surface = Surface(voxels, faces)
    sky = None if environment is None else params.sky * np.asarray(environment, np.float64)
    others = LampRays(lamps, surface, voxels)
    tracer = Tracer(surface, sky, sample_lights=params.sample_lights, others=others)
    gathering = Gathering(surface, tracer, params.bounces, params.spread, seed)
    per_set = -(-params.rays // SETS)
    count = min(per_set, FIRST // SETS) if params.target > 0 else per_set
    while True:
        gathering.add_round(count, per_set, progress)
        done = gathering.rays
        if done >= per_set * SETS or gathering.relative_error() <= params.target:
            break
        count = min(done // SETS, per_set - done // SETS)
    progress(1.0)
    return gathering.result(faces)
