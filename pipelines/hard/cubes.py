"""Hard cases of cubes: traversal of grids, light gathered in them, and what a world may hold."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.voxels import ALBEDO_LIMIT, Voxels
from maths import voxel_traversal as traversal
from pipelines.hard.cells import Family, Result, all_of, at_most, either, equal, noted, refused
from pipelines.hard.finite import saved

cubes = Family("worlds of cubes")


def palette(*rows: tuple[float, float]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return albedo and emission (P, 3) of grey rows, row 0 empty."""
    table = np.array([(0.0, 0.0), *rows], np.float32)
    albedo, emission = (np.repeat(table[:, k : k + 1], 3, axis=1) for k in (0, 1))
    return albedo, emission


def closed(side: int, albedo: float, emission: float = 1.0) -> Voxels:
    """Return a closed room of `side` empty cells each way, walls a cell thick."""
    cells = np.ones((side + 2,) * 3, np.uint16)
    cells[1:-1, 1:-1, 1:-1] = 0
    return Voxels(cells, *palette((albedo, emission)))


def inside(faces: Any, side: int) -> NDArray[np.bool_]:
    """Return the texels (h, w) that look into the room."""
    at = np.nan_to_num(faces.positions() + 0.5 * faces.normals(), nan=-9)
    return np.asarray(np.all((at > 1) & (at < side + 1), axis=2))


def light(world: Voxels, **knobs: Any) -> Any:
    from bake import lightmap

    params = replace(lightmap.Params(texels=1, rays=256, target=0), **knobs)
    return lightmap.light(world, params=params)


cubes.row("V1", "directions with components 0, and 0 altogether", "OK; 0, NaN, infinite refused",
          "a ray along an axis crosses the cells of its row")  # fmt: skip


@cubes.cell("V1", "maths.voxel_traversal")
def _axes() -> Result:
    solid = np.zeros((5, 6, 7), bool)
    solid[2, 3, 6] = True
    found = traversal.exact(solid, [[0, 3, 2]], [[0.5, 3.5, 2.5]], [[1.0, 0.0, 0.0]])
    bad = ([0.0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 1])
    return all_of(
        equal(found.cell[0], [6, 3, 2]),
        equal(found.visited[0], 7),
        at_most(abs(found.t[0] - 5.5), 0),
        *(refused(lambda d=d: traversal.exact(solid, [[0, 0, 0]], [[0.5] * 3], [d])) for d in bad),
    )


cubes.row("V2", "rays that graze faces and run on grid lines", "every crossed cell once",
          "visited = 1 + sum of cell steps")  # fmt: skip


@cubes.cell("V2", "maths.voxel_traversal")
def _grazing() -> Result:
    rng = np.random.default_rng(2)
    cell = rng.integers(0, 8, (4000, 3))
    origin = cell + rng.choice([0.0, 0.5, 1.0], (4000, 3))
    direction = rng.choice([-1.0, -1e-9, 0.0, 1e-9, 1.0], (4000, 3))
    direction[np.all(direction == 0, axis=1)] = [1, 0, 0]
    found = traversal.exact(np.zeros((8, 8, 8), bool), cell, origin, direction)
    return equal(found.visited, 1 + np.abs(found.cell - cell).sum(axis=1))


cubes.row("V3", "walls that touch themselves by edges and corners alone", "nothing leaks",
          "who misses leaves on this side; 0 of n, so below 3 / n")  # fmt: skip
for _way in ("exact", "sphere"):

    def _wall(way: str = _way) -> Result:
        rng = np.random.default_rng(3)
        z, y, x = np.indices((16,) * 3)
        cell = rng.integers(0, 4, (10_000, 3))
        start = np.where(rng.random((10_000, 1)) < 0.5, cell + 0.5, cell + rng.random(cell.shape))
        towards = np.where(rng.random(cell.shape) < 0.5, 1.0, rng.random(cell.shape))
        leaks = 0
        for normal, plane in (((1, 1, 1), 12), ((1, 1, 0), 9), ((0, 1, 1), 8)):
            wall = np.tensordot(normal, [x, y, z], 1) == plane
            grid = wall if way == "exact" else traversal.distances(wall)
            found = getattr(traversal, way)(grid, cell, start, towards)
            missed = found.face == traversal.MISS
            leaks += int(np.count_nonzero(found.cell[missed] @ normal >= plane))
        return equal(leaks, 0, "of 30000")

    cubes.add("V3", _way, _wall)

cubes.row("V4", "fixed steps past a wall of one cell", "missed as often as known",
          "max(0, 1 - chord / step), one offset a ray")  # fmt: skip
for _step in (1.0, 1.25, 2.0, 5.0):

    def _steps(step: float = _step) -> Result:
        rng, m, slope = np.random.default_rng(4), 10_000, 0.6
        solid = np.zeros((40, 40, 40), bool)
        solid[:, :, 20] = True
        cell = np.tile([2, 5, 20], (m, 1))
        direction = np.tile([1.0, slope, 0.0] / np.hypot(1, slope), (m, 1))
        samples = round(30 / step)
        found = traversal.march(
            solid, cell, cell + 0.5, direction, samples * step, samples, rng.random(m)
        )
        chance = max(0.0, 1 - np.hypot(1, slope) / step)
        off = abs(np.mean(found.face == traversal.MISS) - chance)
        return at_most(off, 5 * np.sqrt(chance * (1 - chance) / m), "five standard errors")

    cubes.add("V4", f"step {_step:g}", _steps)

cubes.row("V5", "rays and texels that start inside a solid", "left out, or leave it first", "exact")


@cubes.cell("V5", "maths.voxel_traversal")
def _buried() -> Result:
    found = traversal.exact(np.ones((3, 3, 3), bool), [[1, 1, 1]], [[1.5] * 3], [[1.0, 0, 0]])
    return equal(found.face[0], traversal.INSIDE, "told apart from a hit")


@cubes.cell("V5", "bake.lightmap")
def _covered() -> Result:
    from bake import lightmap, voxel_faces

    world = closed(2, 0.5)
    faces = voxel_faces.layout(world.cells, texels=1)
    full = replace(world, cells=np.ones_like(world.cells))
    found = lightmap.gather(full, faces, params=lightmap.Params(texels=1, rays=16, target=0))
    covered = inside(faces, 2)
    return equal(found.irradiance[covered], 0, "faces that are covered now get no light")


cubes.row("V6", "white furnace: a closed room that glows", "E / (1 - albedo)",
          "q = 1 - (1 - E / B) / albedo is the share of rays lost")  # fmt: skip


@lru_cache
def furnace(albedo: float) -> float:
    """Return what the walls of a glowing room get after 40 bounces, 1 where nothing leaks."""
    found = light(closed(3, albedo), sample_lights=False, bounces=40)
    walls = found.irradiance[inside(found.faces, 3)].astype(float)
    return float(walls.mean() / (np.pi * (1 - albedo**41) / (1 - albedo)))


def leak() -> float:
    """Return the share q of rays that a furnace of albedo 0.8 loses: B = E / (1 - .8 (1 - q))."""
    return 1 - (1 - 0.2 / furnace(0.8)) / 0.8


for _albedo in (0.2, 0.5, 0.8):
    cubes.add("V6", f"albedo {_albedo}", lambda a=_albedo: at_most(
        abs(furnace(a) - 1), 2e-6, "float32 sums of 41 rounds"))  # fmt: skip


@cubes.cell("V6", "leak meter")
def _meter() -> Result:
    return at_most(abs(leak()), 2e-6 * 0.25, "share of rays lost")


@cubes.cell("V6", "bounces counted")
def _bounces() -> Result:
    found = light(closed(3, 0.6, 2.0), sample_lights=False, bounces=3)
    truth = 2 * np.pi * (1 - 0.6**4) / 0.4
    return at_most(np.abs(found.irradiance[inside(found.faces, 3)] / truth - 1).max(), 2e-6)


cubes.row(
    "V7", "light that touches its receiver", "bounded", "never above pi L; pi L / 2 at its foot"
)


@cubes.cell("V7", "bake.lightmap")
def _touching() -> Result:
    cells = np.zeros((8, 5, 8), np.uint16)
    cells[:, 0], cells[3:5, 1:4, 3:5] = 1, 2
    found = light(Voxels(cells, *palette((0.0, 0.0), (0.0, 3.0))), rays=64)
    return at_most(found.irradiance.max(), 3 * np.pi, "no 1 / r^2")


cubes.row(
    "V8",
    "sums of many passes",
    "no stall: sums are as wide as they need to be",
    "a half float's mean freezes at .648 of .524; the mean of n equal values is the value",
)


@cubes.cell("V8", "bake.lightmap", slow=True)
def _many() -> Result:
    found = light(closed(1, 0.0), rays=1 << 17, sample_lights=False)
    walls = found.irradiance[inside(found.faces, 1)].astype(float)
    return at_most(np.abs(walls / np.pi - 1).max(), 1e-6, "131072 rays a texel, all the same")


@cubes.cell("V8", "after one firefly", slow=True)
def _after_firefly() -> Result:
    # One cell of 726 glows 1e6 times as much as the rest do: rays that find it must not drown them
    rough, fine = (_one_bright(rays, 1e4) for rays in (1 << 8, 1 << 14))
    spread = np.std(rough - fine) / np.std(fine)
    return at_most(spread, 1.0, "64 times the rays still change the mean")


def _one_bright(rays: int, bright: float, *, aim: bool = True) -> NDArray[np.float64]:
    world = closed(4, 0.0, 0.01)
    cells = world.cells.copy()
    cells[0, 3, 3] = 2
    world = Voxels(cells, *palette((0.0, 0.01), (0.0, bright)))
    found = light(world, rays=rays, sample_lights=aim)
    return np.asarray(found.irradiance[inside(found.faces, 4)], np.float64)


cubes.row("V9", "order of threads and tiles", "the same bytes", "random numbers are hashes")


@cubes.cell("V9", "bake.lightmap")
def _threads() -> Result:
    from bake import workers

    before = workers.count()
    try:
        found = []
        for count in (1, 4):
            workers.use(count)
            found.append(light(closed(3, 0.5), rays=64).irradiance)
    finally:
        workers.use(before)
    return equal(found[0], found[1])


cubes.row(
    "V10",
    "fireflies: one small light far brighter than the rest",
    "no clamp",
    "light is linear: a thousand times the radiance, a thousand times the irradiance",
)


@cubes.cell("V10", "bake.lightmap")
def _fireflies() -> Result:
    def seen(bright: float) -> NDArray[np.float64]:
        cells = closed(4, 0.0).cells.copy()
        cells[0, 3, 3] = 2
        world = Voxels(cells, *palette((0.0, 0.0), (0.0, bright)))
        found = light(world, rays=64, sample_lights=False)
        return np.asarray(found.irradiance[inside(found.faces, 4)], np.float64)

    # Values stay below the 65504 of the half floats that they are stored in
    return at_most(np.abs(seen(5e3) - 1e3 * seen(5.0)).max() / seen(5e3).max(), 1e-6, "float32")


cubes.row("V11", "glowing cells in BC1 blocks", "dark cells decode to black, solid ones to solid",
          "else stored as RGBA8")  # fmt: skip


@cubes.cell("V11", "formats.voxels")
def _blocks() -> Result:
    from formats import voxel_light
    from formats.voxels import load_light

    rng = np.random.default_rng(11)
    cells = rng.integers(0, 40, (9, 10, 11)).astype(np.uint16)
    cells[rng.random(cells.shape) < 0.5] = 0
    emission = rng.uniform(0, 9, (40, 3)).astype(np.float32)
    emission[rng.random(40) < 0.5] = 0
    emission[0] = 0
    world = Voxels(cells, np.zeros((40, 3), np.float32), emission)
    with tempfile.TemporaryDirectory() as name:
        world.save(Path(name))
        texture, _ = load_light(Path(name))
    texels = voxel_light.texels(texture)
    dark = world.solid & ~world.glowing
    return all_of(
        equal(texels[..., 3] > 0, world.solid, "solid"),
        equal(texels[dark][:, :3], 0, "no ghost light"),
    )


cubes.row(
    "V12", "albedo of 1 and more", "lowered to .98 with a note, or refused", "a sum that ends"
)


@cubes.cell("V12", "bake.voxels")
def _white() -> Result:
    from bake.voxels import limited_albedo

    found, notes = limited_albedo(np.ones((2, 3)), np.array([0, 5]))
    return all_of(at_most(found.max(), np.float32(ALBEDO_LIMIT)), noted(notes, "albedo"))


def _spoilt(**fields: Any) -> Voxels:
    return replace(closed(2, 0.5), **fields)


_GREY = palette((0.5, 1.0))
BAD = (
    ("V12", "albedo 1", {"albedo": palette((1.0, 0))[0]}),
    ("V13", "albedo NaN", {"albedo": _GREY[0] * np.float32(np.nan)}),
    ("V13", "emission infinite", {"emission": np.array([[0] * 3, [np.inf] * 3], np.float32)}),
    ("V13", "emission below 0", {"emission": -_GREY[1]}),
    ("V13", "a row that is not there", {"cells": np.full((2, 2, 2), 9, np.uint16)}),
    ("V13", "cells below 0", {"cells": np.full((2, 2, 2), -1, np.int32)}),
    ("V13", "no cells", {"cells": np.zeros((0, 2, 2), np.uint16)}),
    ("V13", "cells of two axes", {"cells": np.ones((2, 2), np.uint16)}),
    ("V13", "cells as floats", {"cells": np.ones((2, 2, 2))}),
    ("V13", "cells of no size", {"cell_size": 0.0}),
    ("V13", "cells of NaN metres", {"cell_size": float("nan")}),
    ("V13", "an origin at infinity", {"origin": (float("inf"), 0.0, 0.0)}),
    ("V13", "light in the empty row", {"emission": _GREY[1] + 1}),
)
cubes.row("V13", "worlds with broken arrays", "refused", "checked before any work")
for _row, _name, _fields in BAD:
    for _stage in ("formats.voxels", "bake.lightmap"):

        def _refuses(fields: Any = _fields, stage: str = _stage) -> Result:
            world = _spoilt(**fields)
            if stage == "bake.lightmap":
                return refused(lambda: light(world, rays=16))
            return refused(lambda: saved(world, Path(tempfile.gettempdir())))

        cubes.add(_row, f"{_stage}: {_name}", _refuses)

cubes.row(
    "V14",
    "worlds of one cell, of none solid, all solid, all dark",
    "finite, or refused",
    "exact zeros",
)
for _name, _cells in (
    ("one cell", np.ones((1, 1, 1), np.uint16)),
    ("nothing solid", np.zeros((3, 3, 3), np.uint16)),
    ("all solid", np.ones((3, 3, 3), np.uint16)),
):
    for _stage in ("formats.voxels", "bake.lightmap"):

        def _edge(cells: Any = _cells, stage: str = _stage) -> Result:
            world = Voxels(cells, *palette((0.5, 1.0)))
            parent = Path(tempfile.gettempdir())
            return either(lambda: saved(light(world, rays=16) if "map" in stage else world, parent))

        cubes.add("V14", f"{_stage}: {_name}", _edge)


@cubes.cell("V14", "all dark")
def _dark() -> Result:
    return equal(light(closed(3, 0.5, 0.0), rays=64).irradiance, 0, "no light from nothing")
