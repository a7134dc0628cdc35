"""Meshes so small that a test can know the answer: plates, boxes, spheres."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bake import sources
from formats.mesh import Material, Mesh

WHITE = Material(base_color=(1.0, 1.0, 1.0))


def mesh_of(
    vertices: ArrayLike, faces: ArrayLike, material: Material = WHITE, **arrays: Any
) -> Mesh:
    """Make a mesh of one material with the normals that a file without any would get."""
    points, triangles = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    return Mesh(
        vertices=points,
        faces=triangles,
        normals=sources.corner_normals(points, triangles).astype(np.float32),
        material=np.zeros(len(triangles), np.int32),
        materials=(material,),
        **arrays,
    )


def joined(*meshes: Mesh) -> Mesh:
    """Put meshes into one, as a file with several parts is."""
    from pathlib import Path

    return sources._joined(list(meshes), Path("joined"))


def plate(
    normal: ArrayLike = (0.0, 0.0, 1.0),
    centre: ArrayLike = (0.0, 0.0, 0.0),
    half: float = 1.0,
    material: Material = WHITE,
) -> Mesh:
    """Make a square whose front looks along `normal`, sides about as level as they can be."""
    n = np.asarray(normal, np.float64) / np.linalg.norm(normal)
    right = np.cross([0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [0.0, 0.0, 1.0], n)
    right /= np.linalg.norm(right)
    up = np.cross(n, right)
    corners = [(-right - up), (right - up), (right + up), (-right + up)]
    points = np.asarray(centre) + half * np.array(corners)
    return mesh_of(points, [[0, 1, 2], [0, 2, 3]], material)


def box(half: ArrayLike = (1.0, 1.0, 1.0), centre: ArrayLike = (0.0, 0.0, 0.0)) -> Mesh:
    """Make a box, normals outward."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return mesh_of(np.asarray(centre) + signs * np.asarray(half), faces)


def sphere_arrays(rings: int = 16, sectors: int = 32) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return vertices and faces of a closed unit sphere about the origin, poles at +-y."""
    theta = np.pi * np.arange(1, rings) / rings
    phi = 2 * np.pi * np.arange(sectors) / sectors
    t, p = np.meshgrid(theta, phi, indexing="ij")
    body = np.stack([np.sin(t) * np.cos(p), np.cos(t), -np.sin(t) * np.sin(p)], axis=-1)
    vertices = np.concatenate([body.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])
    top, bottom, faces = len(vertices) - 2, len(vertices) - 1, []
    for j in range(sectors):
        k = (j + 1) % sectors
        last = (rings - 2) * sectors
        faces += [(top, j, k), (bottom, last + k, last + j)]
        for i in range(rings - 2):
            a, b = i * sectors, (i + 1) * sectors
            faces += [(a + j, b + j, b + k), (a + j, b + k, a + k)]
    return vertices, np.array(faces)


def sphere(rings: int = 16, sectors: int = 32, material: Material = WHITE) -> Mesh:
    """Make a unit sphere with smooth normals."""
    return mesh_of(*sphere_arrays(rings, sectors), material)


def directions(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Draw unit vectors evenly over the sphere."""
    vectors = rng.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
