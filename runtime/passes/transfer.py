"""Meshes lit by precomputed transfer: shadowed by themselves, and by light from themselves.

Writes colour and depth, and `position`, `normal` and `id` as the surface pass does. Each vertex's
numbers are dotted with the constants of the light, taken at the middles of the six sides of the
mesh's box and linear in between, in bands up to the asset's. The back of a one-sided face has the
light of its front. Reference: Sloan, Kautz, Snyder 2002, Precomputed Radiance Transfer.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats.transfer import Layout, linear
from maths.spherical_rotation import rotate
from runtime import surfaces
from runtime.incident import Incident
from runtime.surfaces import GEOMETRY, place_uniforms

HERE = Path(__file__).parent
DECODE = {8: (255 / 127, -128 / 127), 16: (1.0, 0.0)}
"""Factor and offset of what the card makes of codes, by bits."""


class Pass:
    """Draws every mesh of the scene whose lighting is transfer."""

    reads: tuple[str, ...] = ()
    writes = ("colour", "depth", *GEOMETRY)
    opaque = True

    def __init__(self, player: Any) -> None:
        self._player = player
        self.surfaces = surfaces.load(player, ("transfer",))
        folders = player.folders("transfer")
        self._layouts = [Layout.load(folders[s.placed.name]) for s in self.surfaces]
        bands = {layout.l_max for layout in self._layouts}
        self._incident = {l_max: Incident(player, l_max) for l_max in bands}
        self._arrays = [[self._array(part) for part in s.parts] for s in self.surfaces]
        self._geometry: surfaces.Geometry | None = None

    def _array(self, part: surfaces.Part) -> Any:
        program = self._player.programs.get(
            HERE / "transfer.vert",
            HERE / "transfer.frag",
            part.defines,
            {**part.defines, "QUADS": len(part.custom) - 2},
        )
        content = [*part.content(program), part.custom]
        return self._player.vertex_array(program, content, part.index)

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        return surfaces.key(self._player, self.surfaces, time)

    def constants(self, number: int, time: float) -> NDArray[np.float64]:
        """Constants (4, 4 P, 3) of the light on mesh `number` of this pass, from 0: at the middle
        of its box, and slopes along x, y and z."""
        surface, layout = self.surfaces[number], self._layouts[number]
        world_from_mesh = surface.placed.world_from_mesh(time)
        points = layout.points @ world_from_mesh[:3, :3].T + world_from_mesh[:3, 3]
        light = linear(self._incident[layout.l_max].project(points, time))
        turn = world_from_mesh[:3, :3] / surface.placed.scale
        return layout.constants(rotate(light, turn.T))

    def draw(self, time: float) -> None:
        """Draw the meshes of `time` seconds."""
        player = self._player
        if wanted := surfaces.wanted_geometry(player):
            over = bool({"surface", "voxels"}.intersection(player.passes))
            self._geometry = self._geometry or surfaces.Geometry(
                player, self.surfaces, wanted, over
            )
            self._geometry.draw(time)
            if player.targets.samples <= 1 and not over:
                # It shares the depth of the picture, which nothing was drawn into yet
                player.targets.opaque().clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        # Light may be found by drawing
        lights = [self.constants(number, time) for number in range(len(self.surfaces))]
        player.targets.opaque().use()
        player.ctx.depth_func = "<="
        for number, arrays in enumerate(self._arrays):
            surface, layout = self.surfaces[number], self._layouts[number]
            if not player.shows("mesh", surface.placed.name):
                continue
            place = place_uniforms(player, surface, time)
            rows = lights[number].reshape(-1, 3)
            place["light"] = [tuple(row) for row in rows]
            place["box_centre"], place["box_scale"] = tuple(layout.centre), tuple(layout.scale)
            place["decode"] = DECODE[layout.depth]
            for part, array in zip(surface.parts, arrays, strict=True):
                # The other side of a double-sided face is a face of its own
                culled = moderngl.CULL_FACE if part.double_sided else 0
                player.ctx.enable_only(moderngl.DEPTH_TEST | culled)
                surfaces.draw_part(player, part, array, place)
