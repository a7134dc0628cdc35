"""A world of cubes on the card as it is at a moment: cells, what they send out, faces, and light.

Shared by the passes that draw it and light it.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats import voxel_world
from formats.errors import DamagedError
from formats.lightmap import Faces, Lightmap
from formats.voxel_state import Glow, Offset, World
from formats.voxel_world import VoxelLamp
from formats.voxels import Voxels
from maths.latlong import joined, turned
from runtime import lighting
from runtime.voxel_world import PALETTE_WIDTH, Box, Change, VoxelVolume

if TYPE_CHECKING:
    from runtime.voxel_lamps import FreeLamp

SKY_HEIGHT = 64
"""Rows of the environment that rays see."""


class Cubes:
    """The world of one player.

    world : its states.  faces : their layout.  volume : its textures.  emission : texture of what
    each row of the palette sends out.  light : texture of irradiance, alpha 1 where a texel has
    any; the pass that makes it sets it, and counts in `lit` how often it changed.
    """

    def __init__(self, player: Any) -> None:
        self._player = player
        folders = player.folders("voxels")
        described = player.scene.voxels
        parts = [Voxels.load(_folder(player, folders, body.name)) for body in described.bodies]
        ground = Voxels.load(_folder(player, folders, "world"))
        self.world = World(ground, parts, described.position, described.reaches)
        self._gathered = "gather" in player.called
        kind = "faces" if self._gathered else "lightmap"
        self.baked = Lightmap.load(_folder(player, player.folders(kind), "world", kind))
        self.faces: Faces = self.baked.faces
        self._offsets = self._offsets_at(0.0)
        self.cells = self.world.cells(self._offsets)
        self.volume = VoxelVolume(
            player.ctx,
            replace(self.world.voxels, cells=self.cells),
            brightest=max(
                (float(np.max(lamp.radiance.extremes[1])) for lamp in described.lamps), default=0.0
            ),
            gaps=described.mode == "sphere",
            adopt=player.targets.adopt,
        )
        self.emission = self._emission()
        self.light: Any = None
        self.lit = 0
        self._skies: dict[Any, Any] = {}
        self._pages: tuple[Any, Any] | None = None
        self.volume.set_glow(self._lamps(0.0))

    def _emission(self) -> Any:
        values = self.world.voxels.emission
        height = -(-len(values) // PALETTE_WIDTH)
        texels = np.zeros((height * PALETTE_WIDTH, 4), np.float32)
        texels[: len(values), :3] = values
        made = self._player.ctx.texture((PALETTE_WIDTH, height), 4, texels.tobytes(), dtype="f4")
        made.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return self._player.targets.adopt(made, texels.nbytes)

    @property
    def described(self) -> Any:
        """What the scene says of it."""
        return self._player.scene.voxels

    @property
    def moves(self) -> bool:
        """Whether parts ever stand elsewhere."""
        return any(not body.position.constant for body in self.described.bodies)

    def key(self, time: float) -> Hashable:
        """All that the world of `time` seconds and its light depend on."""
        return self.state(time), self.lit

    def state(self, time: float) -> Hashable:
        """All that the world of `time` seconds depends on."""
        lamps = self.described.lamps
        values = [keyed.at(time) for lamp in lamps for keyed in (lamp.position, lamp.radiance)]
        return self._offsets_at(time), b"".join(value.tobytes() for value in values)

    def at(self, time: float) -> list[Change]:
        """Bring the volume to `time` seconds; returns what changed in it."""
        changes: list[Change] = []
        offsets = self._offsets_at(time)
        if offsets != self._offsets:
            before, self.cells, self._offsets = self.cells, self.world.cells(offsets), offsets
            changes += self.volume.set_cells(self.cells, [_bounds(before != self.cells)])
        return changes + self.volume.set_glow(self._lamps(time))

    def middle(self, lamp: VoxelLamp, time: float) -> NDArray[np.float64]:
        """Where a lamp's middle (3,) is at `time` seconds, metres: light that is baked snaps it."""
        place: NDArray[np.float64] = lamp.position.at(time)
        return place if self._gathered else self.world.snapped(place, lamp.side)

    def free_lamps(self, time: float) -> list[FreeLamp]:
        """The lamps as they are at `time` seconds, in cells."""
        # Only the gather needs them
        from runtime.voxel_lamps import FreeLamp

        found = []
        for lamp in self.described.lamps:
            middle = (self.middle(lamp, time) - self.volume.origin) / self.volume.cell_size
            place, light = middle.tolist(), np.asarray(lamp.radiance.at(time)).tolist()
            found.append(FreeLamp(tuple(place), 0.5 * lamp.side, tuple(light)))
        return found

    def _offsets_at(self, time: float) -> tuple[Offset, ...]:
        """Where parts stand: only what they are at frames was laid out."""
        frames = self._player.scene.time
        shown = voxel_world.frame_of(time, frames.duration, frames.frame_rate)
        return self.world.offsets(self.described.positions(shown))

    def _lamps(self, time: float) -> list[Glow]:
        """Light that lamps share out among cells: only the talk's way of gathering looks there."""
        if self.described.mode != "talk":
            return []
        return [self.world.glow(lamp, self.cells, time) for lamp in self.described.lamps]

    def sky(self, lights: Any) -> NDArray[np.float32] | None:
        """Radiance (h, w, 3) of all environments together as they stand; None without any."""
        if "environment" not in self._player.passes:
            return None
        maps = self._player.passes["environment"].maps
        key = tuple((e.index, tuple(e.factor), e.rotate) for e in lights.environments)
        if key not in self._skies:
            found = [
                turned(lighting.shrunk(maps[e.index], SKY_HEIGHT), e.rotate) * e.factor
                for e in lights.environments
                if e.index in maps
            ]
            self._skies = {key: joined(found).astype(np.float32) if found else None}
        return self._skies[key]

    def lat_long(self, radiance: NDArray[np.float32]) -> Any:
        """Make a bilinear texture of a lat-long map."""
        h, w, _ = radiance.shape
        made = self._player.ctx.texture((w, h), 4, texels(radiance), dtype="f4")
        made.filter, made.repeat_x = (moderngl.LINEAR, moderngl.LINEAR), True
        made.repeat_y = False
        return self._player.targets.adopt(made, 16 * w * h)

    def pages(self) -> tuple[Any, Any]:
        """Textures `page_of` and `pages`, by which a ray's end finds its texel."""
        if self._pages is None:
            # Only rays need them
            from runtime import gather_targets

            self._pages = gather_targets.page_textures(
                self._player.ctx, self.faces, self._player.targets.adopt
            )
        return self._pages

    def uniforms(self) -> dict[str, Any]:
        """Values that shaders take of the grid."""
        return {"grid_origin": self.volume.origin, "cell_size": self.volume.cell_size}


def of(player: Any) -> Cubes:
    """Return the world of a player, made when it is first asked for."""
    found: Cubes = player.once(Cubes)
    return found


def texels(radiance: NDArray[np.float32]) -> bytes:
    """RGBA float32 of a map (h, w, 3)."""
    found = np.ones((*radiance.shape[:2], 4), np.float32)
    found[..., :3] = radiance
    return found.tobytes()


def _folder(player: Any, folders: dict[str, Path], name: str, kind: str = "voxels") -> Path:
    if name not in folders:
        where = f"assets.{kind}/{name}"
        raise DamagedError(player.folder / "manifest.json", where, "missing", "bake it again")
    return folders[name]


def _bounds(changed: NDArray[np.bool_]) -> Box:
    """Return the smallest box that holds every change (nz, ny, nx): low, high (x, y, z)."""
    low, high = [], []
    for axis in (2, 1, 0):
        others = tuple(i for i in range(3) if i != axis)
        at = np.flatnonzero(changed.any(axis=others))
        low.append(int(at[0]) if len(at) else 0)
        high.append(int(at[-1]) + 1 if len(at) else 0)
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
