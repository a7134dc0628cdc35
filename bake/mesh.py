"""A mesh made ready for the player: checked, without faces of no area, equal materials as one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from formats.errors import InputError
from formats.mesh import Material, Mesh

LARGEST = 1e6
"""Largest coordinate, metres: the player computes in float32."""


@dataclass(frozen=True)
class Params:
    """Knobs: none yet."""


def prepare(mesh: Mesh, *, params: Params, progress: workers.Progress = workers.silent) -> Mesh:
    """Return the mesh with fewer parts to draw and nothing that a card could stumble over.

    Faces whose corners lie on one line, in float32 as the card has them, are dropped, and a note
    says how many. Materials that look the same become one. Raises InputError for a mesh that
    `Mesh.checked` refuses, one beyond `LARGEST` and one of which no face is left.
    """
    found = mesh.checked()
    used = found.vertices[np.unique(found.faces)]
    if used.size and np.abs(used).max() > LARGEST:
        remedy = f"keep coordinates within {LARGEST:g} m of the mesh's origin"
        raise InputError("mesh", "vertices", float(np.abs(used).max()), remedy)
    kept = _with_area(found)
    dropped = int(np.count_nonzero(~kept))
    if dropped == len(kept):
        raise InputError("mesh", "faces", 0, "give a mesh whose faces have area")
    notes = (f"dropped {dropped} faces without area in float32",) if dropped else ()
    material, materials = _merged(found)
    return replace(
        found,
        faces=found.faces[kept],
        normals=found.normals[kept],
        material=material[kept],
        materials=materials,
        notes=(*found.notes, *notes),
    )


def _with_area(mesh: Mesh) -> NDArray[np.bool_]:
    """Tell which faces (m,) have an area when their corners are rounded to float32."""
    rounded = mesh.vertices.astype(np.float32).astype(np.float64)
    a, b, c = (rounded[mesh.faces[:, i]] for i in range(3))
    return np.asarray(np.any(np.cross(b - a, c - a) != 0, axis=1))


def _merged(mesh: Mesh) -> tuple[NDArray[np.int32], tuple[Material, ...]]:
    """Return (m,) numbers into materials that all look different, and those, in order."""
    first: dict[Any, int] = {}
    numbers: list[int] = []
    materials: list[Material] = []
    for each in mesh.materials:
        texture = None if each.texture is None else (each.texture.shape, each.texture.tobytes())
        look = (each.base_color, texture, each.metallic, each.roughness)
        key = (*look, each.double_sided, each.emissive)
        if key not in first:
            first[key] = len(materials)
            materials.append(each)
        numbers.append(first[key])
    return np.array(numbers, np.int32)[mesh.material], tuple(materials)
