"""Casters of soft shadows: their volumes on the card, and the lights projected for each.

A light far from a caster is one set of harmonics; a near one differs from place to place, so that
all are projected at both ends of the caster's longest axis. What the shader sums is then the same
few numbers for any lights. Approximate by design: light from behind the receiver counts too, the
receiver's own cosine does not, and between the ends the result is lerped.

References
----------
Sloan, Kautz, Snyder 2002, Precomputed Radiance Transfer for Real-Time Rendering in Dynamic,
Low-Frequency Lighting Environments.
Evans 2006, Fast Approximations for Global Illumination on Dynamic Scenes, SIGGRAPH course.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats import occlusion
from formats.errors import DamagedError, InputError
from formats.meshes import PlacedMesh, Shadow
from formats.occlusion import Occlusion
from maths.colour import luminance
from maths.occlusion_shadow import disc_distance, disc_share
from maths.spherical_rotation import rotate

Array = NDArray[np.float64]
Float = NDArray[np.float32]

DARK = 1e-12
"""Least light, of all directions together, that a shadow is taken from: W/m2."""


@dataclass(frozen=True, eq=False)
class Caster:
    """A mesh that casts a shadow.

    number : among the scene's meshes, from 1.  texture : its volumes, slabs along z.  edge : (m, 4
    P) stored values of the volume's outermost voxels.  edge_share : (m,) `disc_share` of the
    places where they begin to thin, at most as far as a corner.
    """

    number: int
    placed: PlacedMesh
    shadow: Shadow
    asset: Occlusion
    texture: Any
    edge: Float
    edge_share: Array

    @property
    def extent(self) -> Array:
        """Half of the volume (3,), metres of the mesh."""
        return np.asarray(2.0 * np.asarray(self.asset.box.half_extent, np.float64))

    def object_from_world(self, time: float) -> Array:
        """Matrix (4, 4) to the frame in which the volume is +-1."""
        mesh_from_object = np.eye(4)
        mesh_from_object[:3, :3] = np.diag(self.extent)
        mesh_from_object[:3, 3] = self.asset.box.centre
        return np.asarray(np.linalg.inv(self.placed.world_from_mesh(time) @ mesh_from_object))

    def ends(self, time: float) -> Array:
        """World points (2, 3) at both ends of the longest axis of the bounding box."""
        box = self.asset.box
        points = np.repeat(np.asarray(box.centre)[None], 2, axis=0)
        axis = box.longest_axis
        points[:, axis] += np.array([-1.0, 1.0]) * box.half_extent[axis]
        matrix = self.placed.world_from_mesh(time)
        return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])

    def weights(self, light: Array, time: float) -> Array:
        """Weights (2, C, 4 P) of stored values: they sum to the share hidden, `L.O / L.U`.

        light : (2, K, 3) at the ends, in world axes.  C : 3 channels, or 1 by luminance.
        """
        K = self.asset.basis.shape[1]
        turn = self.placed.world_from_mesh(time)[:3, :3] / self.placed.scale
        seen = rotate(light[:, :K], turn.T)
        if not self.shadow.coloured:
            seen = np.asarray(luminance(seen))[..., None]
        total = 2.0 * np.sqrt(np.pi) * seen[:, :1]
        lit = total > DARK
        constants = self.asset.constants(seen) * lit / np.where(lit, total, 1.0)
        return np.ascontiguousarray(np.moveaxis(constants, 1, 2))

    def reach(self, weights: Array, least: float) -> float:
        """Distance from the middle, metres of the mesh, beyond which less than `least` is hidden.

        weights : of `weights`. At least the volume itself; infinite where nothing thins.
        """
        hidden = (self.edge @ weights.reshape(-1, weights.shape[-1]).T.astype(np.float32)).max(1)
        some = hidden > least
        corner = float(np.linalg.norm(self.extent))
        if not some.any():
            return corner
        if not self.shadow.falloff:
            return np.inf
        share = least * self.edge_share[some] / hidden[some]
        return max(corner, float(disc_distance(share, 0.5 * corner).max()))


def load(player: Any) -> tuple[Caster, ...]:
    """Put the volumes of every caster of the player's scene on the card, what several share once.

    Raises DamagedError where one is missing or its bytes changed.
    """
    folders = player.folders("occlusion")
    shared: dict[Path, tuple[Occlusion, Any]] = {}
    casters = []
    for number, placed in enumerate(player.scene.meshes, start=1):
        if placed.shadow is None:
            continue
        folder = folders.get(placed.name)
        if folder is None:
            where = f"assets.occlusion/{placed.name}"
            raise DamagedError(player.folder / "manifest.json", where, "missing", "bake it again")
        if folder not in shared:
            asset = Occlusion.load(folder)
            shared[folder] = asset, texture(player, asset, placed.name)
        asset, made = shared[folder]
        edge, share = _edge(asset)
        casters.append(Caster(number, placed, placed.shadow, asset, made, edge, share))
    return tuple(casters)


def texture(player: Any, asset: Occlusion, name: str) -> Any:
    """Return the volumes as one linear, edge-clamped 3D texture, on one another along z.

    Raises InputError where this machine takes none so large.
    """
    count, n = asset.volumes.shape[:2]
    limit = int(player.ctx.info["GL_MAX_3D_TEXTURE_SIZE"])
    if count * n > limit:
        remedy = f"this machine takes {limit} texels: lower grid or components"
        raise InputError(name, "shadow", f"{count} volumes of {n} voxels", remedy)
    kind = "f2" if asset.volumes.dtype.itemsize == 2 else "f1"
    data = np.ascontiguousarray(asset.volumes)
    made = player.ctx.texture3d((n, n, n * count), 4, data, alignment=1, dtype=kind)
    made.filter = (moderngl.LINEAR, moderngl.LINEAR)
    made.repeat_x = made.repeat_y = made.repeat_z = False
    return player.targets.adopt(made, data.nbytes)


def decode(asset: Occlusion) -> tuple[float, float]:
    """Factor and offset that make of texture values what `formats.occlusion.decode` does."""
    return (1.0, 0.0) if asset.volumes.dtype.itemsize == 2 else (255.0 / 127.0, -128.0 / 127.0)


def _edge(asset: Occlusion) -> tuple[Float, Array]:
    """Stored values of the outermost voxels, and `disc_share` of the farthest place of each."""
    n = asset.volumes.shape[1]
    values = occlusion.decode(asset.volumes)
    slots = np.moveaxis(values, 0, 3).reshape(n**3, -1)
    extent = 2.0 * np.asarray(asset.box.half_extent)
    centres = (asset.box.voxel_centres(n) - np.asarray(asset.box.centre)) / extent
    outer = np.abs(centres).max(axis=1) > 1.0 - 1.5 / n
    # Between voxels a lookup mixes neighbours: each is taken as far out as the next one
    p = np.minimum(np.abs(centres) + 2.0 / n, 1.0)
    share = disc_share(np.linalg.norm(p[outer] * extent, axis=1), 0.5 * np.linalg.norm(extent))
    return np.ascontiguousarray(slots[outer]), np.asarray(share)
