"""A scene's world of cubes: the layout of every face that is ever seen, and light where none moves.

Assets come in the order world, parts, environments. Memory: as bake.lightmap, and one state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bake import lightmap, voxel_faces, workers
from bake.lightmap_lights import Lamp
from formats.environment import Environment
from formats.errors import InputError
from formats.keyed import Keyed
from formats.lightmap import Lightmap
from formats.voxel_state import Glow, Place, Reach, World
from formats.voxel_world import VoxelLamp
from formats.voxels import MAX_ROWS, Voxels
from maths.latlong import joined, turned

MAX_STATES = 1024


@dataclass(frozen=True)
class Params:
    """Knobs. position : of the middle of the world's underside, metres.  moments : positions of the
    parts at each moment that differs.  environments : factor (3,) and turn, radians, of each.
    lamps : middle, metres, which snaps to cells, radiance, and cells along a side of each.
    lights : the scene's others.  reaches : of all that ever shine, for which the world has room.
    texels, rays, bounces, target : as bake.lightmap.Params; without rays nothing is lit."""

    position: Place
    moments: tuple[tuple[Place, ...], ...] = ()
    environments: tuple[tuple[Place, float], ...] = ()
    lamps: tuple[tuple[Place, Place, int], ...] = ()
    lights: tuple[Lamp, ...] = ()
    reaches: tuple[Reach, ...] = ()
    texels: int = 2
    rays: int = 0
    bounces: int = 3
    target: float = 0.02


def light(
    world: Voxels,
    *others: Voxels | Environment,
    params: Params,
    progress: workers.Progress = workers.silent,
) -> Lightmap:
    """Lay out the faces of a world in all its states; with rays, light its first state.

    Raises InputError for a world without faces, and one with too many states or texels.
    """
    world = world.checked()
    parts = [each.checked() for each in others if isinstance(each, Voxels)]
    maps = [each for each in others if isinstance(each, Environment)]
    for part in parts:
        if part.cell_size != world.cell_size:
            remedy = f"bake it with cells of {world.cell_size:g} m as the world has"
            raise InputError("voxels.bodies", "cell_size", part.cell_size, remedy)
    cubes = World(world, parts, params.position, params.reaches)
    states = cubes.states(params.moments) if parts else [()]
    if len(states) > MAX_STATES:
        remedy = f"move parts through at most {MAX_STATES} places together"
        raise InputError("voxels.bodies", "position", f"{len(states)} states", remedy)
    voxels = cubes.voxels
    if outside := cubes.outside(states):
        corners = (f"{a:g} to {b:g}" for a, b in zip(voxels.origin, _highest(voxels), strict=True))
        remedy = "it never is in the world: x {}, y {}, z {} m".format(*corners)
        raise InputError("voxels", f"bodies[{outside[0]}].position", "outside", remedy)
    faces = voxel_faces.layout(
        (cubes.cells(offsets) for offsets in states),
        texels=params.texels,
        cell_size=voxels.cell_size,
        origin=voxels.origin,
    )
    if not params.rays:
        empty = np.zeros((faces.size[1], faces.size[0], 3), np.float32)
        return Lightmap(empty, empty, faces, {"states": len(states)})
    cells = cubes.cells(states[0])
    lit = _with_lamps(
        replace(voxels, cells=cells),
        [cubes.glow(lamp, cells, 0.0) for lamp in _lamps(cubes, params)],
    )
    knobs = lightmap.Params(
        texels=params.texels, rays=params.rays, bounces=params.bounces, target=params.target
    )
    return lightmap.gather(
        lit,
        faces,
        params=knobs,
        progress=progress,
        environment=_sky(maps, params),
        lamps=params.lights,
    )


def _highest(voxels: Voxels) -> tuple[float, ...]:
    """Highest corner (x, y, z), metres."""
    sides = zip(voxels.origin, voxels.size, strict=True)
    return tuple(low + count * voxels.cell_size for low, count in sides)


def _lamps(cubes: World, params: Params) -> list[VoxelLamp]:
    """Lamps that fill whole cells: shared out among more, they would light less."""
    return [
        VoxelLamp(
            position=Keyed.hold(cubes.snapped(at, side)),
            radiance=Keyed.hold(radiance),
            side=side,
        )
        for at, radiance, side in params.lamps
    ]


def _with_lamps(voxels: Voxels, glows: Sequence[Glow]) -> Voxels:
    """Let empty cells send out what lamps do that fill them; they stop rays and reflect none.

    Raises InputError for more kinds of cells than a palette has rows.
    """
    total = np.zeros((*voxels.cells.shape, 3), np.float32)
    taken = np.zeros(voxels.cells.shape, np.bool_)
    for glow in glows:
        x, y, z = glow.cells.T
        total[z, y, x] += np.outer(glow.share, glow.radiance)
        taken[z, y, x] = True
    rows, number = np.unique(total[taken], axis=0, return_inverse=True)
    first = len(voxels.albedo)
    if first + len(rows) > MAX_ROWS:
        remedy = f"use fewer lamps: they and the palettes make at most {MAX_ROWS:,} kinds of cells"
        raise InputError("voxels.lamps", "", f"{first + len(rows):,} kinds", remedy)
    cells = voxels.cells.copy()
    cells[taken] = first + number.reshape(-1)
    albedo = np.concatenate([voxels.albedo, np.zeros_like(rows)])
    emission = np.concatenate([voxels.emission, rows])
    return replace(voxels, cells=cells, albedo=albedo, emission=emission)


def _sky(maps: list[Environment], params: Params) -> NDArray[np.float32] | None:
    """Join all maps to one, as they stand in the world."""
    if not maps:
        return None
    placed = zip(maps, params.environments, strict=True)
    found = [turned(each.radiance, yaw) * np.asarray(factor) for each, (factor, yaw) in placed]
    return joined(found).astype(np.float32)
