"""A mesh made ready to carry numbers at vertices: one normal each, both sides of thin faces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.mesh import Mesh

Float = NDArray[np.float32]
Indices = NDArray[np.int64]

LEAST = 1e-3
"""Shortest normal that still is a direction."""


def split(mesh: Mesh) -> Mesh:
    """Return the mesh with vertices that have one normal each; unused ones are gone.

    Normals without length become those of their faces.
    """
    mesh = replace(mesh, normals=_sound(mesh))
    bits = np.ascontiguousarray(mesh.normals.reshape(-1, 3) + np.float32(0)).view(np.int32)
    keys = np.concatenate([mesh.faces.reshape(-1, 1), bits.astype(np.int64)], axis=1)
    found, first, corner = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    vertex = found[:, 0]
    return replace(
        mesh,
        vertices=mesh.vertices[vertex],
        faces=corner.reshape(-1, 3).astype(np.int64),
        normals=mesh.normals.reshape(-1, 3)[first][corner.reshape(-1, 3)],
        uv=None if mesh.uv is None else mesh.uv[vertex],
        colours=None if mesh.colours is None else mesh.colours[vertex],
    )


def _sound(mesh: Mesh) -> Float:
    """Return the normals (m, 3, 3), those of the faces for what is no direction."""
    short = np.abs(mesh.normals).max(axis=2) < LEAST
    if not short.any():
        return mesh.normals
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    size = np.maximum(np.abs(b - a), np.abs(c - a)).max(axis=1, keepdims=True)
    across = np.cross((b - a) / size, (c - a) / size)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.where(short[..., None], across[:, None], mesh.normals).astype(np.float32)


def two_sided(mesh: Mesh) -> Mesh:
    """Return the mesh with a twin, turned round, behind each face of a double-sided material."""
    chosen = np.flatnonzero(_thin(mesh))
    if not len(chosen):
        return mesh
    vertex, corner = np.unique(mesh.faces[chosen], return_inverse=True)
    faces = (len(mesh.vertices) + corner.reshape(-1, 3))[:, ::-1]

    def more(values: NDArray[Any] | None) -> NDArray[Any] | None:
        return None if values is None else np.concatenate([values, values[vertex]])

    return replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, mesh.vertices[vertex]]),
        faces=np.concatenate([mesh.faces, faces]),
        normals=np.concatenate([mesh.normals, -mesh.normals[chosen][:, ::-1]]),
        material=np.concatenate([mesh.material, mesh.material[chosen]]),
        uv=more(mesh.uv),
        colours=more(mesh.colours),
    )


def twins(single: Mesh, whole: Mesh) -> Indices:
    """Return the face (m,) behind each face of `single` in `whole`, -1 where there is none."""
    found = np.full(len(single.faces), -1)
    found[_thin(single)] = np.arange(len(single.faces), len(whole.faces))
    return found


def normals_of(mesh: Mesh) -> Float:
    """Return the normals (n, 3) of a mesh whose vertices have one each."""
    found = np.zeros((len(mesh.vertices), 3), np.float32)
    found[mesh.faces.ravel()] = mesh.normals.reshape(-1, 3)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _thin(mesh: Mesh) -> NDArray[np.bool_]:
    return np.array([m.double_sided for m in mesh.materials], bool)[mesh.material]
