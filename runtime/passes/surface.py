"""Opaque meshes: Lambert under every light in closed form, without shadows, and what they emit.

Writes colour and depth. The targets `position` (world, metres; mesh number in w), `normal` (world,
towards the camera) and `id` (mesh number) are drawn where a later pass reads them: from 1 in the
order of the scene, 0 where no mesh is. Both sides of a face are lit; nothing shines through.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from runtime import light_uniforms, surfaces
from runtime.shader import set_uniforms
from runtime.surfaces import GEOMETRY, place_uniforms

HERE = Path(__file__).parent


class Pass:
    """Draws every mesh of the scene whose lighting is direct."""

    reads: tuple[str, ...] = ()
    writes = ("colour", "depth", *GEOMETRY)
    opaque = True

    def __init__(self, player: Any) -> None:
        self._player = player
        self._surfaces = surfaces.load(player, ("direct",))
        self._environment = "environment" in player.called
        self._probe = player.passes.get("probe")
        self._defines = {
            **light_uniforms.counts(player.scene),
            "ENVIRONMENT": self._environment or self._probe is not None,
        }
        self._arrays = [[self._array(part) for part in s.parts] for s in self._surfaces]
        self._geometry: surfaces.Geometry | None = None

    def _array(self, part: surfaces.Part) -> Any:
        program = self._player.programs.get(
            HERE / "surface.vert",
            HERE / "surface.frag",
            {**self._defines, **part.defines},
            part.defines,
        )
        return self._player.vertex_array(program, part.content(program), part.index)

    @property
    def surfaces(self) -> tuple[surfaces.Surface, ...]:
        """What is drawn."""
        return self._surfaces

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        return surfaces.key(self._player, self._surfaces, time)

    def draw(self, time: float) -> None:
        """Draw the meshes of `time` seconds."""
        player = self._player
        if wanted := surfaces.wanted_geometry(player):
            over = "voxels" in player.passes
            self._geometry = self._geometry or surfaces.Geometry(
                player, self._surfaces, wanted, over
            )
            self._geometry.draw(time)
            if player.targets.samples <= 1 and not over:
                # It shares the depth of the picture, which nothing was drawn into yet
                player.targets.opaque().clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        # Light may be found by drawing
        lights = self._lights(time)
        player.targets.opaque().use()
        player.ctx.enable_only(moderngl.DEPTH_TEST)
        player.ctx.depth_func = "<="
        for surface, arrays, light in zip(self._surfaces, self._arrays, lights, strict=True):
            if not player.shows("mesh", surface.placed.name):
                continue
            place = {**place_uniforms(player, surface, time), **light}
            for part, array in zip(surface.parts, arrays, strict=True):
                surfaces.draw_part(player, part, array, place)

    def _lights(self, time: float) -> list[dict[str, Any]]:
        """Set what light all meshes have in common; return uniforms of what each has for itself:
        among cubes all light, as it is at the mesh's middle."""
        player = self._player
        if self._probe is None:
            values = light_uniforms.of(player.lights)
            if self._environment:
                ambient = player.passes["environment"].irradiance_harmonics(player.lights)
                values["ambient"] = [tuple(row) for row in ambient]
            programs = {id(a.program): a.program for row in self._arrays for a in row}
            for program in programs.values():
                set_uniforms(program, values)
            return [{}] * len(self._surfaces)
        return among_cubes(self._probe, player.lights, self._surfaces, time)


def among_cubes(
    probe: Any, lights: Any, drawn: tuple[surfaces.Surface, ...], time: float
) -> list[dict[str, Any]]:
    """Uniforms of the light of cubes, and of lights past them, at the middle of each mesh."""
    # Only worlds of cubes need them
    from maths.environment_irradiance import COSINE
    from runtime import light_sights, probe_places

    volume = probe.cubes.volume
    matrices = [surface.placed.world_from_mesh(time) for surface in drawn]
    middles = np.array(
        [m[:3, :3] @ each.middle + m[:3, 3] for m, each in zip(matrices, drawn, strict=True)]
    )
    cells = probe_places.freed((middles - volume.origin) / volume.cell_size, volume.solid)
    middles = cells * volume.cell_size + volume.origin
    ambient = COSINE[:, None] * probe.project(middles, 2, time)
    seen = probe.around(middles, time).lights
    return [
        {
            **light_uniforms.of(light_sights.dimmed(lights, share)),
            "ambient": [tuple(row) for row in rows],
        }
        for share, rows in zip(seen, ambient, strict=True)
    ]
