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

from runtime import light_uniforms, reuse, surfaces
from runtime.camera import column_major
from runtime.shader import set_uniforms

HERE = Path(__file__).parent
GEOMETRY = {"position": (4, "f4"), "normal": (4, "f2"), "id": (1, "i4")}


class Pass:
    """Draws every mesh of the scene."""

    reads: tuple[str, ...] = ()
    writes = ("colour", "depth", *GEOMETRY)
    opaque = True

    def __init__(self, player: Any) -> None:
        self._player = player
        self._surfaces = surfaces.load(player)
        self._environment = "environment" in player.called
        self._defines = {
            **light_uniforms.counts(player.scene),
            "ENVIRONMENT": self._environment,
        }
        self._arrays = [[self._array(part) for part in s.parts] for s in self._surfaces]
        self._geometry: _Geometry | None = None

    def _array(self, part: surfaces.Part) -> Any:
        program = self._player.programs.get(
            HERE / "surface.vert",
            HERE / "surface.frag",
            {**self._defines, **part.defines},
            part.defines,
        )
        return self._player.vertex_array(program, part.content(program), part.index)

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        player = self._player
        places = [s.placed.world_from_mesh(time) for s in self._surfaces]
        return reuse.camera(player.view), reuse.frozen((player.lights, places))

    def draw(self, time: float) -> None:
        """Draw the meshes of `time` seconds."""
        player = self._player
        if wanted := self._wanted():
            self._geometry = self._geometry or _Geometry(player, self._surfaces, wanted)
            self._geometry.draw(time)
            if player.targets.samples <= 1:
                # It shares the depth of the picture, which nothing was drawn into yet
                player.targets.opaque().clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        values = light_uniforms.of(player.lights)
        if self._environment:
            ambient = player.passes["environment"].irradiance_harmonics(player.lights)
            values["ambient"] = [tuple(row) for row in ambient]
        programs = {id(a.program): a.program for row in self._arrays for a in row}
        for program in programs.values():
            set_uniforms(program, values)
        player.targets.opaque().use()
        player.ctx.enable_only(moderngl.DEPTH_TEST)
        player.ctx.depth_func = "<="
        for surface, arrays in zip(self._surfaces, self._arrays, strict=True):
            place = place_uniforms(player, surface, time)
            for part, array in zip(surface.parts, arrays, strict=True):
                if part.texture is not None:
                    part.texture.use(0)
                look = {"base_color": part.base_color, "emissive": part.emissive}
                set_uniforms(array.program, {**place, **look, "albedo_texture": 0})
                player.targets.draw(array, mode=moderngl.TRIANGLES)

    def _wanted(self) -> tuple[str, ...]:
        read = {name for drawn in self._player.passes.values() for name in drawn.reads}
        return tuple(name for name in GEOMETRY if name in read)


class _Geometry:
    """Draws the targets that later passes read, one sample a pixel."""

    def __init__(
        self, player: Any, meshes: tuple[surfaces.Surface, ...], wanted: tuple[str, ...]
    ) -> None:
        self._player, self._surfaces = player, meshes
        self._names = tuple((name, *GEOMETRY[name]) for name in wanted)
        places = {f"AT_{name.upper()}": i for i, name in enumerate(wanted)}
        flags = {name.upper(): name in wanted for name in GEOMETRY}
        program = player.programs.get(
            HERE / "surface.vert",
            HERE / "surface_geometry.frag",
            {**flags, **places},
            {"TEXTURED": False, "COLOURED": False},
        )
        self._arrays = [[self._array(program, part) for part in s.parts] for s in meshes]

    def _array(self, program: Any, part: surfaces.Part) -> Any:
        return self._player.vertex_array(program, part.content(program), part.index)

    def draw(self, time: float) -> None:
        """Draw the nearest surface of each pixel at `time` seconds."""
        player = self._player
        target = player.targets.targets(self._names, "depth")
        target.use()
        target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        player.ctx.enable_only(moderngl.DEPTH_TEST)
        player.ctx.depth_func = "<="
        for surface, arrays in zip(self._surfaces, self._arrays, strict=True):
            place = {**place_uniforms(player, surface, time), "number": surface.number}
            for array in arrays:
                set_uniforms(array.program, place)
                player.targets.draw(array, mode=moderngl.TRIANGLES)


def place_uniforms(player: Any, surface: surfaces.Surface, time: float) -> dict[str, Any]:
    """Matrices of a mesh at `time` seconds."""
    width, height = player.targets.size
    world_from_mesh = surface.placed.world_from_mesh(time)
    clip_from_world = player.view.clip_from_world(width / height)
    return {
        "clip_from_mesh": column_major(clip_from_world @ world_from_mesh),
        "world_from_mesh": column_major(world_from_mesh),
        # A rotation: the inverse transpose of a rotation and one scale is that rotation
        "world_from_normal": column_major(world_from_mesh[:3, :3] / surface.placed.scale),
    }
