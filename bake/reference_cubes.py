"""A scene's world of cubes at one moment, as meshes: every exposed face of a cell is a square.

Squares are not merged, so that each has one colour and shares its corners and sides with its
neighbours: no ray slips between them. The side below the world is closed. Parts stand where they
snap to cells; a lamp is a black cube that glows, at its exact place, and cells do not take it up.

Memory: 450 bytes a face measured, 900 with the rest of the reference.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import sources, voxels
from bake.voxel_faces import SIDES, exposed_faces, merged
from formats.errors import InputError
from formats.files import vox, xraw
from formats.lightmap_rectangles import flat_cells
from formats.material import Material
from formats.mesh import Mesh
from formats.scene import Scene
from formats.voxel_state import World
from formats.voxel_world import VOXELS, VoxelLamp, VoxelWorld
from formats.voxels import Voxels

CUT = np.array([[0, 1, 2], [0, 2, 3]])
"""Corners of the two triangles of a square."""


def meshes(scene: Scene, time: float, *, most: int) -> list[Mesh]:
    """Return the cubes that stand in a scene at `time` seconds, in world space, then its lamps.

    most : triangles. None without `[voxels]`, or where `[force]` has it off. Raises InputError for
    sources that cannot be read, parts of another cell size than the world, and too many faces.
    """
    described = _shown(scene)
    if described is None:
        return []
    found = at(described, time)
    count = 2 * sum(int(exposed_faces(found.solid, *side).sum()) for side in SIDES)
    if count > most:
        remedy = f"the reference traces at most {most:,}; leave out some cells"
        raise InputError(scene.file, "voxels: triangles", f"{count:,}", remedy)
    lamps = [mesh_of(lamp_cell(lamp, found.cell_size, time)) for lamp in described.lamps]
    return [mesh_of(found), *lamps]


def bounces(scene: Scene) -> int:
    """Return how often light goes on from cell to cell in a scene's picture; 0 without cubes."""
    described = _shown(scene)
    return 0 if described is None else described.bounces


def _shown(scene: Scene) -> VoxelWorld | None:
    return None if scene.force.get("voxels") is False else scene.voxels


def at(described: VoxelWorld, time: float) -> Voxels:
    """Return the cells of a world and of its parts at `time` seconds. InputError as `meshes`."""
    ground = _read(described, described.source, described.emissive)
    parts = [_read(described, body.source, {}) for body in described.bodies]
    for part in parts:
        if part.cell_size != ground.cell_size:
            remedy = f"bake it with cells of {ground.cell_size:g} m as the world has"
            raise InputError("voxels.bodies", "cell_size", part.cell_size, remedy)
    world = World(ground, parts, described.position)
    cells = world.cells(world.offsets(described.positions(time)))
    return replace(world.voxels, cells=cells)


def lamp_cell(lamp: VoxelLamp, cell_size: float, time: float) -> Voxels:
    """Return a lamp at `time` seconds as a world of one cell, black but for its own light."""
    side = lamp.side * cell_size
    x, y, z = (float(v) for v in np.asarray(lamp.position.at(time)) - side / 2)
    emission = np.zeros((2, 3), np.float32)
    emission[1] = lamp.radiance.at(time)
    return Voxels(np.ones((1, 1, 1), np.uint16), np.zeros_like(emission), emission, side, (x, y, z))


def mesh_of(cubes: Voxels) -> Mesh:
    """Turn the exposed faces of cells into a mesh, two triangles each, wound to look outward; a
    material for each row of the palettes that shows."""
    squares = merged([cubes.solid], 1, below=True)
    nx, ny, _ = cubes.size
    x, y, z = np.moveaxis(_corners(squares), -1, 0)
    nodes, corner = np.unique((z * (ny + 1) + y) * (nx + 1) + x, return_inverse=True)
    places = (nodes % (nx + 1), nodes // (nx + 1) % (ny + 1), nodes // ((nx + 1) * (ny + 1)))
    normal = np.zeros((len(squares), 3), np.float32)
    normal[np.arange(len(squares)), squares["axis"]] = squares["sign"]
    first = np.zeros(len(squares), np.int64)
    behind = cubes.cells.ravel()[flat_cells(squares, first, first, cubes.size)]
    rows, material = np.unique(behind, return_inverse=True)
    return Mesh(
        vertices=np.array(cubes.origin) + cubes.cell_size * np.stack(places, axis=-1),
        faces=corner.reshape(-1, 4)[:, CUT].reshape(-1, 3),
        normals=np.repeat(normal, 6, axis=0).reshape(-1, 3, 3),
        material=np.repeat(material, 2).astype(np.int32),
        materials=tuple(_material(cubes, row) for row in rows),
    )


def _corners(squares: NDArray[Any]) -> NDArray[np.int64]:
    """Return corners (R, 4, 3) in cells, counter-clockwise as seen from in front."""
    s, t = np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1])
    ahead = squares["sign"][:, None] > 0
    u = squares["u"][:, None] + np.where(ahead, s, t)
    v = squares["v"][:, None] + np.where(ahead, t, s)
    found = np.empty((len(squares), 4, 3), np.int64)
    row, corner = np.arange(len(squares))[:, None], np.arange(4)
    for i, values in enumerate((squares["plane"][:, None], u, v)):
        found[row, corner, (squares["axis"][:, None] + i) % 3] = values
    return found


def _material(cubes: Voxels, row: int) -> Material:
    red, green, blue = (float(v) for v in cubes.albedo[row])
    r, g, b = (float(v) for v in cubes.emission[row])
    return Material(base_color=(red, green, blue), emissive=(r, g, b))


def _read(
    described: VoxelWorld, source: Path, emissive: dict[str, tuple[float, float, float]]
) -> Voxels:
    """Read cells as a scene's bake does."""
    marked = tuple(emissive.items())
    suffix = source.suffix.lower()
    if suffix not in VOXELS:
        knobs = voxels.MeshParams(described.grid, emissive=marked)
        return voxels.from_mesh(sources.load(source).checked(source), params=knobs)
    params = voxels.Params(described.cell_size, emissive=marked)
    if suffix == ".vox":
        return voxels.from_vox(vox.read(source), params=params)
    return voxels.from_xraw(xraw.read(source), params=params)
