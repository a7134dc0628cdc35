"""Volumes of what a caster hides of the light there is: made from its stored values on the CPU.

What a pixel sums is linear in what is stored, so that it is summed once a voxel, of which there are
far fewer than pixels, and looked up as one colour an end. A receiver's share depends on its normal:
nine volumes, one a harmonic, and six more for normals along an axis, each of which is a sum of the
nine. Both ends, both grids: multiplications of a few million numbers, in float32.
"""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.occlusion import Occlusion
from formats.occlusion import decode as stored_values
from maths.occlusion_shadow import LOBES, receiver_lobe

Array = NDArray[np.float64]
Float = NDArray[np.float32]

AXES = np.concatenate([np.eye(3), -np.eye(3)])
"""Normals that have a volume of their own: +x, +y, +z, -x, -y, -z."""
SLABS = LOBES + len(AXES)


class Volumes:
    """One caster's volumes on the card: by grid, then by end, slabs along z.

    asset : of the caster.  normals : whether a receiver's normal counts.  name : of the mesh.
    Raises InputError where this machine takes no volume so large.
    """

    def __init__(self, player: Any, asset: Occlusion, name: str, *, normals: bool) -> None:
        self.slabs = SLABS if normals else 1
        self._check(player, asset, name)
        self._stored = [_by_voxel(grid) for grid in asset.grids]
        self.textures = tuple(self._texture(player, grid) for grid in asset.grids for _ in range(2))

    def write(self, weights: Array) -> None:
        """Fill them from weights (2, C, 4 P), or (2, C, 9, 4 P) by harmonic of a normal."""
        by_slab = weights[:, :, None] if weights.ndim == 3 else with_axes(weights)
        textures, first = iter(self.textures), 0
        for stored in self._stored:
            last = first + stored.shape[1]
            for end in by_slab[..., first:last]:
                next(textures).write(hidden(stored, end))
            first = last

    def _check(self, player: Any, asset: Occlusion, name: str) -> None:
        limit = int(player.ctx.info["GL_MAX_3D_TEXTURE_SIZE"])
        for grid in asset.grids:
            z, y, x = grid.shape[1:4]
            if max(self.slabs * z, y, x) > limit:
                remedy = f"this machine takes {limit} texels: lower grid or size"
                value = f"{self.slabs} volumes of {max(z, y, x)} voxels"
                raise InputError(name, "shadow", value, remedy)

    def _texture(self, player: Any, grid: NDArray[Any]) -> Any:
        z, y, x = grid.shape[1:4]
        made = player.ctx.texture3d((x, y, z * self.slabs), 4, alignment=1, dtype="f4")
        made.filter = (moderngl.LINEAR, moderngl.LINEAR)
        made.repeat_x = made.repeat_y = made.repeat_z = False
        return player.targets.adopt(made, 16 * x * y * z * self.slabs)


def with_axes(weights: Array) -> Array:
    """Weights (2, C, 15, 4 P): those of the nine harmonics (2, C, 9, 4 P), then of AXES."""
    axes = np.einsum("aj,ecjk->ecak", receiver_lobe(AXES), weights)
    return np.concatenate([weights, axes], axis=2)


def hidden(stored: Float, weights: Array) -> Float:
    """Sums (S, m, 4) of stored values (m, 4 P) by weights (C, S, 4 P); one channel is all three."""
    padded = np.zeros((weights.shape[1], weights.shape[2], 4), np.float32)
    padded[..., :3] = np.moveaxis(weights, 0, 2)
    return np.matmul(stored, padded)


def _by_voxel(grid: NDArray[Any]) -> Float:
    """Stored values (z y x, 4 P) of textures (P, z, y, x, 4)."""
    values = np.moveaxis(stored_values(grid), 0, 3)
    return np.ascontiguousarray(values.reshape(-1, 4 * len(grid)))
