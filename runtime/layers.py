"""Layers of a frame beside the finished light: what is asked for is read while the frame is drawn.

Passes that only read stand between those of the player; a player without them costs nothing. All
values are scene-linear or metric, one pixel centre a pixel but for the colours and the coverage,
which hold the mean of the samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.scene import NEAR
from runtime.shader import SCREEN
from runtime.surfaces import GEOMETRY

HERE = Path(__file__).parent
CHANNELS = {
    "depth": "Z",
    "position": "XYZ",
    "normal": "XYZ",
    "id": "I",
    "coverage": "A",
    "opaque": "RGB",
    "sprites": "RGBA",
    "before_post": "RGB",
}
"""Layers, and a letter for each of their channels."""
FAR = 1e10
"""Depth of what is infinitely far, metres."""
LENS = ("defocus", "particles", "billboard")
POST = ("radial_blur", "bloom", "film")


class Layers:
    """Takes layers of the frames of a player.

    names : from CHANNELS. `depth` is metres along the axis, FAR where nothing opaque is; position
    and normal are in the world (0 where nothing opaque is), and so is the ground's; `id` is the
    mesh's place among the scene's, from 1, and 0 elsewhere; `coverage` is the share of a pixel that
    is opaque; `opaque` the light before lens and sprites, `sprites` what they add, premultiplied,
    `before_post` the light before radial blur and bloom. Raises InputError for other names.
    """

    def __init__(self, player: Any, names: Sequence[str]) -> None:
        self._player, self.names = player, tuple(dict.fromkeys(names))
        for name in self.names:
            if name not in CHANNELS:
                known = ", ".join(CHANNELS)
                raise InputError("command line", "--layers", name, f"choose from {known}, or all")
        self._found: dict[str, NDArray[Any]] = {}
        geometry = GEOMETRY if {"position", "normal", "id"} & set(self.names) else ()
        self._coverage_of: Any = None
        taps: list[tuple[tuple[str, ...], str, _Tap]] = []
        if "coverage" in self.names:
            taps.append((("fog", *LENS, *POST), "coverage", _Tap(self._coverage, (), True)))
        if self.names:
            reads = ("colour", "depth", *geometry)
            taps.append(((*LENS, *POST), "opaque", _Tap(self._opaque, reads)))
        if "sprites" in self.names and "billboard" in player.passes:
            taps.append((("billboard",), "sprites", _Tap(self._sprites, ("colour", "depth"))))
        if "before_post" in self.names:
            taps.append((POST, "before_post", _Tap(self._before_post, ("colour",))))
        self._drawn = dict(player.passes)
        for before, name, tap in taps:
            player.passes = _inserted(player.passes, before, f"layer {name}", tap)
        for drawn in player.passes.values():
            # What it draws besides is chosen when it first draws
            if getattr(drawn, "_geometry", None) is not None:
                drawn._geometry = None

    def take(self, time: float) -> dict[str, NDArray[np.float32]]:
        """Return layer -> (h, w, c) of `time` seconds, row 0 on top; `beauty` is all light, RGB."""
        self._found = {}
        beauty = self._player.linear(time)[..., :3]
        shape = beauty.shape[:2]
        found = {"beauty": beauty}
        for name in self.names:
            taken = self._found.get(name, np.zeros((*shape, len(CHANNELS[name])), np.float32))
            found[name] = np.ascontiguousarray(taken, np.float32)
        return found

    def remove(self) -> None:
        """Give the player its own passes back."""
        self._player.passes = self._drawn

    # taken between passes

    def _opaque(self, time: float) -> None:
        self._found["opaque"] = self._read("colour")[..., :3]
        nearness = 1.0 - self._read("depth", 1, np.float32).astype(np.float64)
        near = nearness > 0
        self._found["depth"] = np.where(near, NEAR / np.where(near, nearness, 1.0), FAR)
        if {"position", "normal", "id"} & set(self.names):
            self._geometry(time)

    def _geometry(self, time: float) -> None:
        """Read what meshes and cubes drew, and put the ground where it is nearer."""
        player, (width, height) = self._player, self._player.targets.size
        shape = (height, width)
        position, normal = np.zeros((*shape, 4)), np.zeros((*shape, 4))
        number = np.zeros((*shape, 1))
        if {"surface", "transfer", "voxels"} & set(player.passes):
            position = self._read("position", 4, np.float32).astype(np.float64)
            normal = self._read("normal").astype(np.float64)
            number = np.maximum(self._read("id", 1, np.int32), 0).astype(np.float64)
        if "ground" in player.passes:
            camera = player.view
            x = (np.arange(width) + 0.5) / width * 2 - 1
            y = 1 - (np.arange(height) + 0.5) / height * 2
            screen = np.stack([*np.meshgrid(x, y), np.ones(shape)], axis=-1)
            ray = screen @ camera.world_from_ray(width / height).T
            falls = ray[..., 1]
            drop = player.scene.ground.height - camera.position[1]
            depth = drop / np.where(falls == 0, np.inf, falls)
            there = np.where(normal[..., 3] > 0, camera.depth(position[..., :3]), np.inf)
            ground = (depth > NEAR) & (depth < there)
            plane = camera.position + np.where(ground, depth, 0.0)[..., None] * ray
            position[ground, :3] = plane[ground]
            normal[ground, :3] = 0.0, 1.0, 0.0
            number[ground] = 0
        self._found["position"], self._found["normal"] = position[..., :3], normal[..., :3]
        self._found["id"] = number

    def _sprites(self, time: float) -> None:
        """Draw the sprites on black, then put the picture back for them to be drawn over."""
        targets = self._player.targets
        colour = targets.texture("colour")
        kept = colour.read(alignment=1)
        targets.target("colour").clear(0.0, 0.0, 0.0, 0.0)
        self._player.passes["billboard"].draw(time)
        self._found["sprites"] = self._read("colour")
        colour.write(kept, alignment=1)

    def _before_post(self, time: float) -> None:
        self._found["before_post"] = self._read("colour")[..., :3]

    def _coverage(self, time: float) -> None:
        """Count opaque samples in alpha, which nothing else uses before the lens."""
        player, targets = self._player, self._player.targets
        if self._coverage_of is None:
            program = player.programs.get(SCREEN, HERE / "layers_coverage.frag", {}, {})
            self._coverage_of = player.vertex_array(program)
        target = targets.opaque()
        masks = target.color_mask, target.depth_mask
        # Masks count from the next `use`
        target.color_mask, target.depth_mask = (False, False, False, True), False
        target.use()
        # The screen triangle lies at infinity: it passes in front of nothing but the sky
        for tested, alpha in ((False, 0.0), (True, 1.0)):
            player.ctx.enable_only(moderngl.DEPTH_TEST if tested else moderngl.NOTHING)
            player.ctx.depth_func = ">"
            self._coverage_of.program["alpha"] = alpha
            self._coverage_of.render(mode=moderngl.TRIANGLES, vertices=3)
        targets.unresolved = targets.samples > 1
        targets.resolve()
        self._found["coverage"] = self._read("colour")[..., 3:]
        targets.opaque().use()
        player.ctx.enable_only(moderngl.NOTHING)
        self._coverage_of.render(mode=moderngl.TRIANGLES, vertices=3)
        target.color_mask, target.depth_mask = masks

    def _read(self, name: str, components: int = 4, dtype: Any = np.float16) -> NDArray[Any]:
        targets = self._player.targets
        width, height = targets.size
        data = np.frombuffer(targets.texture(name).read(alignment=1), dtype)
        return data.reshape(height, width, components)[::-1]


class _Tap:
    """A pass that draws nothing and takes what there is. opaque : before samples are averaged."""

    writes: tuple[str, ...] = ()

    def __init__(
        self, take: Callable[[float], None], reads: tuple[str, ...], opaque: bool = False
    ) -> None:
        self.draw, self.reads, self.opaque = take, reads, opaque


def _inserted(
    passes: dict[str, Any], before: tuple[str, ...], name: str, tap: _Tap
) -> dict[str, Any]:
    """Return passes with one more before the first of those named, or at the end."""
    order = list(passes.items())
    at = next((i for i, (n, _) in enumerate(order) if n in before), len(order))
    return dict([*order[:at], (name, tap), *order[at:]])
