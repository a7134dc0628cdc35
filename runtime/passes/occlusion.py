"""Soft shadows of meshes on what is opaque, in light of any number of lamps, at one price.

After what is opaque and the sky, before fog and sprites: each caster multiplies the picture by the
share of the light that its volume leaves. The sky is left out, and what surfaces emit is added
afterwards. Reads depth, whose a pixel is (`id`) where a caster leaves itself out, and how it lies
(`normal`) where a caster asks for the receiver's normal; writes colour. Drawn on the samples of
what is opaque: where an edge lies within a pixel, once for what is before it and once for what is
behind it; beside the sky by one depth a pixel. A shadow ends where it would take less than half a
code of white.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats.scene import NEAR
from maths.colour import srgb_decode
from runtime import casters, reuse, surfaces
from runtime.camera import column_major
from runtime.incident import Incident
from runtime.shader import SCREEN, set_uniforms
from runtime.shadow_light import SLABS

HERE = Path(__file__).parent
LEAST = 1.0 - float(srgb_decode(1.0 - 0.5 / 255.0))
"""Share of light that is half a code of white under the linear curve."""
HIDDEN = ("first_hidden", "second_hidden", "first_coarse", "second_coarse")
"""Volumes of the shader, in the order of `shadow_light.Volumes`."""
FACING = 4.0
"""Light on a surface that faces all of it, over the mean of all surfaces."""


class Pass:
    """Multiplies the opaque picture by every caster's shadow."""

    opaque = True
    writes = ("colour",)

    def __init__(self, player: Any) -> None:
        self._player = player
        self.casters = casters.load(player)
        drawn = [s for p in player.passes.values() for s in getattr(p, "surfaces", ())]
        own = any(not c.shadow.self for c in self.casters if c.number in {s.number for s in drawn})
        normals = bool(drawn) and any(c.shadow.receiver_normal for c in self.casters)
        self.reads = ("depth", *("id",) * own, *("normal",) * normals)
        self._arrays = [self._array(caster) for caster in self.casters]
        self._emission = _Emission(player, drawn)
        self._incident = Incident(player, max((c.l_max for c in self.casters), default=0))

    def _array(self, caster: casters.Caster) -> Any:
        shadow = caster.shadow
        defines = {
            "COARSE": len(caster.asset.grids) > 1,
            "FALLOFF": shadow.falloff,
            "OWN": "id" in self.reads and not shadow.self,
            "RECEIVER": shadow.receiver_normal,
            "NORMALS": "normal" in self.reads and shadow.receiver_normal,
            "SAMPLED": self._player.targets.samples > 1,
        }
        if shadow.receiver_normal:
            defines["SLABS"] = SLABS
        program = self._player.programs.get(SCREEN, HERE / "occlusion.frag", defines, {})
        return self._player.vertex_array(program)

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        player = self._player
        places = [mesh.world_from_mesh(time) for mesh in player.scene.meshes]
        return reuse.camera(player.view), reuse.frozen((player.lights, places))

    def weights(self, time: float) -> list[NDArray[np.float64]]:
        """Weights (2, C, 4 P) of each caster's stored values under the lights of `time` seconds."""
        pairs = zip(self.casters, self.light(time), strict=True)
        return [caster.weights(pair, time) for caster, pair in pairs]

    def light(self, time: float) -> NDArray[np.float64]:
        """Light (casters, 2, K, 3) at the ends of each caster, at `time` seconds."""
        if not self.casters:
            return np.zeros((0, 2, 1, 3))
        ends = np.concatenate([caster.ends(time) for caster in self.casters])
        light = self._incident.project(ends, time)
        return np.asarray(light.reshape(-1, 2, *light.shape[1:]))

    def draw(self, time: float) -> None:
        """Draw the shadows of `time` seconds."""
        player, targets = self._player, self._player.targets
        light = self.light(time)
        if targets.samples > 1:
            targets.resolve()
            target = targets.opaque()
        else:
            target = targets.target("colour")
        # The screen triangle lies at infinity: it passes in front of nothing but the sky
        player.ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        player.ctx.depth_func = ">"
        player.ctx.blend_func = moderngl.ZERO, moderngl.SRC_COLOR
        targets.texture("depth").use(0)
        if "id" in self.reads:
            targets.texture("id").use(5)
        if "normal" in self.reads:
            targets.texture("normal").use(6)
        try:
            target.depth_mask = False
            for caster, array, each in zip(self.casters, self._arrays, light, strict=True):
                name = caster.placed.name
                if player.shows("mesh", name) and player.shows("shadow", name):
                    self._draw(target, caster, array, each, time)
        finally:
            target.scissor, target.depth_mask = None, True
        self._emission.draw(time)

    def _draw(
        self,
        target: Any,
        caster: casters.Caster,
        array: Any,
        light: NDArray[np.float64],
        time: float,
    ) -> None:
        player = self._player
        weights = caster.weights(light, time)
        receiver = caster.shadow.receiver_normal
        # Of a receiver's light: one that faces as much of it as the mean, or more
        reach = caster.reach(weights, LEAST / FACING if receiver else LEAST)
        world_from_mesh = caster.placed.world_from_mesh(time)
        middle = world_from_mesh[:3, :3] @ caster.asset.box.centre + world_from_mesh[:3, 3]
        area = window(player.view, player.targets.size, middle, reach * caster.placed.scale)
        if area is None:
            return
        object_from_world = caster.object_from_world(time)
        linear, eye = object_from_world[:3, :3], player.view.position
        ground = player.scene.ground if "ground" in player.passes else None
        grids = caster.asset.grids
        values = {
            **player.view.uniforms(player.targets.size),
            "opaque_depth": 0,
            **{name: 1 + unit for unit, name in enumerate(HIDDEN)},
            "mesh_number": 5,
            "mesh_normal": 6,
            "depth": (float(grids[0].shape[1]), float(grids[-1].shape[1])),
            "warp": caster.asset.warp,
            "object_from_world": column_major(linear),
            "object_camera": tuple(linear @ eye + object_from_world[:3, 3]),
            "longest": tuple(np.eye(3)[caster.asset.box.longest_axis]),
            "extent": tuple(caster.extent),
            "reach": min(reach, 1e18),
            "own": caster.number,
            "ground": (0.0, 0.0) if ground is None else (float(eye[1] - ground.height), 1.0),
        }
        if receiver:
            weights, facing = caster.receiver_weights(light, time)
            facing = np.broadcast_to(facing, (2, 9, 3)).reshape(-1, 3)
            values["facing"] = [tuple(row) for row in facing]
        set_uniforms(array.program, values)
        caster.volumes.write(weights)
        for unit, texture in enumerate(caster.volumes.textures, start=1):
            texture.use(unit)
        target.scissor = area
        target.use()
        # Where an edge lies within a pixel, samples before it and behind it are drawn apart
        for side in range(2 if player.targets.samples > 1 else 1):
            player.ctx.depth_func = "<" if side else ">"
            set_uniforms(array.program, {"side": side})
            player.targets.draw(array, mode=moderngl.TRIANGLES, vertices=3)


class _Emission:
    """Adds what surfaces emit, sample by sample: shadows take nothing of it."""

    def __init__(self, player: Any, drawn: list[surfaces.Surface]) -> None:
        self._player = player
        self._parts = [(each, part) for each in drawn for part in each.parts if any(part.emissive)]
        self._arrays = [self._array(part) for _, part in self._parts]

    def _array(self, part: Any) -> Any:
        flags = {"TEXTURED": False, "COLOURED": False}
        program = self._player.programs.get(
            HERE / "surface.vert", HERE / "occlusion_emission.frag", {}, flags
        )
        return self._player.vertex_array(program, part.content(program), part.index)

    def draw(self, time: float) -> None:
        """Add the emission of `time` seconds."""
        player = self._player
        others = [p for p in player.passes.values() if hasattr(p, "emit")]
        if not self._parts and not others:
            return
        player.targets.opaque().use()
        player.ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        player.ctx.depth_func = "<="
        player.ctx.blend_func = moderngl.ONE, moderngl.ONE
        for (surface, part), array in zip(self._parts, self._arrays, strict=True):
            if not player.shows("mesh", surface.placed.name):
                continue
            place = surfaces.place_uniforms(player, surface, time)
            set_uniforms(array.program, {**place, "emissive": part.emissive})
            player.targets.draw(array, mode=moderngl.TRIANGLES)
        for drawn in others:
            drawn.emit(time)


def window(
    view: Any, size: tuple[int, int], middle: NDArray[np.float64], radius: float
) -> tuple[int, int, int, int] | None:
    """Return pixels (x, y, width, height), y up, that hold a ball in world space; None for none.

    The whole picture where the ball reaches behind the camera.
    """
    width, height = size
    eye = view.view_from_world[:3, :3] @ middle + view.view_from_world[:3, 3]
    if -eye[2] + radius <= NEAR:
        return None
    if not -eye[2] - radius > NEAR:
        return 0, 0, width, height
    half = 0.5 * view.sensor_height / view.focal_length
    low, high = [], []
    for axis, side, pixels in ((0, half * width / height, width), (1, half, height)):
        ends = eye[axis] + radius * np.array([-1.0, 1.0])
        # The box around the ball: its corners lie at the nearest and the farthest depth
        slopes = ends[:, None] / (-eye[2] + radius * np.array([-1.0, 1.0]))
        at = (0.5 + 0.5 * slopes / side) * pixels
        low.append(int(np.clip(np.floor(at.min()), 0, pixels)))
        high.append(int(np.clip(np.ceil(at.max()), 0, pixels)))
    if low[0] >= high[0] or low[1] >= high[1]:
        return None
    return low[0], low[1], high[0] - low[0], high[1] - low[1]
