"""Rays through a whole scene: which surface ends them, what it does with light, what blocks.

Everything here is in metres and float64; Embree's unit space stays inside. What lies under the
ground is hidden by it, and its underside is black.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import reference_air
from bake.rays import Hits, RayScene
from bake.reference_scene import Merged
from bake.shading import Surface
from formats.scene import Ground

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LIFT = 2.0**-16
"""Of the scene's half size: how far a ray that leaves the ground starts over it."""
FARTHEST = 1e12
"""Metres beyond which the ground is not met."""
SHORT = 1e-5
"""Share of the way to a light that nothing blocks: its own surface may be traced too."""


@dataclass(frozen=True, eq=False)
class Ends:
    """Where rays end: distance (n,) metres, infinite for a miss; point (n, 3), the origin for a
    miss; face (n,) -1 where no mesh was met; ground (n,)."""

    distance: Array
    point: Array
    hits: Hits
    ground: Mask

    @property
    def face(self) -> NDArray[np.int32]:
        """Face (n,) of the merged mesh, -1 for none."""
        return self.hits.face


@dataclass(frozen=True, eq=False)
class Shaded:
    """Surfaces (n) ready for light: front, back (n, 3) origins on the viewer's side and on the
    other; normal (n, 3) unit, towards the viewer; albedo (n, 3); tau (n,) the share of light that
    passes to the other side."""

    front: Array
    back: Array
    normal: Array
    albedo: Array
    tau: Array


class World:
    """The traced scene. merged : its meshes. ground : its plane, or None."""

    def __init__(self, merged: Merged, ground: Ground | None) -> None:
        mesh = merged.mesh
        self.rays = RayScene(mesh.vertices, mesh.faces)
        self.surface = Surface(mesh, self.rays, 1.0, 0.0)
        thin = np.array([m.double_sided for m in mesh.materials], bool)
        self.surface.tau = np.where(thin, merged.transmission, 0).astype(np.float32)
        self.instance, self.tint = merged.instance, merged.tint
        self.material = mesh.material
        self.emission = np.array([m.emissive for m in mesh.materials], np.float64).reshape(-1, 3)
        self.glowing = bool(self.emission.any())
        self.ground = ground
        self.lift = LIFT / self.rays.scale

    def cast(self, origins: Array, directions: Array) -> Ends:
        """Follow rays from origins (n, 3) along unit directions (n, 3) to what they meet first."""
        hits, along = self._mesh_hits(origins, directions)
        ground = self._ground_distance(origins, directions)
        on_ground = ground < along
        distance = np.minimum(ground, along)
        travelled = np.where(np.isfinite(distance), distance, 0)
        face = np.where(on_ground, np.int32(-1), hits.face)
        hits = Hits(face, hits.u, hits.v, hits.distance)
        return Ends(distance, origins + travelled[:, None] * directions, hits, on_ground)

    def blocked(
        self,
        origins: Array,
        directions: Array,
        distance: Array | None = None,
        target: NDArray[np.int64] | None = None,
    ) -> Mask:
        """Tell (n,) which rays meet something nearer than `distance` (n,) metres, None for any.

        target : (n,) faces that do not count.
        """
        ground = self._ground_distance(origins, directions)
        if distance is None:
            start, towards = self.rays.to_unit(origins), directions.astype(np.float32)
            return np.isfinite(ground) | self.rays.occluded(start, towards, finite=True)
        hits, along = self._mesh_hits(origins, directions)
        near = along < distance * (1 - SHORT)
        if target is not None:
            near &= hits.face != target
        return near | (ground < distance * (1 - SHORT))

    def shade(self, ends: Ends, directions: Array) -> Shaded:
        """Return the surfaces (n) at ends that all met one, seen along unit directions (n, 3)."""
        n = len(directions)
        front, back = ends.point.copy(), ends.point.copy()
        normal, albedo, tau = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)
        on_ground = np.flatnonzero(ends.ground)
        if len(on_ground) and self.ground is not None:
            normal[on_ground] = (0.0, 1.0, 0.0)
            front[on_ground, 1] = self.ground.height + self.lift
            seen = directions[on_ground, 1] < 0
            albedo[on_ground] = self._ground_albedo(ends.point[on_ground]) * seen[:, None]
        on_mesh = np.flatnonzero(ends.face >= 0)
        if len(on_mesh):
            hits = ends.hits.pick(on_mesh)
            found = self.surface.at(hits, -directions[on_mesh].astype(np.float32))
            both = found.diffuse if found.through is None else found.diffuse + found.through
            tint = self.tint[self.instance[hits.face]]
            front[on_mesh] = self._to_world(found.front)
            if found.back is not None:
                back[on_mesh] = self._to_world(found.back)
            normal[on_mesh] = found.normal
            albedo[on_mesh] = np.pi * both * tint
            tau[on_mesh] = self.surface.tau[self.material[hits.face]]
        return Shaded(front, back, normal, albedo, tau)

    def glow(self, face: NDArray[np.int32]) -> Array:
        """Radiance (n, 3) that faces (n,) send out by themselves, to both sides; 0 for face -1."""
        if not self.glowing:
            return np.zeros((len(face), 3))
        found: Array = self.emission[self.material[np.maximum(face, 0)]]
        return found * (face >= 0)[:, None]

    def triangles(self, faces: NDArray[np.int64]) -> Array:
        """Corners (k, 3, 3) of faces (k,) as Embree has them."""
        return self._to_world(self.rays.corners[faces])

    def _to_world(self, points: NDArray[np.float32]) -> Array:
        return np.asarray(points.astype(np.float64) / self.rays.scale + self.rays.centre)

    def _mesh_hits(self, origins: Array, directions: Array) -> tuple[Hits, Array]:
        """Return hits and distances (n,) in metres."""
        start = (origins - self.rays.centre) * self.rays.scale
        # No corner is farther from the centre than sqrt 3: begin there, or float32 would miss
        ahead = np.maximum(-np.einsum("ij,ij->i", start, directions) - 2, 0)
        start += ahead[:, None] * directions
        hits = self.rays.intersect(
            start.astype(np.float32), directions.astype(np.float32), finite=True
        )
        unit = np.where(hits.face >= 0, hits.distance, 0).astype(np.float64)
        return hits, np.where(hits.face >= 0, (unit + ahead) / self.rays.scale, np.inf)

    def _ground_distance(self, origins: Array, directions: Array) -> Array:
        if self.ground is None:
            return np.full(len(origins), np.inf)
        steep = directions[:, 1]
        gap = self.ground.height - origins[:, 1]
        meets = (gap * steep > 0) & (np.abs(gap) < FARTHEST * np.abs(steep))
        found: Array = np.divide(gap, steep, where=meets, out=np.full(len(gap), np.inf))
        return found

    def _ground_albedo(self, points: Array) -> Array:
        if self.ground is None:
            return np.zeros((len(points), 3))
        main, accent = np.array(self.ground.albedo), np.array(self.ground.accent)
        if np.array_equal(main, accent):
            return np.broadcast_to(main, (len(points), 3))
        share = reference_air.mottle(points[:, ::2] / self.ground.scale)[:, None]
        return np.asarray(main * (1 - share) + accent * share)
