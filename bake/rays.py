"""Rays against triangles: the one place that calls Embree.

embreex reads out of bounds without a word, drops triangles with NaN vertices in silence, and each
of Embree's modes has scales at which it misses everything. So every array is checked here, and
every scene is moved to the origin and scaled to unit size in float64 first; rays are then given in
that *unit space*. Mode is robust: the fast one lets 5 % of rays aimed at edges through a closed
sphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float32]


@dataclass(frozen=True)
class Hits:
    """Where rays end: face (n,) int32, -1 for a miss; u, v (n,) barycentric weights of the face's
    second and third corner; distance (n,) in unit space."""

    face: NDArray[np.int32]
    u: Float
    v: Float
    distance: Float

    def pick(self, which: NDArray[np.int64]) -> Hits:
        """Return some of the hits."""
        return Hits(self.face[which], self.u[which], self.v[which], self.distance[which])

    @cached_property
    def weights(self) -> Float:
        """Barycentric weights (n, 3) of the face's corners."""
        return np.stack([1 - self.u - self.v, self.u, self.v], axis=1)


class RayScene:
    """A committed Embree scene of one mesh.

    vertices : (n, 3) finite, any scale and offset. faces : (m, 3) indices into them.
    Raises ValueError on bad shapes, non-finite vertices or indices out of range.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        points, triangles = checked_mesh(vertices, faces)
        low, high = (points.min(0), points.max(0)) if len(points) else (np.zeros(3), np.zeros(3))
        self.centre: NDArray[np.float64] = low / 2 + high / 2
        half = float(np.max(high / 2 - low / 2, initial=0.0))
        self.scale = 1 / half if half > 0 else 1.0
        self.corners: Float = self.to_unit(points)[triangles]
        self._scene: Any = EmbreeScene(robust=True)
        if len(triangles):
            self._mesh = TriangleMesh(self._scene, self.to_unit(points), triangles.astype(np.int32))
        # Commit now: the first query commits, and queries come from several threads
        self._scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32), query="OCCLUDED")

    def to_unit(self, points: ArrayLike) -> Float:
        """Map points (..., 3) of the mesh's own space to unit space."""
        moved = (np.asarray(points, np.float64) - self.centre) * self.scale
        return np.ascontiguousarray(moved, np.float32)

    def intersect(self, origins: Float, directions: Float, *, finite: bool = False) -> Hits:
        """Find the first face along each ray; one direction (1, 3) may serve all origins.

        finite : the caller knows all values to be sound.
        """
        check_rays(origins, directions, finite=finite)
        found = self._scene.run(origins, directions, query="INTERSECT", output=True)
        return Hits(found["primID"], found["u"], found["v"], found["tfar"])

    def occluded(
        self, origins: Float, directions: Float, *, finite: bool = False
    ) -> NDArray[np.bool_]:
        """Tell which rays meet anything; one direction (1, 3) may serve all origins.

        finite : the caller knows all values to be sound, such as hit points of this scene.
        """
        check_rays(origins, directions, finite=finite)
        blocked: NDArray[np.bool_] = self._scene.run(origins, directions, query="OCCLUDED") == 0
        return blocked

    def points(self, hits: Hits) -> Float:
        """Return the hit points (n, 3) in unit space, from the corners: exact to a few ULP."""
        return blend(hits.weights, self.corners.take(hits.face, axis=0))

    def normals(self) -> Float:
        """Return the unit geometric normals (m, 3), counter-clockwise faces looking outward."""
        a, b, c = (self.corners[:, i].astype(np.float64) for i in range(3))
        normal = np.cross(b - a, c - a)
        length = np.sqrt(np.einsum("ij,ij->i", normal, normal))[:, None]
        unit = np.divide(normal, length, where=length > 0, out=np.zeros_like(normal))
        return np.asarray(unit, np.float32)


def blend(weights: Float, corners: Float) -> Float:
    """Return the weighted sum (n, c) of what three corners have, (n, 3) and (n, 3, c)."""
    return np.asarray(np.einsum("ni,nij->nj", weights, corners))


def offset_origins(points: Float, normals: Float) -> Float:
    """Move points off their surface along geometric normals, both (n, 3): rays don't meet it again.

    Integer steps of the last place far from the origin, a small float step near it (Waechter and
    Binder, *A Fast and Robust Method for Avoiding Self-Intersection*, Ray Tracing Gems 2019, ch.
    6).
    """
    points = np.ascontiguousarray(points, np.float32)
    steps = (np.float32(256) * normals).astype(np.int32)
    steps = np.where(points < 0, -steps, steps)
    far = (points.view(np.int32) + steps).view(np.float32)
    near = points + np.float32(1 / 65536) * normals
    return np.where(np.abs(points) < np.float32(1 / 32), near, far)


def checked_mesh(
    vertices: ArrayLike, faces: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices as (n, 3) float64 and faces as (m, 3) int64, or raise ValueError."""
    points = np.asarray(vertices, np.float64)
    triangles = np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"vertices must have shape (n, 3), not {points.shape}")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise ValueError(
            f"faces must be integers of shape (m, 3), not {triangles.shape} {triangles.dtype}"
        )
    if not np.isfinite(points).all():
        raise ValueError(f"{np.count_nonzero(~np.isfinite(points).all(1))} vertices are not finite")
    if triangles.size and (triangles.min() < 0 or triangles.max() >= len(points)):
        span = f"from {triangles.min()} to {triangles.max()}"
        raise ValueError(f"face indices run {span}, of {len(points)} vertices")
    return points, triangles.astype(np.int64)


def check_rays(origins: Float, directions: Float, *, finite: bool = False) -> None:
    """Refuse ray arrays that Embree would misread: ValueError. finite : values are known to be
    sound; types and shapes, which Embree would read out of bounds, are checked all the same."""
    for name, array in (("origins", origins), ("directions", directions)):
        if array.dtype != np.float32 or array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(
                f"{name} must be float32 of shape (n, 3), not {array.dtype} {array.shape}"
            )
    if len(directions) not in (1, len(origins)):
        raise ValueError(f"{len(directions)} directions do not fit {len(origins)} origins")
    if finite:
        return
    # A sum is finite only where every term is, and costs a tenth of testing each element
    with np.errstate(invalid="ignore"):
        total = float(origins.sum(dtype=np.float64)) + float(directions.sum(dtype=np.float64))
    if not np.isfinite(total):
        raise ValueError("rays must be finite")
    if not np.abs(directions).max(axis=1, initial=0.0).min(initial=1.0) > 1e-18:
        raise ValueError("a ray has no direction")
