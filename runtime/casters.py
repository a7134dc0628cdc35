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

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats.errors import DamagedError, InputError
from formats.meshes import PlacedMesh, Shadow
from formats.occlusion import Occlusion
from maths.colour import luminance
from maths.occlusion_shadow import (
    LOBES,
    disc_distance,
    disc_share,
    occlusion_unwarp,
    receiver_facing,
    receiver_products,
)
from maths.spherical_rotation import rotate

Array = NDArray[np.float64]
Float = NDArray[np.float32]

DARK = 1e-12
"""Least light, of all directions together, that a shadow is taken from: W/m2."""
OTHERS = 88
"""Uniform components of the shader but for lights, at most: 22 vectors, matrices in three."""


@dataclass(frozen=True, eq=False)
class Caster:
    """A mesh that casts a shadow.

    number : among the scene's meshes, from 1.  textures : its volumes, slabs along z, of each grid.
    edge : (m, 4 P) stored values at the volume's edge.  edge_share : (m,) `disc_share` of the
    places where they begin to thin, at most as far as a corner.  P : textures of four components.
    """

    number: int
    placed: PlacedMesh
    shadow: Shadow
    asset: Occlusion
    textures: tuple[Any, ...]
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
    shared: dict[Path, tuple[Occlusion, tuple[Any, ...]]] = {}
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
            shared[folder] = asset, textures(player, asset, placed.name)
        asset, made = shared[folder]
        if placed.shadow.receiver_normal:
            check_uniforms(player, asset, placed)
        edge, share = _edge(asset)
        casters.append(Caster(number, placed, placed.shadow, asset, made, edge, share))
    return tuple(casters)


def textures(player: Any, asset: Occlusion, name: str) -> tuple[Any, ...]:
    """Return the volumes of each grid as one linear, edge-clamped 3D texture, on one another along
    z.

    Raises InputError where this machine takes none so large.
    """
    limit = int(player.ctx.info["GL_MAX_3D_TEXTURE_SIZE"])
    found = []
    for grid in asset.grids:
        count, z, y, x = grid.shape[:4]
        if max(count * z, y, x) > limit:
            remedy = f"this machine takes {limit} texels: lower grid, size or components"
            raise InputError(name, "shadow", f"{count} volumes of {max(z, y, x)} voxels", remedy)
        kind = "f2" if grid.dtype.itemsize == 2 else "f1"
        data = np.ascontiguousarray(grid)
        made = player.ctx.texture3d((x, y, z * count), 4, data, alignment=1, dtype=kind)
        made.filter = (moderngl.LINEAR, moderngl.LINEAR)
        made.repeat_x = made.repeat_y = made.repeat_z = False
        found.append(player.targets.adopt(made, data.nbytes))
    return tuple(found)


def check_uniforms(player: Any, asset: Occlusion, placed: PlacedMesh) -> None:
    """Raise InputError where shaders of this machine take too few numbers for a normal's light."""
    limit = int(player.ctx.info["GL_MAX_FRAGMENT_UNIFORM_COMPONENTS"])
    channels = 3 if placed.shadow is None or placed.shadow.coloured else 1
    wanted = 4 * LOBES * 2 * (channels * len(asset.scales) // 4 + 1) + OTHERS
    if wanted > limit:
        remedy = f"this machine takes {limit}: lower components, or write coloured = false"
        raise InputError(placed.name, "shadow.receiver_normal", f"{wanted} uniforms", remedy)


def decode(asset: Occlusion) -> tuple[float, float]:
    """Factor and offset that make of texture values what `formats.occlusion.decode` does."""
    return (1.0, 0.0) if asset.volumes.dtype.itemsize == 2 else (255.0 / 127.0, -128.0 / 127.0)


def _edge(asset: Occlusion) -> tuple[Float, Array]:
    """Stored values at the volume's edge, and `disc_share` of the farthest place of each.

    Between middles of voxels, of either grid, a lookup there is linear along both axes.
    """
    extent = 2.0 * np.asarray(asset.box.half_extent)
    seams = [_seams(asset, axis) for axis in range(3)]
    # What lies between two is taken as far out as the outer one
    outward = [
        np.minimum(np.where(at < 0, np.append(1.0, -at[:-1]), np.append(at[1:], 1.0)), 1.0)
        for at in seams
    ]
    p, far = (np.stack(np.meshgrid(*axes, indexing="ij"), -1) for axes in (seams, outward))
    outer = np.abs(p).max(axis=-1) == 1.0
    distance = np.linalg.norm(far[outer] * extent, axis=1)
    share = disc_share(distance, 0.5 * np.linalg.norm(extent))
    return asset.slots(p[outer]), np.asarray(share)


def _seams(asset: Occlusion, axis: int) -> Array:
    """Return p along an axis, rising, of the middles of voxels of all grids, and both ends."""
    sizes = [grid.shape[3 - axis] for grid in asset.grids]
    middles = np.concatenate([(np.arange(n) + 0.5) / n for n in sizes])
    p = 2.0 * occlusion_unwarp(np.unique(middles), asset.warp) - 1.0
    return np.concatenate([[-1.0], p, [1.0]])
