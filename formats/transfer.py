"""A mesh that carries, at each vertex, what it makes of light from every direction: `transfer.glb`.

Custom attributes `_TRANSFER_n` of four numbers each hold the components of a vertex's transfer
vector, 8-bit signed codes or half floats (as uint16: glTF has no half floats). The basis and scales
are in the report.

References
----------
Sloan, Kautz, Snyder 2002, Precomputed Radiance Transfer (transfer vectors).
Sloan, Hall, Hart, Snyder 2003, Clustered Principal Components (vectors as few components).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from formats import report, seal
from formats.errors import DamagedError, InputError
from formats.files import glb
from formats.mesh import Mesh
from formats.occlusion import decode

FORMAT = 1
KIND = "transfer"
NAME = "transfer.glb"
ATTRIBUTE = "_TRANSFER_"
MOST_VOLUMES = 8
"""Attributes of four numbers: cards take sixteen attributes in all, and a mesh may use four."""
AGAIN = "bake the mesh again"

Float = NDArray[np.float32]
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Layout:
    """How codes become irradiance.

    scales : (4 P,) float32 of P attributes, 0 past the components in use.  basis : (J, C, K), C = 1
    where all colours are alike, else 3: vector = (values * scales) @ basis.  box : (2, 3) metres,
    lowest and highest corner of the mesh: lights are taken at the middles of its six sides, and
    vary linearly in between.  depth : bits, 8 or 16.
    """

    scales: Float
    basis: Array
    box: Array
    depth: int

    @property
    def l_max(self) -> int:
        """Highest band."""
        return isqrt(self.basis.shape[2]) - 1

    def constants(self, light: ArrayLike) -> Array:
        """Return the weights (..., 4 P, 3) of stored values under lights, the scales folded in.

        light : (..., K, 3), radiance coefficients in the mesh's frame. A vertex's
        `values @ constants` is its irradiance, W/m^2.
        """
        by_channel = np.swapaxes(np.asarray(light, np.float64), -1, -2)
        weights = np.sum(self.basis * by_channel[..., None, :, :], axis=-1)
        found = np.zeros((*weights.shape[:-2], len(self.scales), 3))
        found[..., : len(self.basis), :] = weights
        return np.asarray(found * self.scales[:, None].astype(np.float64))

    @property
    def centre(self) -> Array:
        """Middle (3,) of the box."""
        return np.asarray(self.box[0] / 2 + self.box[1] / 2)

    @property
    def scale(self) -> Array:
        """Factors (3,) that make the box +-1 about its middle; 0 along what has no extent."""
        half = self.box[1] / 2 - self.box[0] / 2
        return np.where(half > 0, 1 / np.where(half > 0, half, 1), 0)

    @property
    def points(self) -> Array:
        """Where lights are taken (6, 3): the middles of the sides -x, +x, -y, +y, -z, +z."""
        found = np.repeat(self.centre[None], 6, axis=0)
        for axis in range(3):
            found[2 * axis : 2 * axis + 2, axis] = self.box[:, axis]
        return found

    def decoded(self, codes: NDArray[Any]) -> Float:
        """Return the vectors (n, C, K) that codes (n, 4 P) stand for."""
        J = len(self.basis)
        values = decode(codes)[:, :J] * self.scales[:J]
        return np.asarray(np.einsum("nj,jck->nck", values, self.basis), np.float32)

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Layout:
        """Read the report of a folder that `Transfer.save` wrote. DamagedError for another kind."""
        found = _report(folder)["layout"]
        bands = (found["l_max"] + 1) ** 2
        basis = np.asarray(found["basis"], np.float64).reshape(-1, found["channels"], bands)
        box = np.asarray(found["box"], np.float64)
        return cls(np.asarray(found["scales"], np.float32), basis, box, found["depth"])


@dataclass(frozen=True, eq=False)
class Transfer:
    """A mesh with transfer.

    mesh : each vertex has one normal. codes : (n, 4 P) uint8 or float16 for its vertices.
    """

    mesh: Mesh
    codes: NDArray[Any]
    layout: Layout
    quality: dict[str, Any] = field(default_factory=dict)

    def decoded(self) -> Float:
        """Return the vectors (n, C, K) that the codes stand for."""
        return self.layout.decoded(self.codes)

    def irradiance(self, light: ArrayLike) -> Array:
        """Return (n, 3), W/m^2, under light (6, K, 3) at the layout's points, in the mesh's frame:
        the twin of `transfer.vert`. Bands left out may make it negative; pixels clamp it."""
        constants = self.layout.constants(linear(np.asarray(light, np.float64)))
        parts = decode(self.codes).astype(np.float64) @ constants
        place = (self.mesh.vertices - self.layout.centre) * self.layout.scale
        return np.asarray(parts[0] + np.einsum("na,anc->nc", place, parts[1:]))

    def save(self, folder: Path) -> None:
        """Write `transfer.glb` and `report.json` into an existing folder.

        Raises InputError for a mesh that `Mesh.checked` refuses and for one without faces.
        """
        path = Path(folder) / NAME
        mesh = self.mesh.checked(path)
        used = np.unique(mesh.material).tolist()
        if not used:
            raise InputError(path, "faces", 0, "give a mesh with faces")
        parts = tuple(self._primitive(mesh, number) for number in used)
        glb.write(path, [glb.Node("mesh", parts)])
        corners = mesh.vertices[np.unique(mesh.faces)]
        layout = {
            "l_max": self.layout.l_max,
            "channels": self.layout.basis.shape[1],
            "components": len(self.layout.basis),
            "depth": self.layout.depth,
            "box": self.layout.box,
            "scales": self.layout.scales,
            "basis": self.layout.basis.reshape(len(self.layout.basis), -1),
        }
        found = {
            "format": FORMAT,
            "kind": KIND,
            "faces": len(mesh.faces),
            "vertices": sum(len(part.positions) for part in parts),
            "emissive": any(max(p.material.emissive) > 0 for p in parts),
            "bounds": [corners.min(axis=0), corners.max(axis=0)],
            "layout": layout,
            "quality": self.quality,
            "notes": list(mesh.notes),
        }
        report.write(folder, found)

    def _primitive(self, mesh: Mesh, number: int) -> glb.Primitive:
        """Return the faces of one material."""
        chosen = mesh.faces[mesh.material == number]
        vertex, indices = np.unique(chosen, return_inverse=True)
        normals = np.zeros((len(mesh.vertices), 3), np.float32)
        normals[mesh.faces.ravel()] = mesh.normals.reshape(-1, 3)
        uv = None
        if mesh.uv is not None:
            uv = np.stack([mesh.uv[vertex, 0], 1 - mesh.uv[vertex, 1]], axis=1)
        codes = self.codes.view(np.uint16) if self.layout.depth == 16 else self.codes
        custom = {
            f"{ATTRIBUTE}{i // 4}": np.ascontiguousarray(codes[vertex, i : i + 4])
            for i in range(0, codes.shape[1], 4)
        }
        return glb.Primitive(
            positions=mesh.vertices[vertex].astype(np.float32),
            indices=indices.reshape(-1, 3),
            normals=normals[vertex],
            uv=uv,
            colours=None if mesh.colours is None else mesh.colours[vertex],
            attributes=custom,
            material=mesh.materials[number].as_glb(textured=mesh.uv is not None),
        )


def primitives(folder: Path) -> tuple[glb.Primitive, ...]:
    """Read the parts of a folder that `Transfer.save` wrote, codes as stored, half floats as such.

    Raises DamagedError where its bytes changed or are of another kind or format.
    """
    depth, path = _report(folder)["layout"]["depth"], Path(folder) / NAME
    if seal.is_sealed(folder):
        seal.read_bytes(folder, NAME)
    parts = tuple(part for node in glb.read(path) for part in node.primitives)
    kind = np.uint16 if depth == 16 else np.uint8
    for part in parts:
        stored = codes_of(part)
        if not stored or any(c.dtype != kind or c.shape[1:] != (4,) for c in stored):
            raise DamagedError(path, ATTRIBUTE, "missing", AGAIN)
    if not parts:
        raise DamagedError(path, "primitives", 0, AGAIN)
    return parts


def linear(light: Array) -> Array:
    """Return (4, ...), value at the middle and slopes along x, y and z to the sides of a box, of
    what is given at the middles of its six sides (6, ...)."""
    pairs = light.reshape(3, 2, *light.shape[1:])
    return np.concatenate([light.mean(axis=0)[None], (pairs[:, 1] - pairs[:, 0]) / 2])


def codes_of(part: glb.Primitive) -> list[NDArray[Any]]:
    """Return the codes (n, 4) of each attribute of a part, in order."""
    count = sum(name.startswith(ATTRIBUTE) for name in part.attributes)
    return [part.attributes[f"{ATTRIBUTE}{i}"] for i in range(count)]


def _report(folder: Path) -> dict[str, Any]:
    data = report.read(folder)
    if data.get("kind") != KIND or data.get("format") != FORMAT:
        found = f"{data.get('kind')} of format {data.get('format')}"
        raise DamagedError(folder, "kind", found, AGAIN)
    return data
