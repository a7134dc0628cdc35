"""Bloom: light that scatters around what is bright, and is missing there (`maths.bloom`).

The levels are half as large each; coming back each is mixed into the one below by blending, so that
they need no second set of textures. Reads colour, writes colour.
"""

from __future__ import annotations

from collections.abc import Hashable
from itertools import pairwise
from pathlib import Path
from typing import Any

import moderngl

from maths import bloom
from runtime.shader import SCREEN, set_uniforms

HERE = Path(__file__).parent


class Pass:
    """Spreads a share of the light."""

    reads = ("colour",)
    writes = ("colour",)

    def __init__(self, player: Any) -> None:
        self._player = player
        self._halve, self._double = (
            player.vertex_array(player.programs.get(SCREEN, HERE / name))
            for name in ("bloom_halve.frag", "bloom.frag")
        )

    @property
    def _bloom(self) -> Any:
        return self._player.scene.picture.bloom

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on besides the picture."""
        return (self._bloom.strength.at(time),)

    def draw(self, time: float) -> None:
        """Spread the light of the frame of `time` seconds."""
        frame, threshold = self._player.targets, self._bloom.threshold
        strength = self._bloom.strength.at(time)
        if strength == 0.0:
            return
        weights = bloom.weights(self._bloom.radius * frame.size[1])
        size, names = frame.size, ["colour", *(f"bloom_{i + 1}" for i in range(len(weights)))]
        targets = [frame.target("colour")]
        for fine, coarse in pairwise(names):
            size = (size[0] + 1) // 2, (size[1] + 1) // 2
            targets.append(frame.layers((coarse,), size))
            values = {"threshold": threshold if fine == "colour" else 0.0}
            self._run(self._halve, targets[-1], {"fine": fine}, values, moderngl.NOTHING)

        mixtures = bloom.mixtures(weights)
        for number in range(len(weights) - 1, 0, -1):
            values = {"threshold": 0.0, "strength": mixtures[number - 1]}
            read = {"coarse": names[number + 1], "before": names[number + 1]}
            self._run(self._double, targets[number], read, values, moderngl.BLEND)

        read, picture = {"coarse": names[1], "before": names[1]}, targets[0]
        if threshold > 0.0:
            # The picture is blended over, and what it gives away depends on it
            read["before"] = "bloom_before"
            copy = frame.layers(("bloom_before",), frame.size)
            frame.ctx.copy_framebuffer(copy, picture)
        values = {"threshold": threshold, "strength": strength}
        self._run(self._double, picture, read, values, moderngl.BLEND)

    def _run(
        self, array: Any, target: Any, read: dict[str, str], values: dict[str, Any], flags: int
    ) -> None:
        """Draw the screen with textures by the names of their samplers."""
        frame = self._player.targets
        units = dict(zip(read, range(len(read)), strict=True))
        for sampler, texture in read.items():
            frame.texture(texture).use(units[sampler])
        set_uniforms(array.program, {**values, **units})
        target.use()
        frame.ctx.enable_only(flags)
        frame.ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        frame.draw(array, mode=moderngl.TRIANGLES, vertices=3)
