"""Triangles cut until no edge is longer than a limit, so that what vertices hold is dense enough.

An edge is halved or not by its own length alone, so both faces beside it cut it alike and nothing
tears; a face turns into two, three or four.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.mesh import Mesh

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST_FACES = 1 << 22
"""Faces that a mesh may be cut into."""
# Faces of corners 0 1 2 and middles 3 (of 0-1), 4 (1-2), 5 (2-0), by how many edges are halved
CUTS = {
    1: [(0, 3, 2), (3, 1, 2)],
    2: [(3, 1, 4), (0, 3, 4), (0, 4, 2)],
    3: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
}


def subdivide(mesh: Mesh, longest: float) -> Mesh:
    """Halve the edges longer than `longest` metres, again and again, until none is.

    Normals, texture coordinates and colours are interpolated. Raises InputError where that would
    take more than MOST_FACES faces.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, i]] / longest for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    # No triangle with such edges has more area than the one with three of them
    _check(longest, float(np.sum(area / (0.25 * np.sqrt(3)))))
    while True:
        faces = mesh.faces
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)
        apart = mesh.vertices[ends[..., 0]] - mesh.vertices[ends[..., 1]]
        long = np.einsum("meh,meh->me", apart, apart) > longest * longest
        if not long.any():
            return mesh
        _check(longest, len(faces) + int(long.sum()))
        mesh = _halved(mesh, np.sort(ends, axis=-1), long)


def _check(longest: float, faces: float) -> None:
    if faces > MOST_FACES:
        remedy = f"raise edge: it would cut the mesh into over {MOST_FACES} faces"
        raise InputError("transfer", "edge", longest, remedy)


def _halved(mesh: Mesh, ends: Indices, long: NDArray[np.bool_]) -> Mesh:
    """Halve the edges chosen by `long` (m, 3); ends : (m, 3, 2) vertices, sorted."""
    pairs, number = np.unique(ends[long], axis=0, return_inverse=True)
    middle = np.full(long.shape, -1)
    middle[long] = len(mesh.vertices) + number.reshape(-1)
    count = long.sum(axis=1)
    # Turn each face so that its halved edges come first
    first = np.where(count == 1, np.argmax(long, axis=1), (np.argmin(long, axis=1) + 1) % 3)
    order = (first[:, None] + np.arange(3)) % 3
    corner = np.take_along_axis(mesh.faces, order, axis=1)
    six = np.concatenate([corner, np.take_along_axis(middle, order, axis=1)], axis=1)
    normal = np.take_along_axis(mesh.normals, order[..., None], axis=1)
    normals = np.concatenate([normal, _unit(normal + np.roll(normal, -1, axis=1))], axis=1)
    whole = count == 0
    faces, turned, kinds = [mesh.faces[whole]], [mesh.normals[whole]], [mesh.material[whole]]
    for cuts, triangles in CUTS.items():
        own = count == cuts
        for triangle in triangles:
            faces.append(six[own][:, triangle])
            turned.append(normals[own][:, triangle])
            kinds.append(mesh.material[own])
    return replace(
        mesh,
        vertices=_blended(mesh.vertices, pairs),
        faces=np.concatenate(faces),
        normals=np.concatenate(turned),
        material=np.concatenate(kinds),
        uv=None if mesh.uv is None else _blended(mesh.uv, pairs),
        colours=None if mesh.colours is None else _blended(mesh.colours, pairs),
    )


def _blended(values: NDArray[Any], pairs: Indices) -> NDArray[Any]:
    """Append the means of pairs of rows."""
    half = values.dtype.type(0.5)
    return np.concatenate([values, half * values[pairs[:, 0]] + half * values[pairs[:, 1]]])


def _unit(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Scale (..., 3) to unit length; opposite normals leave none, and the first axis stands in."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    whole = length > 1e-6
    safe = np.where(whole, vectors / np.where(whole, length, 1), np.array([1, 0, 0], np.float32))
    return np.asarray(safe, np.float32)
