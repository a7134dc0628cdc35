"""Shadows and contact of sprites on the ground, multiplied into one target.

Channels of the target `shade`: share of suns 0, 1 and 2 that reaches the ground, and of the sky.
Each sprite's own coverage is laid on the ground away from each sun, as the outline of a body of
revolution: slices of it are sheared by height / tan(elevation), which at a low sun is the sprite
laid flat and at noon its crown seen from above. The level of detail rises with the penumbra's
width.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from runtime.shader import set_uniforms

HERE = Path(__file__).parent / "passes"
SUNS = 3  # that throw shadows: the colour channels of the target
SLICES = 8
COARSEST = 5  # level of detail of the softest shadow
FAINT = 1 / 512  # of the brightest sun's light on the ground: half an 8-bit code
STEEPEST, FLATTEST = 20.0, 1 / 10  # tangent of the elevation; no shadow is longer than 10 heights


class GroundShadows:
    """Draws the target `shade` for the ground pass."""

    def __init__(self, player: Any, lens: bool) -> None:
        self._player = player
        self._sets = [s for s in player.sprites if s.shadow and len(s.positions)]
        self._suns = min(SUNS, sum(light.type == "sun" for light in player.scene.lights))
        self._lens = lens
        if not self._sets:
            return
        programs = player.programs
        self._contact = programs.get(HERE / "ground_contact.vert", HERE / "ground_contact.frag")
        self._shadow = self._suns and programs.get(
            HERE / "ground_shadow.vert",
            HERE / "ground_shadow.frag",
            {"LENS": lens},
            {},
        )
        self._buffers = [player.buffer(24 * len(s.positions)) for s in self._sets]
        self._contacts = [self._array(self._contact, b, "4f 8x/i", "place") for b in self._buffers]
        if self._suns:
            self._shadows = [
                self._array(self._shadow, b, "4f 2f/i", "place", "which") for b in self._buffers
            ]

    def _array(self, program: Any, buffer: Any, layout: str, *names: str) -> Any:
        return self._player.vertex_array(program, [(buffer, layout, *names)])

    def draw(self, height: float, lens: dict[str, float]) -> None:
        """Draw all shadows at this moment's lights on the plane y = height."""
        player, frame = self._player, self._player.targets
        target = frame.target("shade")
        target.use()
        target.clear(1.0, 1.0, 1.0, 1.0)
        if not self._sets:
            return
        player.ctx.enable_only(moderngl.BLEND)
        player.ctx.blend_func = moderngl.DST_COLOR, moderngl.ZERO
        camera = {**player.view.uniforms(frame.size), **lens, "height": height}
        set_uniforms(self._contact, camera)
        self._fill(np.zeros(2))
        for sprites, array in zip(self._sets, self._contacts, strict=True):
            if not sprites.shadow:
                continue
            self._contact["body"] = sprites.foot, sprites.crown
            self._contact["cover"] = sprites.cover
            frame.draw(
                array, mode=moderngl.TRIANGLE_STRIP, vertices=4, instances=len(sprites.positions)
            )
        suns = player.lights.suns
        brightest = max((float((s.irradiance * s.to_light[1]).max()) for s in suns), default=0.0)
        for number, sun in enumerate(suns[: self._suns]):
            if (sun.irradiance * sun.to_light[1]).max() > FAINT * max(brightest, 1e-12):
                set_uniforms(self._shadow, camera)
                self._sun(number, sun)

    def _sun(self, number: int, sun: Any) -> None:
        x, y, z = sun.to_light
        level = np.hypot(x, z)
        away = -np.array([x, z]) / level if level > 1e-6 else np.array([0.0, 1.0])
        tangent = float(np.clip(y / max(level, 1e-6), FLATTEST, STEEPEST))
        program = self._shadow
        set_uniforms(
            program,
            {
                "planes": 0,
                "away": tuple(away),
                "tangent": tangent,
                "radius": sun.radius,
                "coarsest": float(COARSEST),
                "channel": tuple(np.eye(4)[number]),
            },
        )
        self._fill(np.array([x, z]))
        for sprites, array in zip(self._sets, self._shadows, strict=True):
            if not sprites.shadow:
                continue
            asset = sprites.asset
            sprites.texture.use(0)
            program["size"] = asset.size
            program["pivot"] = asset.pivot
            program["alpha_scale"] = float(asset.scales[0, 3])
            program["reach"] = _reach(sprites)
            program["slices"] = _slices(sprites, tangent)
            self._player.targets.draw(
                array, mode=moderngl.TRIANGLE_STRIP, vertices=4, instances=len(sprites.positions)
            )

    def _fill(self, towards: Any) -> None:
        """Write the instances, each with the baked view that the sun sees best."""
        azimuth = np.arctan2(*towards)
        for sprites, buffer in zip(self._sets, self._buffers, strict=True):
            rows = np.empty((len(sprites.positions), 6), np.float32)
            rows[:, :3], rows[:, 3] = sprites.positions, sprites.scale
            rows[:, 4] = sprites.view_from(azimuth) * sprites.asset.planes
            rows[:, 5] = np.where(sprites.flip, -1.0, 1.0)
            buffer.write(rows)


def _reach(sprites: Any) -> tuple[float, float, float, float]:
    """Half width, lowest, highest, metres per texel of a set at scale 1, soft edge included."""
    asset = sprites.asset
    left, top, right, bottom = sprites.boxes[min(COARSEST, len(sprites.boxes) - 1)]
    (w, h), (x, y), m = asset.size, asset.pivot, asset.metres_per_texel
    half = max(abs(left * w - x), abs(right * w - x)) * m
    return half, (y - bottom * h) * m, (y - top * h) * m, m


def _slices(sprites: Any, tangent: float) -> int:
    """Slices of a body: as many as the part of its height that a spot's ray crosses asks.

    At a low sun the ray crosses the body level, and the sprite laid flat is the shadow.
    """
    crossed = 2 * sprites.crown * tangent / max(sprites.asset.height, 1e-6)
    return int(np.clip(np.ceil(crossed * SLICES - 0.5), 1, SLICES))
