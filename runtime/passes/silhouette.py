"""Fins along the outlines of coarse meshes, which make them round and soft (`maths.silhouette`).

Reads colour and depth, writes both. Outlines are found anew for each view on the processor, and
drawn into a layer that keeps the most of overlapping fins, so that their order does not matter; the
layer is then laid over the picture. What lies within the polygons is not touched.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from formats import mesh as meshes
from formats.meshes import EFFECTS, KINDS, PlacedMesh
from formats.scene import NEAR
from maths import silhouette, silhouette_edges
from runtime import reuse
from runtime.shader import SCREEN, set_uniforms

HERE = Path(__file__).parent
LAYER = (("silhouette", 4, "f2"), ("silhouette_nearness", 1, "f4"))


class Pass:
    """Rounds the outlines of meshes with a `silhouette_width`."""

    reads = ("colour", "depth")
    writes = ("colour", "depth")

    def __init__(self, player: Any) -> None:
        self._player = player
        self._edges: dict[str, silhouette_edges.Edges] = {}
        found: dict[Path, silhouette_edges.Edges] = {}
        for placed in player.scene.meshes:
            if placed.silhouette_width > 0 and EFFECTS[placed.lighting] in player.called:
                # A mesh that stands in several places has its edges once
                folder = player.folders(KINDS[placed.lighting])[placed.name]
                if folder not in found:
                    found[folder] = _edges(folder, placed)
                self._edges[placed.name] = found[folder]
        self._program = player.programs.get(HERE / "silhouette.vert", HERE / "silhouette.frag")
        over = player.programs.get(SCREEN, HERE / "silhouette_over.frag")
        self._over = player.vertex_array(over)
        self._room = (0, 0)
        self._made: tuple[Any, ...] = ()

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on besides the opaque picture."""
        places = [placed.world_from_mesh(time) for placed in self._meshes()]
        return reuse.camera(self._player.view), reuse.frozen(places)

    def draw(self, time: float) -> None:
        """Draw the fins of `time` seconds."""
        found = [self._fins(placed, time) for placed in self._meshes()]
        found = [fins for fins in found if len(fins.vertices)]
        if not found:
            return
        count = self._upload(found)
        frame = self._player.targets
        frame.texture("colour").use(0)
        frame.texture("depth").use(1)
        layer = frame.targets(LAYER, None)
        layer.use()
        layer.clear(0.0, 0.0, 0.0, 0.0)
        frame.ctx.enable_only(moderngl.BLEND)
        frame.ctx.blend_equation = moderngl.MAX
        frame.ctx.blend_func = moderngl.ONE, moderngl.ONE
        values = {"size": tuple(map(float, frame.size)), "opaque_colour": 0, "opaque_depth": 1}
        set_uniforms(self._program, values)
        frame.draw(self._made[2], mode=moderngl.TRIANGLES, vertices=count)
        frame.ctx.blend_equation = moderngl.FUNC_ADD

        frame.texture("silhouette").use(0)
        frame.texture("silhouette_nearness").use(1)
        set_uniforms(self._over.program, {"fins": 0, "fins_nearness": 1})
        frame.target("colour", "depth").use()
        # Depth is written where there is a fin, whatever it was
        frame.ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        frame.ctx.depth_func = "1"
        frame.ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        frame.draw(self._over, mode=moderngl.TRIANGLES, vertices=3)

    def _meshes(self) -> list[PlacedMesh]:
        """The meshes with fins, as the scene has them now."""
        found = [mesh for mesh in self._player.scene.meshes if mesh.name in self._edges]
        return [mesh for mesh in found if self._player.shows("mesh", mesh.name)]

    def _fins(self, placed: PlacedMesh, time: float) -> silhouette.Fins:
        player = self._player
        size, world_from_mesh = player.targets.size, placed.world_from_mesh(time)
        eye = np.linalg.solve(world_from_mesh, np.append(player.view.position, 1.0))[:3]
        return silhouette.fins(
            self._edges[placed.name],
            player.view.clip_from_world(size[0] / size[1]) @ world_from_mesh,
            eye,
            size,
            width=placed.silhouette_width / placed.scale,
            softness=placed.silhouette_softness,
            near=NEAR,
        )

    def _upload(self, found: list[silhouette.Fins]) -> int:
        """Write the vertices of all fins and their triangles; return how many corners."""
        rows = [fins.vertices.reshape(-1, fins.vertices.shape[-1]) for fins in found]
        starts = np.cumsum([0, *(len(each) for each in rows)])
        data = np.concatenate(rows).astype(np.float32)
        index = np.concatenate([f.triangles + at for f, at in zip(found, starts, strict=False)])
        index = np.ascontiguousarray(index, np.int32)
        if data.nbytes > self._room[0] or index.nbytes > self._room[1]:
            self._make_room(data.nbytes, index.nbytes)
        self._made[0].write(data)
        self._made[1].write(index)
        return int(index.size)

    def _make_room(self, vertices: int, index: int) -> None:
        """Make buffers twice as large as is asked for: several frames need no new ones."""
        player, self._room = self._player, (2 * vertices, 2 * index)
        buffers = tuple(player.buffer(size) for size in self._room)
        names = [name for name, _ in silhouette.COLUMNS]
        layout = " ".join(f"{size}f" for _, size in silhouette.COLUMNS)
        content = [(buffers[0], layout, *names)]
        self._made = (*buffers, player.vertex_array(self._program, content, buffers[1]))


def _edges(folder: Path, placed: PlacedMesh) -> silhouette_edges.Edges:
    """The edges of a mesh as it is drawn, all materials together."""
    if placed.lighting == "direct":
        parts = meshes.primitives(folder)
    else:
        # Only scenes that call for transfer need its format
        from formats import transfer

        parts = transfer.primitives(folder)
    starts = np.cumsum([0, *(len(part.positions) for part in parts)])
    return silhouette_edges.of_triangles(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([p.indices + at for p, at in zip(parts, starts, strict=False)]),
    )
