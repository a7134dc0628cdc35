"""A triangle mesh with its materials, as a source file declares it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError

LARGEST = 1e100
"""Largest coordinate: its square and the sum of three are still finite."""


@dataclass(frozen=True)
class Material:
    """What a face is made of (glTF 2.0 metallic-roughness).

    base_color : linear rgb, 0..1. texture : (h, w, 3) linear or None, row 0 on top, multiplies it.
    double_sided : a thin sheet, such as a leaf, through which a baker may let light pass.
    """

    name: str = ""
    base_color: tuple[float, float, float] = (0.5, 0.5, 0.5)
    texture: NDArray[np.float32] | None = None
    metallic: float = 0.0
    roughness: float = 0.7
    double_sided: bool = False

    def fault(self) -> str:
        """Return what makes the material unusable, or nothing."""
        numbers = {"metallic": self.metallic, "roughness": self.roughness}
        numbers |= {f"base_color[{i}]": value for i, value in enumerate(self.base_color)}
        for name, value in numbers.items():
            if not 0 <= value <= 1:
                return f"{name} {value} is not from 0 to 1"
        if self.texture is not None:
            texture = np.asarray(self.texture)
            if texture.dtype.kind != "f" or texture.ndim != 3 or texture.shape[2] != 3:
                return f"texture is {texture.dtype} {texture.shape}, not floats (h, w, 3)"
            if not texture.size or not np.all((texture >= 0) & (texture <= 1)):
                return "texture is empty, or not from 0 to 1"
        return ""


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
