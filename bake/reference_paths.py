"""Paths from the camera: at each surface a sample of every light, then on by the cosine.

Kajiya 1986, *The Rendering Equation*; next-event estimation, with the balance heuristic where a
path can meet the light by itself. Surfaces are Lambert, thin sheets let a share of light through to
their other side, as `bake.shading` has it for sprites.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake.reference_air import Air
from bake.reference_camera import Rays, spread
from bake.reference_lights import Lights
from bake.reference_world import Ends, Shaded, World
from maths.hashing import pcg, uniform01
from maths.sampling import cosine_hemisphere, orthonormal_basis

Array = NDArray[np.float64]
Keys = NDArray[np.uint32]

PER_VERTEX = 1 << 16
"""Random dimensions set aside for each vertex of a path."""


@dataclass(frozen=True, eq=False)
class Paths:
    """What n paths brought: radiance (n, 3); distance (n,) to what the camera saw, metres, infinite
    for the sky; rays : how many were cast."""

    radiance: Array
    distance: Array
    rays: int


@dataclass(frozen=True, eq=False)
class Chance:
    """Random numbers at one vertex of n paths of keys (n,).

    whole : keys of all camera rays, of which `alive` (n,) came here, for numbers that are spread
    evenly over the samples of a pixel; None draws each path's by itself.
    """

    key: Keys
    vertex: int
    whole: Keys | None
    alive: NDArray[np.int64]

    def draw(self, number: int) -> Array:
        """Return numbers (n, 3) for use `number` of this vertex, the first two well spread."""
        start = PER_VERTEX * (self.vertex + 1) + 3 * number
        with np.errstate(over="ignore"):
            found = [uniform01(self.key + pcg(start + i)) for i in range(3)]
        if self.whole is not None and self.whole.shape[1] > 1:
            found[0], found[1] = spread(self.whole, 2 + number)[self.alive].T
        return np.stack(found, axis=-1)


class Tracer:
    """Traces paths through one scene.

    bounces : how often light is handed from surface to surface after a light's own. shadows : False
    lets lights shine through everything, without bounces.
    """

    def __init__(
        self, world: World, lights: Lights, air: Air, *, bounces: int, shadows: bool
    ) -> None:
        self.world, self.lights, self.air = world, lights, air
        self.bounces, self.shadows = bounces if shadows else 0, shadows

    def trace(self, camera: Rays) -> Paths:
        """Follow one path from each camera ray."""
        n = len(camera.direction)
        radiance, rays = np.zeros((n, 3)), n
        ends = self.world.cast(camera.origin, camera.direction)
        first, direction = ends.distance, camera.direction
        gone = np.flatnonzero(~np.isfinite(first))
        radiance[gone] = self.air.sky(direction[gone])
        alive = np.flatnonzero(np.isfinite(first))
        radiance[alive] = self.world.glow(ends.face[alive])
        throughput, ends = np.ones((len(alive), 3)), _pick(ends, alive)
        direction, key = direction[alive], camera.key.ravel()[alive]
        for vertex in range(self.bounces + 1):
            if not len(alive):
                break
            surface = self.world.shade(ends, direction)
            chance = Chance(key, vertex, camera.key if vertex == 0 else None, alive)
            light, count = self._direct(surface, chance)
            radiance[alive] += throughput * light
            rays += count
            last = vertex == self.bounces
            if last and not (self.lights.environments or self.lights.emitters):
                break
            origin, direction, density = _scatter(surface, chance)
            throughput = throughput * surface.albedo
            lit = np.flatnonzero(throughput.any(axis=1))
            alive, key, throughput = alive[lit], key[lit], throughput[lit]
            origin, direction, density = origin[lit], direction[lit], density[lit]
            ends = self._next(origin, direction)
            rays += len(lit) if self.shadows else 0
            radiance[alive] += throughput * self._met(origin, ends, direction, density)
            on = np.flatnonzero(np.isfinite(ends.distance))
            alive, key, throughput = alive[on], key[on], throughput[on]
            ends, direction = _pick(ends, on), direction[on]
        from_eye = first + np.linalg.norm(camera.origin - camera.start, axis=1)
        radiance = self.air.lay(radiance, camera.start, camera.direction, from_eye)
        return Paths(radiance, from_eye, rays)

    def _next(self, origin: Array, direction: Array) -> Ends:
        if self.shadows:
            return self.world.cast(origin, direction)
        away = np.full(len(origin), np.inf)
        return _nowhere(origin, away)

    def _direct(self, surface: Shaded, chance: Chance) -> tuple[Array, int]:
        """Return radiance (n, 3) that one sample of each light makes surfaces send to the viewer,
        and how many rays it took."""
        total, rays = np.zeros_like(surface.albedo), 0
        for number, light in enumerate(self.lights.all):
            u = chance.draw(number + 1)
            found = light.sample(surface.front, u)
            cosine = np.einsum("ij,ij->i", surface.normal, found.direction)
            side = np.where(cosine > 0, 1 - surface.tau, surface.tau)
            share = side * np.abs(cosine) / np.pi
            if found.density is not None:
                # The surface's own samples find this light with density `share`
                share = share * found.density / (found.density + share)
            sent = (share[:, None] * found.weight) * surface.albedo
            lit = np.flatnonzero(sent.any(axis=1))
            if self.shadows and len(lit):
                start = np.where(cosine[lit, None] > 0, surface.front[lit], surface.back[lit])
                distance = None if found.distance is None else found.distance[lit]
                target = None if found.face is None else found.face[lit]
                hidden = self.world.blocked(start, found.direction[lit], distance, target)
                lit, rays = lit[~hidden], rays + len(hidden)
            total[lit] += sent[lit]
        return total, rays

    def _met(self, origin: Array, ends: Ends, direction: Array, density: Array) -> Array:
        """Return radiance (n, 3) of the lights that paths met by themselves, weighed against the
        samples of those lights. density : (n,) of the directions, 1/sr."""
        found = np.zeros((len(direction), 3))
        away = np.flatnonzero(~np.isfinite(ends.distance))
        for light in self.lights.environments:
            seen, other = light.look(direction[away])
            found[away] += seen * (density[away] / (density[away] + other))[:, None]
        emitters = self.lights.emitters
        if emitters is not None:
            glow = self.world.glow(ends.face)
            lit = np.flatnonzero(glow.any(axis=1))
            other = emitters.density(
                origin[lit], ends.face[lit], direction[lit], ends.distance[lit]
            )
            found[lit] += glow[lit] * (density[lit] / (density[lit] + other))[:, None]
        return found


def _scatter(surface: Shaded, chance: Chance) -> tuple[Array, Array, Array]:
    """Sample how light goes on: origin, direction (n, 3) and density (n,), 1/sr. What it is worth
    is the albedo."""
    u = chance.draw(0)
    through = u[:, 2] < surface.tau
    local = cosine_hemisphere(u[:, :2])
    axis = np.where(through[:, None], -surface.normal, surface.normal)
    a, b = orthonormal_basis(axis)
    direction = local[:, :1] * a + local[:, 1:2] * b + local[:, 2:] * axis
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin = np.where(through[:, None], surface.back, surface.front)
    share = np.where(through, surface.tau, 1 - surface.tau)
    # A direction in the surface itself has density 0 and brings next to nothing
    return origin, direction, np.maximum(share * local[:, 2] / np.pi, 1e-12)


def _pick(ends: Ends, which: NDArray[np.int64]) -> Ends:
    hits = ends.hits.pick(which)
    return Ends(ends.distance[which], ends.point[which], hits, ends.ground[which])


def _nowhere(origin: Array, away: Array) -> Ends:
    """Return ends (n) of rays that nothing stops."""
    from bake.rays import Hits

    none = np.full(len(away), -1, np.int32)
    zero = np.zeros(len(away), np.float32)
    return Ends(away, origin, Hits(none, zero, zero, zero), np.zeros(len(away), bool))
