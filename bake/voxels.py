"""A world of cubes from a voxel editor's file or from a mesh.

Cells are solid or empty: glass and clouds count as solid. What glows comes from the file, by the
formula of `formats.files.vox_palette`, or is marked by palette index or colour.

Memory: 4 bytes a cell of the box, and the file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import voxelise, workers
from formats.errors import InputError
from formats.files import vox_scene
from formats.files.vox import VoxFile
from formats.files.xraw import XrawFile
from formats.material import BRIGHTEST
from formats.mesh import Mesh
from formats.voxels import ALBEDO_LIMIT, MAX_ROWS, MAX_SIDE, Voxels
from maths.colour import srgb_decode

Array = NDArray[np.float64]
Emissive = tuple[tuple[str, tuple[float, ...]], ...]

_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_THROUGH = ("_glass", "_blend", "_media")


@dataclass(frozen=True)
class Params:
    """Knobs. cell_size : metres. emission_scale : W/(m2 sr) of a file's colour of 1 at weight 1 and
    flux 0. emissive : what glows besides, or otherwise: pairs of a palette index ("42") or a
    colour ("#ffcc00") and its radiance: three numbers, W/(m2 sr), or one number times the colour.
    """

    cell_size: float = 0.1
    emission_scale: float = 1.0
    emissive: Emissive = ()

    def check(self) -> None:
        """Raise InputError for the first knob out of its range."""
        if not 1e-6 <= self.cell_size <= 1e6:
            raise InputError("voxels", "cell_size", self.cell_size, "choose from 1e-6 to 1e6 m")
        if not 0 <= self.emission_scale <= BRIGHTEST:
            remedy = f"choose from 0 to {BRIGHTEST:g} W/(m2 sr)"
            raise InputError("voxels", "emission_scale", self.emission_scale, remedy)
        check_emissive(self.emissive)


def check_emissive(emissive: Emissive) -> None:
    """Raise InputError for the first radiance that is not one or three numbers in range."""
    for key, values in emissive:
        if len(values) not in (1, 3) or not all(0 <= value <= BRIGHTEST for value in values):
            remedy = f"give one number or three, from 0 to {BRIGHTEST:g} W/(m2 sr)"
            raise InputError("voxels", f"emissive {key}", values, remedy)


@dataclass(frozen=True)
class MeshParams:
    """Knobs. grid : cells along the longest side. solid : fill the inside. emissive : pairs of a
    material's name and the radiance that it sends out, as in `Params`.
    """

    grid: int = 128
    solid: bool = True
    emissive: Emissive = ()

    def check(self) -> None:
        """Raise InputError for the first knob out of its range."""
        if not 1 <= self.grid <= MAX_SIDE:
            raise InputError("voxels", "grid", self.grid, f"choose from 1 to {MAX_SIDE}")
        check_emissive(self.emissive)


@dataclass(frozen=True, eq=False)
class _Box:
    """cells : (z, y, x) rows of the palette, z up. lowest : cells. palette : (P, 4) sRGB. power :
    (P,) radiance over linear colour. notes : of the reader."""

    cells: NDArray[Any]
    lowest: tuple[int, int, int]
    palette: NDArray[np.uint8]
    power: Array
    notes: tuple[str, ...]


def from_vox(
    file: VoxFile, *, params: Params, progress: workers.Progress = workers.silent
) -> Voxels:
    """Turn what a .vox file shows into a world; rows of the palettes are the editor's indices.

    Metres are cells of the file's scene times `cell_size`, (x, y, z) there is (x, z, -y) here.
    Raises InputError for knobs out of range, an `emissive` that no cell has, a scene that shows
    nothing, and one too large (`vox_scene`).
    """
    params.check()
    scene = vox_scene.flatten(file)
    power = np.array([material.emission for material in file.materials])
    used = np.unique(scene.cells)
    kinds = sorted({file.materials[row].type for row in used if row} & set(_THROUGH))
    notes = [f"materials {', '.join(kinds)} are taken as opaque"] if kinds else []
    box = _Box(scene.cells, scene.lowest, file.palette, power, (*scene.notes, *notes))
    return _world(box, params)


def from_xraw(
    file: XrawFile, *, params: Params, progress: workers.Progress = workers.silent
) -> Voxels:
    """Turn an XRAW box into a world, its middle over the origin, standing on y = 0.

    Raises InputError as `from_vox`.
    """
    params.check()
    _, y, x = file.cells.shape
    if not file.cells.any():
        raise InputError("XRAW file", "cells", 0, "export a model that has cells")
    power = np.zeros(len(file.palette))
    return _world(_Box(file.cells, (-(x // 2), -(y // 2), 0), file.palette, power, ()), params)


def from_mesh(
    mesh: Mesh, *, params: MeshParams, progress: workers.Progress = workers.silent
) -> Voxels:
    """Turn a mesh into a world of cubes: every cell that a face touches, and what they enclose.

    Colours and emission are those of the mesh's materials. Raises InputError for knobs out of
    range, for `emissive` materials that the mesh does not have, and for meshes that cannot be used
    (`voxelise`).
    """
    params.check()
    lit = glowing(mesh.checked(), params.emissive)
    found = voxelise.voxelise(lit, grid=params.grid, solid=params.solid, progress=progress)
    used = np.bincount(found.cells.reshape(-1), minlength=len(found.albedo))
    used[0] = 0
    albedo, limited = limited_albedo(found.albedo.astype(np.float64), used)
    quality = {
        "solid": int(used.sum()),
        "glowing": int(used[found.emission.any(axis=1)].sum()),
        "colours": int(np.count_nonzero(used)),
        "closed": found.closed,
        "notes": [*mesh.notes, *found.notes, *limited],
    }
    return Voxels(
        cells=found.cells,
        albedo=albedo,
        emission=found.emission,
        cell_size=found.cell_size,
        origin=found.origin,
        quality=quality,
    ).checked()


def glowing(mesh: Mesh, emissive: Emissive) -> Mesh:
    """Return the mesh with the emission of some materials, by name, replaced. InputError."""
    materials = list(mesh.materials)
    names = [material.name for material in materials]
    for key, values in emissive:
        if key not in names:
            there = ", ".join(sorted(filter(None, names))[:8]) or "none with a name"
            raise InputError("voxels", "emissive", key, f"the mesh's materials are {there}")
        for number, material in enumerate(mesh.materials):
            if material.name == key:
                rgb = values if len(values) == 3 else [values[0] * c for c in material.base_color]
                radiance = (float(rgb[0]), float(rgb[1]), float(rgb[2]))
                materials[number] = replace(material, emissive=radiance)
    return replace(mesh, materials=tuple(materials))


def _world(box: _Box, params: Params) -> Voxels:
    """Turn the axes, decode the colours, mark what glows."""
    # Rows go from far to near, so that +y of the file is -z here
    cells = np.ascontiguousarray(box.cells[:, ::-1].transpose(1, 0, 2), np.uint16)
    used = np.bincount(cells.reshape(-1), minlength=len(box.palette))
    used[0] = 0
    colour = srgb_decode(box.palette[:, :3] / 255)
    emission = colour * (box.power * params.emission_scale)[:, None]
    notes = list(box.notes)
    for key, values in params.emissive:
        rows = _rows(key, box.palette, used)
        emission[rows] = values if len(values) == 3 else colour[rows] * values[0]
    emission[used == 0] = 0
    if emission.max(initial=0.0) > BRIGHTEST:
        remedy = f"stay within {BRIGHTEST:g} W/(m2 sr)"
        raise InputError("voxels", "emission_scale", params.emission_scale, remedy)
    albedo, limited = limited_albedo(colour, used)
    notes += limited
    x, y, z = box.lowest
    depth = box.cells.shape[1]
    lowest = np.array([x, z, -(y + depth)], np.float64) * params.cell_size
    quality = {
        "solid": int(used.sum()),
        "glowing": int(used[emission.any(axis=1)].sum()),
        "colours": int(np.count_nonzero(used)),
        "notes": notes,
    }
    return Voxels(
        cells=cells,
        albedo=albedo,
        emission=emission.astype(np.float32),
        cell_size=float(params.cell_size),
        origin=(float(lowest[0]), float(lowest[1]), float(lowest[2])),
        quality=quality,
    ).checked()


def limited_albedo(colour: Array, used: NDArray[np.int64]) -> tuple[NDArray[np.float32], list[str]]:
    """Return colours (P, 3) of at most `ALBEDO_LIMIT`, 0 in row 0, and what was lowered.

    used : (P,) cells of each row; what no cell has needs no note.
    """
    albedo = np.minimum(colour, ALBEDO_LIMIT).astype(np.float32)
    albedo[0] = 0
    count = int(np.count_nonzero((colour > ALBEDO_LIMIT).any(axis=1) & (used > 0)))
    if not count:
        return albedo, []
    named = "a colour is" if count == 1 else f"{count} colours are"
    return albedo, [f"{named} brighter than albedo {ALBEDO_LIMIT}, the most that light can end in"]


def _rows(key: str, palette: NDArray[np.uint8], used: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return the rows in use that a palette index or a colour names."""
    if _COLOUR.fullmatch(key):
        wanted = [int(key[i : i + 2], 16) for i in (1, 3, 5)]
        chosen = (palette[:, :3] == wanted).all(axis=1)
    elif key.isdecimal() and 1 <= int(key) < min(len(palette), MAX_ROWS):
        chosen = np.arange(len(palette)) == int(key)
    else:
        remedy = f"name a palette index from 1 to {len(palette) - 1}, or a colour as #ffcc00"
        raise InputError("voxels", "emissive", key, remedy)
    rows = np.flatnonzero(chosen & (used > 0))
    if not len(rows):
        common = [f"{row} (#{bytes(palette[row, :3]).hex()})" for row in np.argsort(-used)[:8]
                  if used[row]]  # fmt: skip
        raise InputError(
            "voxels", "emissive", key, f"no cell has it; there are {', '.join(common)}"
        )
    return rows
