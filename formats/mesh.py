"""A triangle mesh with its materials: as a source file declares it, and as the player reads it.

Baked, it is `mesh.glb` (one primitive a material, float32, textures as 8-bit sRGB PNG) and a
report.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report, seal
from formats.errors import DamagedError, InputError
from formats.files import glb
from formats.material import BRIGHTEST, Material

__all__ = ["BRIGHTEST", "LARGEST", "Material", "Mesh", "primitives"]

FORMAT = 1
NAME = "mesh.glb"
LARGEST = 1e100
"""Largest coordinate: its square and the sum of three are still finite."""


@dataclass(frozen=True)
class Mesh:
    """Triangles in metres, +y up.

    vertices : (n, 3) float64. faces : (m, 3) int64 into vertices. normals : (m, 3, 3) float32 unit
    shading normals, one a corner. uv : (n, 2) float32 or None, (0, 0) bottom left. colours : (n, 3)
    float32 linear or None. material : (m,) int32 into materials. notes : what the reader mended.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float32]
    material: NDArray[np.int32]
    materials: tuple[Material, ...]
    uv: NDArray[np.float32] | None = None
    colours: NDArray[np.float32] | None = None
    notes: tuple[str, ...] = field(default=())

    def checked(self, where: object = "mesh") -> Mesh:
        """Return the mesh with arrays of the declared types, contiguous and in native byte order.

        Raises InputError for an array of wrong shape or type, an index out of range, and for
        numbers that are not finite or no coordinates, unit normals or colours; `where` names it.
        """
        m, n, count = len(self.faces), len(self.vertices), len(self.materials)
        arrays: dict[str, Any] = {
            "vertices": _floats(self.vertices, np.float64, (n, 3), (-LARGEST, LARGEST)),
            "faces": _integers(self.faces, np.int64, (m, 3), n),
            "normals": _floats(self.normals, np.float32, (m, 3, 3), (-1.01, 1.01)),
            "material": _integers(self.material, np.int32, (m,), count),
        }
        if self.uv is not None:
            arrays["uv"] = _floats(self.uv, np.float32, (n, 2), (-1e9, 1e9))
        if self.colours is not None:
            arrays["colours"] = _floats(self.colours, np.float32, (n, 3), (0.0, 1.0))
        for name, found in arrays.items():
            if isinstance(found, str):
                raise InputError(where, name, found, "repair the mesh")
        for i, material in enumerate(self.materials):
            found = material.fault()
            if found:
                raise InputError(where, f"materials[{i}]", found, "repair the material")
        return replace(self, **arrays)

    def save(self, folder: Path) -> None:
        """Write `mesh.glb` and `report.json` into an existing folder.

        Materials that no face has are left out. Raises InputError for a mesh that `checked` refuses
        and for one without faces.
        """
        path = Path(folder) / NAME
        mesh = self.checked(path)
        used = np.unique(mesh.material).tolist()
        if not used:
            raise InputError(path, "faces", 0, "give a mesh with faces")
        parts = tuple(mesh._primitive(number) for number in used)
        glb.write(path, [glb.Node("mesh", parts)])
        corners = mesh.vertices[np.unique(mesh.faces)]
        names = [{"name": p.material.name, "faces": len(p.indices)} for p in parts]
        found = {
            "format": FORMAT,
            "kind": "mesh",
            "faces": len(mesh.faces),
            "vertices": sum(len(part.positions) for part in parts),
            "materials": names,
            "textures": len({p.material.texture for p in parts} - {None}),
            "emissive": any(max(p.material.emissive) > 0 for p in parts),
            "bounds": [corners.min(axis=0), corners.max(axis=0)],
            "notes": list(mesh.notes),
        }
        report.write(folder, found)

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Mesh:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        # Only meshes with textures need Pillow
        from formats.files import image

        parts = primitives(folder)
        counts = [len(part.positions) for part in parts]
        starts = np.cumsum([0, *counts[:-1]])
        normals = [_stored(folder, p.normals, "normals")[p.indices] for p in parts]
        textures: dict[bytes, NDArray[np.float32]] = {}
        materials = []
        for part in parts:
            data = part.material.texture
            if data is not None and data not in textures:
                textures[data] = image.decode(data, str(Path(folder) / NAME))[..., :3]
            materials.append(Material.of_glb(part.material, textures[data] if data else None))
        uv = None if parts[0].uv is None else [_stored(folder, p.uv, "uv") for p in parts]
        tints = None
        if parts[0].colours is not None:
            tints = [_stored(folder, p.colours, "colours") for p in parts]
        faces = [p.indices + start for p, start in zip(parts, starts, strict=True)]
        numbers = np.repeat(np.arange(len(parts)), [len(p.indices) for p in parts])
        return cls(
            vertices=np.concatenate([p.positions for p in parts]).astype(np.float64),
            faces=np.concatenate(faces).astype(np.int64),
            normals=np.concatenate(normals),
            material=numbers.astype(np.int32),
            materials=tuple(materials),
            uv=None if uv is None else _flipped(np.concatenate(uv)),
            colours=None if tints is None else np.concatenate(tints),
            notes=tuple(report.read(folder).get("notes", ())),
        ).checked(folder)

    def _primitive(self, number: int) -> glb.Primitive:
        """Return the faces of one material; corners that agree in vertex and normal are one."""
        chosen = np.flatnonzero(self.material == number)
        corner = self.faces[chosen].reshape(-1, 1)
        bits = np.ascontiguousarray(self.normals[chosen].reshape(-1, 3) + np.float32(0))
        keys = np.concatenate([corner, bits.view(np.uint32).astype(np.int64)], axis=1)
        _, first, indices = np.unique(
            np.ascontiguousarray(keys, ">i8").view(f"V{8 * keys.shape[1]}").ravel(),
            return_index=True,
            return_inverse=True,
        )
        vertex, material = corner[first, 0], self.materials[number]
        uv = None if self.uv is None else _flipped(self.uv[vertex])
        return glb.Primitive(
            positions=self.vertices[vertex].astype(np.float32),
            indices=indices.reshape(-1, 3),
            normals=bits[first],
            uv=uv,
            colours=None if self.colours is None else self.colours[vertex],
            material=material.as_glb(textured=self.uv is not None),
        )


def primitives(folder: Path) -> tuple[glb.Primitive, ...]:
    """Read the parts of a folder that `Mesh.save` wrote, as they lie in it: one a material.

    Raises DamagedError where its bytes changed or are of another kind or format.
    """
    data, path = report.read(folder), Path(folder) / NAME
    if data.get("kind") != "mesh" or data.get("format") != FORMAT:
        found = f"{data.get('kind')} of format {data.get('format')}"
        raise DamagedError(folder, "kind", found, "bake the mesh again")
    if seal.is_sealed(folder):
        seal.read_bytes(folder, NAME)
    parts = tuple(part for node in glb.read(path) for part in node.primitives)
    if not parts or any((p.uv is None, p.colours is None) != _lacking(parts[0]) for p in parts):
        raise DamagedError(path, "primitives", len(parts), "bake the mesh again")
    return parts


def _flipped(uv: NDArray[np.float32]) -> NDArray[np.float32]:
    """Turn coordinates (n, 2) from bottom left to top left, and back."""
    return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)


def _lacking(part: glb.Primitive) -> tuple[bool, bool]:
    return part.uv is None, part.colours is None


def _stored(folder: Path, values: NDArray[Any] | None, name: str) -> NDArray[np.float32]:
    if values is None or values.dtype.kind != "f":
        raise DamagedError(Path(folder) / NAME, name, "missing", "bake the mesh again")
    return values.astype(np.float32)


def _floats(
    values: Any, kind: type[np.floating], shape: tuple[int, ...], limits: tuple[float, float]
) -> NDArray[Any] | str:
    """Return the array as `kind`, or what is wrong with it."""
    array = np.asarray(values)
    if array.dtype.kind != "f" or array.shape != shape:
        return f"{array.dtype} {array.shape}, not floats {shape}"
    low, high = limits
    if not np.all((array >= low) & (array <= high)):
        return f"not finite, or not from {low:g} to {high:g}"
    return np.ascontiguousarray(array, kind)


def _integers(
    values: Any, kind: type[np.integer], shape: tuple[int, ...], count: int
) -> NDArray[Any] | str:
    """Return the array of indices into `count` things as `kind`, or what is wrong with it."""
    array = np.asarray(values)
    if array.dtype.kind not in "iu" or array.shape != shape:
        return f"{array.dtype} {array.shape}, not integers {shape}"
    if array.size and (array.min() < 0 or array.max() >= count):
        return f"indices from {array.min()} to {array.max()}, not below {count}"
    return np.ascontiguousarray(array, kind)
