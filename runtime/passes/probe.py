"""Light of a world of cubes at points, for sprites and meshes lit and shaded by it; no draw.

Rays in fixed, evenly spread directions find what the cubes and the environment send to each point,
others go to a few places on what glows. Lamps have rays of their own, which tell how much of a ball
of the same size on average is seen; so has each of the scene's lights. Reads and writes no target.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from maths import spherical_harmonics, spherical_lights
from maths.sampling import fibonacci_sphere, r2
from runtime import cubes, light_sights, reuse
from runtime.shader import SCREEN, set_uniforms

if TYPE_CHECKING:
    from runtime.probe_glow import Glowing

Array = NDArray[np.float64]
Basis = Callable[[Array], Array]

HERE = Path(__file__).parent
RAYS = 1024
"""Of a point."""
EVEN = RAYS / (4.0 * np.pi)
"""Rays a steradian."""
PLACES = 128
"""On what glows."""
SIGHTS = 16
"""Rays from a point to a lamp or light."""
POINTS = 64
"""Most points of a draw."""
KEPT = 16
"""Sets of points whose light is kept until it changes."""
BALL = float(np.sqrt(1.5 / np.pi))
"""Radius of the ball that a cube of side 1 looks as large as on average: pi r^2 = 6 / 4."""
UNITS = ("world", "rows", "albedo", "lightmap", "page_of", "pages", "sky", "rays")


@dataclass(frozen=True, eq=False)
class Around:
    """What comes to n points, world axes. radiance : (n, RAYS, 3) along the pass's directions.

    places : (n, m) 1 for places on what glows that are seen, else 0. lamps, lights : (n, lamps),
    (n, lights) share of each that is seen, lights in the order of `runtime.light_sights`.
    """

    radiance: NDArray[np.float32]
    places: Array
    lamps: Array
    lights: Array


@dataclass(frozen=True, eq=False)
class Ball:
    """A lamp as points see it: middle (3,), metres, radius, radiance (3,)."""

    middle: Array
    radius: float
    radiance: Array


class Pass:
    """Answers `around` and `project` for passes that come later."""

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def __init__(self, player: Any) -> None:
        self._player = player
        self.cubes = cubes.of(player)
        self._lamps = self.cubes.described.lamps
        self._lights = light_sights.count(player.scene)
        volume = self.cubes.volume
        glows = bool(self.cubes.world.voxels.emission.any())
        self._places = PLACES if glows else 0
        sights = SIGHTS * (len(self._lamps) + self._lights)
        self._width = width = RAYS + self._places + sights
        ctx, adopt = player.ctx, player.targets.adopt
        # Directions, places that glow, for each lamp places in a cube of half side 1, then lights
        self.directions = fibonacci_sphere(RAYS)
        number = np.arange(SIGHTS)
        inside = 2.0 * np.column_stack([r2(number), (number + 0.5) / SIGHTS]) - 1.0
        rays = self._table = np.zeros((width, 4), np.float32)
        rays[:RAYS, :3] = self.directions
        self._first = first = RAYS + self._places
        self._last = last = first + SIGHTS * len(self._lamps)
        rays[first:last, :3] = np.tile(inside, (len(self._lamps), 1))
        rays[first:last, 3] = 1 + np.repeat(np.arange(len(self._lamps)), SIGHTS)
        self._rays = adopt(ctx.texture((width, 1), 4, rays.tobytes(), dtype="f4"), rays.nbytes)
        self._rays.filter = (moderngl.NEAREST, moderngl.NEAREST)
        target = adopt(ctx.texture((width, POINTS), 4, dtype="f4"), 16 * width * POINTS)
        self._target = player.keep(ctx.framebuffer([target]))
        self._sky = self.cubes.sky(player.lights)
        self._sky_texture = None if self._sky is None else self.cubes.lat_long(self._sky)
        defines = {
            **volume.defines,
            "LAMPS": len(self._lamps),
            "POINTS": POINTS,
            "SKY": self._sky is not None,
            "GLOWS": glows,
            "LIGHTS": self._lights > 0,
        }
        program = player.programs.get(SCREEN, HERE / "probe.frag", defines, {})
        self._array = player.vertex_array(program)
        self._basis: dict[int, Array] = {}
        self._glowing: Glowing | None = None
        self._aimed: tuple[Hashable, Hashable] = (None, None)
        self._kept: dict[Hashable, Around] = {}
        self.time = 0.0
        if "billboard" in player.called:
            # Only they need it
            from runtime.sprite_probes import SpriteProbes

            player.sprite_lighting.surround(SpriteProbes(self, player))

    def key(self, time: float) -> Hashable:
        """All that the light of `time` seconds depends on."""
        return self.cubes.key(time)

    def draw(self, time: float) -> None:
        """Nothing: passes ask when they know where."""
        self.time = time
        self.cubes.at(time)

    # what passes ask for

    def project(self, points: Array, l_max: int, time: float) -> Array:
        """Return coefficients of radiance (n, K, 3) at points (n, 3), metres, world axes, of the
        cubes, their lamps and the environment."""
        if l_max not in self._basis:
            Y = spherical_harmonics.evaluate(self.directions, l_max)
            self._basis[l_max] = 4.0 * np.pi / RAYS * Y.T
        found = self.around(points, time)
        light = self._basis[l_max] @ found.radiance.astype(np.float64)
        light += self.glow(points, found.places, lambda d: spherical_harmonics.evaluate(d, l_max))
        for i, ball in enumerate(self.balls(time)):
            shape = spherical_lights.project_sphere(
                points, ball.middle, ball.radius, np.ones(1), l_max
            )
            light += found.lamps[:, i, None, None] * shape * ball.radiance
        return np.asarray(light)

    def glow(self, points: Array, seen: Array, basis: Basis, even: float = EVEN) -> Array:
        """Return what places on what glows send to points (n, 3), metres: sums (n, K, 3).

        seen : (n, m) share of each place. basis : unit directions (m, 3) to values (m, K). even :
        as `around`.
        """
        volume = self.cubes.volume
        if self._glowing is None or not seen.any():
            return np.zeros((1, 1, 1))
        cells = (points - volume.origin) / volume.cell_size
        towards, power = self._glowing.power_at(cells, even)
        power *= seen[..., None]
        lit = power.any(axis=-1)
        values = basis(towards[lit])
        weights = np.zeros((*lit.shape, values.shape[-1]))
        weights[lit] = values
        return np.asarray(np.swapaxes(weights, 1, 2) @ power)

    def share_of_rays(self) -> float:
        """Share by which even rays from points that many sprites share count beside places: less
        where what glows is small, so that a lantern is left to places up to a few cells away."""
        self._aim(self.time, reuse.frozen(self._player.lights))
        if self._glowing is None:
            return 1.0
        a_face = len(self._glowing.places) * float(self._glowing.density.max())
        return float(1.0 / np.clip(8.0 * a_face, 1.0, 64.0))

    def balls(self, time: float) -> list[Ball]:
        """The lamps at `time` seconds."""
        size = self.cubes.volume.cell_size
        return [
            Ball(
                self.cubes.middle(lamp, time),
                BALL * lamp.side * size,
                np.asarray(lamp.radiance.at(time)),
            )
            for lamp in self._lamps
        ]

    def around(self, points: Array, time: float, even: float = EVEN) -> Around:
        """Return what comes to points (n, 3), metres; the same arrays while nothing changes.

        even : rays a steradian, as they count beside places where something glows.
        """
        lights = reuse.frozen(self._player.lights)
        key = (points.tobytes(), self.cubes.key(time), lights, even)
        if key not in self._kept:
            while len(self._kept) >= KEPT:
                del self._kept[next(iter(self._kept))]
            self._aim(time, lights)
            parts = [
                self._part(points[start : start + POINTS], time, even)
                for start in range(0, max(1, len(points)), POINTS)
            ]
            names = ("radiance", "places", "lamps", "lights")
            whole = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
            self._kept[key] = Around(*whole)
        return self._kept[key]

    # pieces

    def _aim(self, time: float, lights: Hashable) -> None:
        """Bring the rays at what glows and at lights up to date."""
        volume = self.cubes.volume
        now = self.cubes.state(time), lights
        if now == self._aimed:
            return
        if self._places and now[0] != self._aimed[0]:
            # Only worlds that glow need it
            from runtime import probe_glow

            self._glowing = probe_glow.of(volume, self._places)
            if self._glowing is not None:
                self._table[RAYS : self._first, :3] = self._glowing.places
            self._table[RAYS : self._first, 3] = light_sights.PLACE
        if self._lights:
            places, kinds = light_sights.rays(self._player.lights, SIGHTS)
            at = kinds == light_sights.PLACE
            places[at] = (places[at] - volume.origin) / volume.cell_size
            self._table[self._last :, :3] = places.reshape(-1, 3)
            self._table[self._last :, 3] = np.repeat(kinds, SIGHTS)
        self._rays.write(self._table.tobytes())
        self._aimed = now

    def _part(self, points: Array, time: float, even: float) -> Around:
        volume, n = self.cubes.volume, len(points)
        origin = (points - volume.origin) / volume.cell_size
        raw = self._cast(origin, time, even)
        sights = raw[:, RAYS:, 3]
        places = sights[:, : self._places].astype(np.float64)
        first, last = self._first - RAYS, self._last - RAYS
        lamps = sights[:, first:last].reshape(n, -1, SIGHTS)
        lights = sights[:, last:].reshape(n, -1, SIGHTS)
        means = (each.mean(axis=2, dtype=np.float64) for each in (lamps, lights))
        return Around(raw[:, :RAYS, :3], places, *means)

    def _cast(self, origin: Array, time: float, even: float) -> NDArray[np.float32]:
        """Return radiance and sight (n, width, 4) of the rays from points (n, 3) in cells."""
        player, volume = self._player, self.cubes.volume
        count, width = len(origin), self._width
        padded = np.zeros((POINTS, 3))
        padded[:count] = origin
        middles = [
            (self.cubes.middle(lamp, time) - volume.origin) / volume.cell_size
            for lamp in self._lamps
        ]
        glowing = self._glowing
        values = {
            "origin": [tuple(row) for row in padded],
            "size": volume.size,
            "n": self.cubes.faces.texels,
            "scale": volume.scale,
            "lamp": [(*m, 0.5 * lamp.side) for m, lamp in zip(middles, self._lamps, strict=True)],
            # Even rays a steradian; places over the power that they stand for
            "even": even,
            "aimed": 0.0 if glowing is None else self._places / glowing.power,
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
        return np.frombuffer(raw, np.float32).reshape(count, width, 4)

    def _update_sky(self) -> None:
        sky = self.cubes.sky(self._player.lights)
        if sky is not None and not np.array_equal(sky, self._sky):
            self._sky = sky
            self._sky_texture.write(cubes.texels(sky))
