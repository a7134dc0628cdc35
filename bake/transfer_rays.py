"""Cosine-spread rays of a mesh's own vertices: what they hide, and what they see of the mesh.

A vertex's rays start inside the faces about it, a hundredth of their size from the vertex and in
turn: so the foot of a wall is on the floor's side of it. Starts are lifted on to the surface that
the normals promise, so that rounded things don't shade themselves along their facets.

References
----------
Hanika 2021, Hacking the Shadow Terminator, Ray Tracing Gems II, ch. 4 (the lift).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import occlusion_rays
from bake.rays import Hits, RayScene, offset_origins
from maths import spherical_harmonics
from maths.hashing import uniform01
from maths.sampling import GOLDEN_ANGLE

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

TILE = 1 << 16  # rays in memory at once, a thread: 3 MB
INWARD = 0.01  # of a face, how far from the vertex its rays start
PHI = 0.6180339887498949  # spreads a vertex's rays over its faces


@dataclass(frozen=True)
class Starts:
    """Where rays start.

    points : (3 m, 3) float32, unit space, one a corner.  corners, first, count : the corners of
    vertex v are corners[first[v] :][: count[v]].  around : (n, 3) Euler angles that turn +z to a
    vertex's normal, with a spin of its own.  turn : (n,) which of its corners comes first, 0 to 1.
    """

    points: Float
    corners: Indices
    first: Indices
    count: Indices
    around: Array
    turn: Array


def starts_of(
    scene: RayScene, faces: Indices, normals: Float, vertices: int, salt: int, number: int = 0
) -> Starts:
    """Return where the rays of vertices start; faces : (m, 3), normals : (n, 3) unit.

    number : each has spins of its own.
    """
    weights = np.full((3, 3), INWARD) + (1 - 3 * INWARD) * np.eye(3)
    corners = scene.corners.astype(np.float64)
    points = np.einsum("kc,mci->mki", weights, corners)
    own = normals[faces].astype(np.float64)
    # How far a start lies under the tangent plane of each corner
    depth = np.einsum("mkci,mci->mkc", points[:, :, None] - corners[:, None], own)
    points -= np.einsum("kc,mkc,mci->mki", weights, np.minimum(depth, 0), own)
    geometric = np.repeat(scene.normals()[:, None], 3, axis=1)
    away = np.einsum("mki,mki->mk", geometric.astype(np.float64), own) < 0
    geometric[away] *= -1
    flat = points.reshape(-1, 3).astype(np.float32)
    count = np.bincount(faces.ravel(), minlength=vertices)
    x, y, z = normals.astype(np.float64).T
    keys = np.arange(vertices) + number * vertices
    spin = 2 * np.pi * uniform01(keys, salt)
    around = np.stack([np.arctan2(y, x), np.arctan2(np.hypot(x, y), z), spin], axis=1)
    return Starts(
        points=offset_origins(flat, geometric.reshape(-1, 3)),
        corners=np.argsort(faces.ravel(), kind="stable"),
        first=np.cumsum(count) - count,
        count=count,
        around=around,
        turn=uniform01(keys, 1),
    )


def spiral(count: int) -> Array:
    """Spread `count` unit vectors (count, 3) about +z with density cos / pi: Vogel's sunflower,
    lifted on to the sphere. The even ones of the spiral come first, then the odd ones."""
    order = np.concatenate([np.arange(0, count, 2), np.arange(1, count, 2)])
    square = (order + 0.5) / count
    ring, phi = np.sqrt(square), order * GOLDEN_ANGLE
    return np.stack([ring * np.cos(phi), ring * np.sin(phi), np.sqrt(1 - square)], axis=-1)


@dataclass(frozen=True)
class Pattern:
    """directions : (N, 3) float32 about +z.  basis : (K, N), harmonics times pi / N."""

    directions: Float
    basis: Array


def pattern(rays: int, l_max: int) -> Pattern:
    """Return the rays that all vertices share, and their harmonics."""
    directions = spiral(rays)
    basis = spherical_harmonics.evaluate(directions, l_max).T * (np.pi / rays)
    return Pattern(directions.astype(np.float32), np.ascontiguousarray(basis))


def rays_of(starts: Starts, shape: Pattern, vertices: Indices) -> tuple[Float, Float]:
    """Return origins and directions (N v, 3) of some vertices, ray by ray."""
    n = len(shape.directions)
    turn = starts.turn[vertices][None] + PHI * np.arange(n)[:, None]
    count = starts.count[vertices]
    which = np.minimum((np.mod(turn, 1.0) * count).astype(np.int64), count - 1)
    corner = starts.corners[starts.first[vertices] + which]
    frames = occlusion_rays.frames_of(starts.around[vertices]).astype(np.float32)
    directions = np.einsum("vij,nj->nvi", frames, shape.directions)
    return starts.points[corner].reshape(-1, 3), np.ascontiguousarray(directions.reshape(-1, 3))


def hidden(
    starts: Starts, shape: Pattern, vertices: Indices, hits: NDArray[np.bool_], l_max: int
) -> tuple[Float, Float]:
    """Return (K, v) of what hits (N v,) hide of the clamped cosine, and (v, l_max + 1) the mean
    square of each band's coefficients by which half of the rays differs from the other."""
    n, v = len(shape.directions), len(vertices)
    seen, half = hits.reshape(n, v).astype(np.float64), (n + 1) // 2
    one = shape.basis[:, :half] @ seen[:half]
    two = shape.basis[:, half:] @ seen[half:]
    around = starts.around[vertices]
    whole = occlusion_rays.turned(one + two, around, l_max).astype(np.float32)
    # A turn keeps the sum of squares of each band
    apart = occlusion_rays.by_bands(np.square(one - two))
    return whole, np.ascontiguousarray(apart.T, np.float32)


def fronts(hits: Hits, normals: Float, directions: Float) -> NDArray[np.bool_]:
    """Tell which hits (n,) meet the front of their face."""
    facing = np.einsum("ni,ni->n", normals.take(hits.face, axis=0), directions)
    return np.asarray((hits.face >= 0) & (facing < 0))
