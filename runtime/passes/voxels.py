"""A world of cubes: its faces in the light that their texels hold, and lamps.

Writes colour and depth, and `position`, `normal` and `id` (0) where a later pass reads them. What
is emitted comes after the shadows where there are any.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats.lightmap import Faces
from runtime import cubes, reuse, surfaces
from runtime.camera import column_major
from runtime.shader import set_uniforms
from runtime.surfaces import GEOMETRY

HERE = Path(__file__).parent
CORNERS = np.array([0, 1, 2, 0, 2, 3], np.uint32)
LAMP_VERTICES = 36


class Pass:
    """Draws the world of cubes of the scene."""

    reads: tuple[str, ...] = ()
    writes = ("colour", "depth", *GEOMETRY)
    opaque = True

    def __init__(self, player: Any) -> None:
        self._player = player
        self.cubes = cubes.of(player)
        position, normal, texel = self.cubes.faces.vertices()
        behind = np.repeat(_cells_behind(self.cubes.faces), 4, axis=0)
        rows = np.concatenate([position, normal, texel, behind], axis=1, dtype=np.float32)
        self._vertices = surfaces.filled(player, rows)
        count = len(rows) // 4
        index = (4 * np.arange(count, dtype=np.uint32)[:, None] + CORNERS).ravel()
        self._index = surfaces.filled(player, index)
        self._moving = {"MOVING": self.cubes.moves}
        self._array = self._faces("voxels.frag", {**self._moving, "EMISSION": False})
        self._emitting: Any = None
        self._geometry: Any = None
        self._lamps: Any = None
        if self.cubes.described.lamps:
            program = player.programs.get(
                HERE / "voxels_lamp.vert", HERE / "voxels_lamp.frag", {}, {}
            )
            self._lamps = player.vertex_array(program)

    def _faces(self, fragment: str, defines: dict[str, Any]) -> Any:
        player = self._player
        program = player.programs.get(HERE / "voxels.vert", HERE / fragment, defines, {})
        columns = (("position", 3), ("direction", 3), ("place", 2), ("lowest", 3), ("highest", 3))
        taken = [name for name, _ in columns if name in program]
        layout = " ".join(f"{n}f" if name in taken else f"{4 * n}x" for name, n in columns)
        return player.vertex_array(program, [(self._vertices, layout, *taken)], self._index)

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        return reuse.camera(self._player.view), self.cubes.key(time)

    def draw(self, time: float) -> None:
        """Draw the faces and lamps of `time` seconds."""
        player, world = self._player, self.cubes
        world.at(time)
        if wanted := surfaces.wanted_geometry(player):
            self._draw_geometry(wanted)
        player.targets.opaque().use()
        player.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        player.ctx.depth_func = "<="
        glow = 0.0 if "occlusion" in player.passes else 1.0
        self._draw(self._array, {"glow": glow, "lightmap": 2})
        self._draw_lamps(time, glow)

    def emit(self, time: float) -> None:
        """Add what faces and lamps emit to the opaque picture, blending as it is set."""
        glowing = self.cubes.world.voxels.emission.any()
        if glowing:
            if self._emitting is None:
                defines = {**self._moving, "EMISSION": True}
                self._emitting = self._faces("voxels.frag", defines)
            self._draw(self._emitting, {})
        self._draw_lamps(time, 1.0)

    def _draw(self, array: Any, values: dict[str, Any]) -> None:
        player, world = self._player, self.cubes
        world.volume.rows.use(0)
        world.volume.palette.use(1)
        world.emission.use(3)
        if "lightmap" in values:
            world.light.use(2)
        place = {"clip_from_world": self._clip(), "cells": 0, "albedo": 1, "emission": 3}
        set_uniforms(array.program, {**world.uniforms(), **place, **values})
        player.targets.draw(array, mode=moderngl.TRIANGLES)

    def _clip(self) -> Any:
        width, height = self._player.targets.size
        return column_major(self._player.view.clip_from_world(width / height))

    def _draw_lamps(self, time: float, glow: float) -> None:
        size = self.cubes.world.voxels.cell_size
        for lamp in self.cubes.described.lamps:
            values = {
                "clip_from_world": self._clip(),
                "middle": tuple(self.cubes.middle(lamp, time)),
                "half_side": 0.5 * lamp.side * size,
                "radiance": tuple(glow * lamp.radiance.at(time)),
            }
            set_uniforms(self._lamps.program, values)
            self._player.targets.draw(self._lamps, mode=moderngl.TRIANGLES, vertices=LAMP_VERTICES)

    def _draw_geometry(self, wanted: tuple[str, ...]) -> None:
        player = self._player
        names = tuple((name, *GEOMETRY[name]) for name in wanted)
        if self._geometry is None:
            places = {f"AT_{name.upper()}": i for i, name in enumerate(wanted)}
            flags = {name.upper(): name in wanted for name in GEOMETRY}
            defines = {**flags, **places, **self._moving}
            self._geometry = self._faces("voxels_geometry.frag", defines)
        target = player.targets.targets(names, "depth")
        target.use()
        target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        player.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        player.ctx.depth_func = "<="
        self._draw(self._geometry, {})
        if player.targets.samples <= 1:
            # It shares the depth of the picture, which nothing was drawn into yet
            player.targets.opaque().clear(0.0, 0.0, 0.0, 1.0, depth=1.0)


def _cells_behind(faces: Faces) -> NDArray[np.int64]:
    """Lowest and highest cell (R, 6) behind each rectangle."""
    r = faces.rectangles
    found = np.empty((len(r), 2, 3), np.int64)
    depth = r["plane"] - (r["sign"] > 0)
    along = ((depth, depth), (r["u"], r["u"] + r["width"] - 1), (r["v"], r["v"] + r["height"] - 1))
    for i, ends in enumerate(along):
        for end in range(2):
            found[np.arange(len(r)), end, (r["axis"] + i) % 3] = ends[end]
    return found.reshape(-1, 6)
