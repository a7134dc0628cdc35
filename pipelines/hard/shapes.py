"""Meshes of the matrix: plates, boxes and balls, and what can be wrong with a mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from bake.sources import corner_normals
from formats.mesh import Material, Mesh

WHITE = Material(base_color=(1.0, 1.0, 1.0))


def mesh_of(vertices: ArrayLike, faces: ArrayLike, material: Material = WHITE) -> Mesh:
    """Make a mesh of one material with the normals that a file without any would get."""
    points = np.asarray(vertices, np.float64).reshape(-1, 3)
    triangles = np.asarray(faces, np.int64).reshape(-1, 3)
    return Mesh(
        vertices=points,
        faces=triangles,
        normals=corner_normals(points, triangles).astype(np.float32),
        material=np.zeros(len(triangles), np.int32),
        materials=(material,),
    )


def box(half: ArrayLike = (1.0, 1.0, 1.0)) -> Mesh:
    """Make a box, normals outward."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh_of(signs * half, [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))])


def ball(rings: int = 8, sectors: int = 12) -> Mesh:
    """Make a closed unit ball, poles at +-y."""
    theta, phi = np.pi * np.arange(1, rings) / rings, 2 * np.pi * np.arange(sectors) / sectors
    t, p = np.meshgrid(theta, phi, indexing="ij")
    body = np.stack([np.sin(t) * np.cos(p), np.cos(t), -np.sin(t) * np.sin(p)], axis=-1)
    vertices = np.concatenate([body.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])
    top, bottom, last = len(vertices) - 2, len(vertices) - 1, (rings - 2) * sectors
    j = np.arange(sectors)
    k = (j + 1) % sectors
    faces = [np.stack([np.full_like(j, top), j, k], 1),
             np.stack([np.full_like(j, bottom), last + k, last + j], 1)]  # fmt: skip
    for i in range(rings - 2):
        a, b = i * sectors, (i + 1) * sectors
        faces += [np.stack([a + j, b + j, b + k], 1), np.stack([a + j, b + k, a + k], 1)]
    return mesh_of(vertices, np.concatenate(faces))


def moved(scale: float, offset: float) -> Mesh:
    """Return the ball at another size and place."""
    mesh = ball()
    return mesh_of(mesh.vertices * scale + offset * np.array([0.7, -1.0, 0.3]), mesh.faces)


def inverted() -> Mesh:
    mesh = ball()
    return mesh_of(mesh.vertices, mesh.faces[:, ::-1])


def twice(make: Callable[[], Mesh]) -> Mesh:
    mesh = make()
    return mesh_of(mesh.vertices, np.concatenate([mesh.faces, mesh.faces]))


def without_area() -> Mesh:
    mesh = box()
    zero = [[0, 0, 1], [2, 2, 2], [0, 1, 0]]
    return mesh_of(mesh.vertices, np.concatenate([mesh.faces, zero]))


def needles() -> Mesh:
    mesh = box()
    more = [[-1, 1, -1], [1, 1 + 1e-9, 1], [1, 1 + 2e-9, 1]]
    return mesh_of(
        np.concatenate([mesh.vertices, more]), np.concatenate([mesh.faces, [[8, 9, 10]]])
    )


def with_vertex(*place: float) -> Mesh:
    mesh = box()
    points = mesh.vertices.copy()
    points[3] = place
    # Normals as of the sound box: only the place is broken
    return replace(mesh, vertices=points)


def with_index(index: int) -> Mesh:
    mesh = box()
    faces = mesh.faces.copy()
    faces[5, 1] = index
    return replace(mesh, faces=faces)


def with_normal(*normal: float) -> Mesh:
    mesh = box()
    normals = mesh.normals.copy()
    normals[2, 1] = normal
    return replace(mesh, normals=normals)


def unused() -> Mesh:
    mesh = box()
    return mesh_of(np.concatenate([mesh.vertices, [[1e6, 1e6, 1e6]]]), mesh.faces)


def nothing() -> Mesh:
    return mesh_of(np.zeros((0, 3)), np.zeros((0, 3), np.int64))


Shape = tuple[str, str, str, Callable[[], Mesh]]
SHAPES: tuple[Shape, ...] = (
    ("G4", "faces of no area", "left out or harmless", without_area),
    ("G4b", "every face twice", "as each once", lambda: twice(box)),
    ("G4c", "a needle a billionth as wide as long", "finite", needles),
    ("G5", "a vertex that is NaN", "refused", lambda: with_vertex(np.nan, 0, 0)),
    ("G5b", "a vertex at infinity", "refused", lambda: with_vertex(np.inf, 0, 0)),
    ("G5c", "a vertex at 1e200", "refused", lambda: with_vertex(1e200, 0, 0)),
    ("G6", "a face that names a vertex that is not there", "refused", lambda: with_index(99)),
    ("G6b", "a face that names a vertex below 0", "refused", lambda: with_index(-1)),
    ("G6c", "a shading normal that is NaN", "refused", lambda: with_normal(np.nan, 0, 0)),
    (
        "G7",
        "an open mesh",
        "no assumption of closedness",
        lambda: mesh_of(box().vertices, box().faces[2:]),
    ),
    ("G7b", "a mesh turned inside out", "as the mesh itself", inverted),
    ("G7c", "a single triangle", "a sheet", lambda: mesh_of(np.eye(3), [[0, 1, 2]])),
    ("G8", "a millionth of its size", "the same, scaled, or refused", lambda: moved(1e-6, 0)),
    ("G8b", "a million times its size", "the same, scaled, or refused", lambda: moved(1e6, 0)),
    (
        "G8c",
        "an offset of a million times its size",
        "the same, moved, or refused",
        lambda: moved(1, 1e6),
    ),
    ("G8d", "a vertex that no face uses, far away", "as without it", unused),
    ("G12", "an empty mesh", "refused", nothing),
)
"""Row, case, required behaviour, and the mesh."""
