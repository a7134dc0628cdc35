"""Light of a world of cubes at points, as harmonics, for meshes lit and shaded by it; no draw.

Rays in fixed, evenly spread directions find what the cubes and the environment send to each point.
Lamps are left out of them, for a few cells are soon missed: each is a ball of the same size on
average, and rays of its own tell how much of it is seen. Reads and writes no target.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from maths import spherical_harmonics, spherical_lights
from maths.sampling import fibonacci_sphere, r2
from runtime import cubes
from runtime.shader import SCREEN, set_uniforms

Array = NDArray[np.float64]

HERE = Path(__file__).parent
RAYS = 1024
"""Of a point."""
SIGHTS = 16
"""Rays from a point to a lamp."""
POINTS = 64
"""Most points of a draw."""
BALL = float(np.sqrt(1.5 / np.pi))
"""Radius of the ball that a cube of side 1 looks as large as on average: pi r^2 = 6 / 4."""
UNITS = ("world", "rows", "albedo", "lightmap", "page_of", "pages", "sky", "rays")


class Pass:
    """Answers `project` for passes that come later."""

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def __init__(self, player: Any) -> None:
        self._player = player
        self.cubes = cubes.of(player)
        self._lamps = self.cubes.described.lamps
        width = RAYS + SIGHTS * len(self._lamps)
        ctx, adopt = player.ctx, player.targets.adopt
        # Directions, then for each lamp places in a cube of half side 1
        self._directions = fibonacci_sphere(RAYS)
        number = np.arange(SIGHTS)
        inside = 2.0 * np.column_stack([r2(number), (number + 0.5) / SIGHTS]) - 1.0
        rays = np.zeros((width, 4), np.float32)
        rays[:RAYS, :3] = self._directions
        rays[RAYS:, :3] = np.tile(inside, (len(self._lamps), 1))
        rays[RAYS:, 3] = 1 + np.repeat(np.arange(len(self._lamps)), SIGHTS)
        self._rays = adopt(ctx.texture((width, 1), 4, rays.tobytes(), dtype="f4"), rays.nbytes)
        self._rays.filter = (moderngl.NEAREST, moderngl.NEAREST)
        target = adopt(ctx.texture((width, POINTS), 4, dtype="f4"), 16 * width * POINTS)
        self._target = player.keep(ctx.framebuffer([target]))
        self._sky = self.cubes.sky(player.lights)
        self._sky_texture = None if self._sky is None else self.cubes.lat_long(self._sky)
        defines = {
            **self.cubes.volume.defines,
            "LAMPS": len(self._lamps),
            "POINTS": POINTS,
            "SKY": self._sky is not None,
        }
        program = player.programs.get(SCREEN, HERE / "probe.frag", defines, {})
        self._array = player.vertex_array(program)
        self._basis: dict[int, Array] = {}

    def key(self, time: float) -> Hashable:
        """All that the light of `time` seconds depends on."""
        return self.cubes.key(time)

    def draw(self, time: float) -> None:
        """Nothing: passes ask when they know where."""
        self.cubes.at(time)

    def project(self, points: Array, l_max: int, time: float) -> Array:
        """Return coefficients of radiance (n, K, 3) at points (n, 3), metres, world axes."""
        if l_max not in self._basis:
            Y = spherical_harmonics.evaluate(self._directions, l_max)
            self._basis[l_max] = 4.0 * np.pi / RAYS * Y.T
        found = np.empty((len(points), (l_max + 1) ** 2, 3))
        for start in range(0, len(points), POINTS):
            part = slice(start, start + POINTS)
            radiance = self._cast(points[part], time)
            found[part] = self._basis[l_max] @ radiance[:, :RAYS, :3]
            found[part] += self._of_lamps(points[part], radiance[:, RAYS:, 3], l_max, time)
        return found

    def _cast(self, points: Array, time: float) -> Array:
        """Return radiance and sight (n, RAYS + sights, 4) of the rays from each point."""
        player, volume = self._player, self.cubes.volume
        count, width = len(points), RAYS + SIGHTS * len(self._lamps)
        origin = (points - volume.origin) / volume.cell_size
        padded = np.zeros((POINTS, 3))
        padded[:count] = origin
        middles = [
            (self.cubes.middle(lamp, time) - volume.origin) / volume.cell_size
            for lamp in self._lamps
        ]
        values = {
            "origin": [tuple(row) for row in padded],
            "size": volume.size,
            "n": self.cubes.faces.texels,
            "scale": volume.scale,
            "lamp": [(*m, 0.5 * lamp.side) for m, lamp in zip(middles, self._lamps, strict=True)],
            **{name: unit for unit, name in enumerate(UNITS)},
        }
        page_of, pages = self.cubes.pages()
        self._update_sky()
        used = (volume.world, volume.rows, volume.palette, self.cubes.light, page_of, pages)
        for unit, texture in enumerate((*used, self._sky_texture, self._rays)):
            if texture is not None:
                texture.use(unit)
        set_uniforms(self._array.program, values)
        self._target.viewport = (0, 0, width, count)
        self._target.use()
        player.ctx.enable_only(moderngl.NOTHING)
        player.targets.draw(self._array, mode=moderngl.TRIANGLES, vertices=3)
        raw = self._target.read(viewport=(0, 0, width, count), components=4, dtype="f4")
        return np.frombuffer(raw, np.float32).reshape(count, width, 4).astype(np.float64)

    def _update_sky(self) -> None:
        sky = self.cubes.sky(self._player.lights)
        if sky is not None and not np.array_equal(sky, self._sky):
            self._sky = sky
            self._sky_texture.write(cubes.texels(sky))

    def _of_lamps(self, points: Array, sight: Array, l_max: int, time: float) -> Array:
        size = self.cubes.volume.cell_size
        found = np.zeros((len(points), (l_max + 1) ** 2, 3))
        for i, lamp in enumerate(self._lamps):
            seen = sight[:, i * SIGHTS : (i + 1) * SIGHTS].mean(axis=1)
            shape = spherical_lights.project_sphere(
                points, self.cubes.middle(lamp, time), BALL * lamp.side * size, np.ones(1), l_max
            )
            found += seen[:, None, None] * shape * np.asarray(lamp.radiance.at(time))
        return found
