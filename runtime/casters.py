"""Casters of soft shadows: their volumes on the card, and the lights projected for each.

A light far from a caster is one set of harmonics; a near one differs from place to place, so that
all are projected at both ends of the caster's longest axis. What the shader sums is then the same
few numbers for any lights. Approximate by design: between the ends the result is lerped, and unless
`receiver_normal` asks for nine times those numbers light from behind the receiver counts too, while
the receiver's own cosine does not.

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

import numpy as np
from numpy.typing import NDArray

from formats.errors import DamagedError
from formats.meshes import PlacedMesh, Shadow
from formats.occlusion import Occlusion
from formats.occlusion import decode as stored_values
from maths.colour import luminance
from maths.occlusion_shadow import (
    disc_distance,
    disc_share,
    occlusion_place,
    occlusion_unwarp,
    occlusion_warp,
    receiver_facing,
    receiver_products,
)
from maths.spherical_rotation import rotate
from runtime import shadow_light

Array = NDArray[np.float64]
Float = NDArray[np.float32]

DARK = 1e-12
"""Least light, of all directions together, that a shadow is taken from: W/m2."""


@dataclass(frozen=True, eq=False)
class Caster:
    """A mesh that casts a shadow.

    number : among the scene's meshes, from 1.  volumes : shadow_light.Volumes, filled when drawn.
    edge : (m, 4 P) stored values at the volume's edge.  edge_share : (m,) `disc_share` of the
    places where they begin to thin, at most as far as a corner.  P : textures of four components.
    """

    number: int
    placed: PlacedMesh
    shadow: Shadow
    asset: Occlusion
    volumes: Any
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

    @property
    def l_max(self) -> int:
        """Highest band of light that counts: a normal's cosine mixes two more into the volume's."""
        return self.asset.l_max + (2 if self.shadow.receiver_normal else 0)

    def weights(self, light: Array, time: float) -> Array:
        """Weights (2, C, 4 P) of stored values: they sum to the share hidden, `L.O / L.U`.

        light : (2, K, 3) at the ends, in world axes.  C : 3 channels, or 1 by luminance.
        """
        share = self._share(light[:, : self.asset.basis.shape[1]])
        constants = self.asset.constants(self._turned(share, time))
        return np.ascontiguousarray(np.moveaxis(constants, 1, 2))

    def receiver_weights(self, light: Array, time: float) -> tuple[Array, Array]:
        """Weights (2, C, 9, 4 P) and numbers (2, 9, C) that meet `receiver_lobe` of a normal.

        light : (2, K, 3) at the ends, in world axes, as the normals; K of `l_max`. The first sum to
        `int L cos+ O`, the second to `int L cos+`, both over L.U.
        """
        share = self._share(light[:, : (self.l_max + 1) ** 2])
        products = receiver_products(share, self.asset.l_max)
        constants = self.asset.constants(self._turned(products, time))
        return np.ascontiguousarray(np.moveaxis(constants, 3, 1)), receiver_facing(share)

    def _share(self, light: Array) -> Array:
        """Light (2, K, C) over L.U by end and channel, 0 where it is dark."""
        seen = light if self.shadow.coloured else np.asarray(luminance(light))[..., None]
        total = 2.0 * np.sqrt(np.pi) * seen[:, :1]
        lit = total > DARK
        return np.asarray(seen * lit / np.where(lit, total, 1.0))

    def _turned(self, light: Array, time: float) -> Array:
        """Light (..., K, C) of the world in the mesh's own axes."""
        turn = self.placed.world_from_mesh(time)[:3, :3] / self.placed.scale
        return rotate(light, turn.T, axis=-2)

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
    shared: dict[Path, tuple[Occlusion, Float, Array]] = {}
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
            shared[folder] = asset, *_edge(asset)
        asset, edge, share = shared[folder]
        normals = placed.shadow.receiver_normal
        volumes = shadow_light.Volumes(player, asset, placed.name, normals=normals)
        casters.append(Caster(number, placed, placed.shadow, asset, volumes, edge, share))
    return tuple(casters)


def _edge(asset: Occlusion) -> tuple[Float, Array]:
    """Stored values at the volume's edge, and `disc_share` of the farthest place of each.

    Between middles of voxels, of either grid, a lookup there is linear along both axes. Side by
    side of the box, each of which is looked up axis by axis.
    """
    extent = 2.0 * np.asarray(asset.box.half_extent)
    seams = [_seams(asset, axis) for axis in range(3)]
    # What lies between two is taken as far out as the outer one
    outward = [
        np.minimum(np.where(at < 0, np.append(1.0, -at[:-1]), np.append(at[1:], 1.0)), 1.0)
        for at in seams
    ]
    stored = [np.concatenate(list(stored_values(grid)), axis=-1) for grid in asset.grids]
    values, distances = [], []
    for axis in range(3):
        sides = [at[[0, -1]] if i == axis else at for i, at in enumerate(seams)]
        ends = [at[[0, -1]] if i == axis else at for i, at in enumerate(outward)]
        found = [_lattice(volume, sides, axis, asset.warp) for volume in stored]
        values.append(np.concatenate(found, axis=-1).reshape(-1, 4 * _count(asset)))
        z, y, x = np.meshgrid(*ends[::-1], indexing="ij")
        far = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        distances.append(np.linalg.norm(far * extent, axis=1))
    share = disc_share(np.concatenate(distances), 0.5 * np.linalg.norm(extent))
    return np.concatenate(values), np.asarray(share)


def _count(asset: Occlusion) -> int:
    """Return the number of textures of four stored values."""
    return sum(len(grid) for grid in asset.grids)


def _lattice(volume: Float, places: list[Array], first: int, warp: float) -> Float:
    """Look a volume (z, y, x, c) up where planes p = const along x, y, z meet: (Z, Y, X, c).

    first : the axis to begin with, best that of the fewest planes.
    """
    for axis in (first, *({0, 1, 2} - {first})):
        p = np.zeros((len(places[axis]), 3))
        p[:, axis] = places[axis]
        at = occlusion_warp(occlusion_place(p), warp)[:, axis]
        size = volume.shape[2 - axis]
        place = np.clip(at * size - 0.5, 0, size - 1)
        low = np.minimum(place.astype(np.int64), max(size - 2, 0))
        share = (place - low).astype(np.float32).reshape(-1, *(1,) * (1 + axis))
        one = volume.take(low, 2 - axis)
        other = volume.take(np.minimum(low + 1, size - 1), 2 - axis)
        volume = one + share * (other - one)
    return volume


def _seams(asset: Occlusion, axis: int) -> Array:
    """Return p along an axis, rising, of the middles of voxels of all grids, and both ends."""
    sizes = [grid.shape[3 - axis] for grid in asset.grids]
    middles = np.concatenate([(np.arange(n) + 0.5) / n for n in sizes])
    p = 2.0 * occlusion_unwarp(np.unique(middles), asset.warp) - 1.0
    return np.concatenate([[-1.0], p, [1.0]])
