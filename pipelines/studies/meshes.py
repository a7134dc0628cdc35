"""Meshes that studies measure on, as sources of the store: one made here, others read once."""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bake import sources
from bake.recipe import Source
from formats.mesh import Material, Mesh


def source(path: Path) -> Source[Mesh]:
    """Return a mesh file as an input of a stage."""
    return Source(sources.files(path), partial(loaded, path))


def own() -> Source[Mesh]:
    """Return the knot as an input of a stage: its code is what it is made from."""
    return Source((), knot)


@lru_cache(maxsize=8)
def loaded(path: Path) -> Mesh:
    """Read a mesh file, once."""
    return sources.load(path)


@lru_cache(maxsize=2)
def knot(around: int = 500, across: int = 70) -> Mesh:
    """Return a closed coloured (2, 3) torus knot of 2 * around * across faces, about a metre tall.

    It shadows itself from every side. Its hue turns twice along the tube.
    """
    u, v = (2 * np.pi * np.arange(n) / n for n in (around, across))
    centre = _knot_curve(u)
    # A frame that closes: the curve's own normal made square to its tangent
    tangent = _unit(_knot_curve(u + 1e-4) - _knot_curve(u - 1e-4))
    outward = np.stack([np.cos(2 * u), np.zeros_like(u), np.sin(2 * u)], axis=1)
    normal = _unit(outward - np.einsum("ij,ij->i", outward, tangent)[:, None] * tangent)
    other = np.cross(tangent, normal)
    # Ribs, so that there is detail of a few texels
    radius = 0.17 * (1 + 0.12 * np.cos(7 * v)[None, :] * np.cos(24 * u)[:, None])
    ring = np.cos(v)[None, :, None] * normal[:, None] + np.sin(v)[None, :, None] * other[:, None]
    vertices = (centre[:, None] + radius[..., None] * ring).reshape(-1, 3)
    vertices[:, 1] -= vertices[:, 1].min()
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    corners = [
        ((i + a) % around) * across + (j + b) % across for a, b in ((0, 0), (0, 1), (1, 1), (1, 0))
    ]
    a, b, c, d = (corner.ravel() for corner in corners)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    hue = np.repeat(2 * u, across)
    colours = 0.45 + 0.4 * np.stack([np.sin(hue + k * 2 * np.pi / 3) for k in range(3)], axis=1)
    return Mesh(
        vertices=vertices,
        faces=faces,
        normals=sources.corner_normals(vertices, faces).astype(np.float32),
        material=np.zeros(len(faces), np.int32),
        materials=(Material("glaze", (1.0, 1.0, 1.0)),),
        colours=colours.astype(np.float32),
    )


def _knot_curve(u: NDArray[np.float64]) -> NDArray[np.float64]:
    wide = 0.42 * (1 + 0.42 * np.cos(3 * u))
    return np.stack([wide * np.cos(2 * u), 0.42 * np.sin(3 * u), wide * np.sin(2 * u)], axis=1)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
