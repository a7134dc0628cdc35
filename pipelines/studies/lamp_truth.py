"""The truth under any number of small lamps: direct light at the middles of pixels, a ray to each.

The path tracer samples every light with every path, by a sampler each; ten thousand of them are
better taken together. Lamps here are balls and one-sided discs, which a point sees from outside.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import reference_camera, reference_scene
from bake.reference_world import Shaded, World
from formats.lights import Disc
from formats.scene import Scene
from maths.hashing import uniform01
from maths.sampling import orthonormal_basis, r2

Array = NDArray[np.float64]

EACH = 1 << 17  # rays at once


def radiance(
    scene: Scene, time: float, size: tuple[int, int], lamps: Sequence[Any], samples: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the scene's radiance (h, w, 3) under the lamps alone, and where something is seen.

    size : width, height. samples : rays from a pixel to each lamp.
    """
    world, surface, seen = surfaces(scene, time, size)
    light = irradiance(world, surface.front, surface.normal, time, lamps, samples)
    return pictured(surface, light, seen), seen


def surfaces(
    scene: Scene, time: float, size: tuple[int, int]
) -> tuple[World, Shaded, NDArray[np.bool_]]:
    """Return the traced scene, what the middles of pixels show of it (n), and which do (h, w)."""
    width, height = size
    camera = reference_camera.at(scene, time, size, lens=False)
    parts, _ = reference_scene.parts_of(scene, time, camera.yaw, camera.position)
    world = World(reference_scene.merged(parts), scene.ground)
    rays = camera._through(
        np.arange(width * height),
        np.full((width * height, 2), 0.5),
        np.zeros((1, 2)),
        np.zeros(1, np.uint32),
    )
    ends = world.cast(rays.origin, rays.direction)
    mask = ends.ground | (ends.face >= 0)
    seen = np.flatnonzero(mask)
    found = type(ends)(
        ends.distance[seen], ends.point[seen], ends.hits.pick(seen), ends.ground[seen]
    )
    return world, world.shade(found, rays.direction[seen]), mask.reshape(height, width)


def pictured(surface: Shaded, light: Array, seen: NDArray[np.bool_]) -> Array:
    """Return radiance (h, w, 3) of what pixels show (n) under an irradiance (n, 3), 0 elsewhere."""
    picture = np.zeros((*seen.shape, 3))
    picture[seen] = surface.albedo / np.pi * light
    return picture


def irradiance(
    world: World, points: Array, normals: Array, time: float, lamps: Sequence[Any], samples: int
) -> Array:
    """Return irradiance (n, 3) at points (n, 3) of unit normals (n, 3)."""
    centres = np.array([lamp.position.at(time) for lamp in lamps], np.float64)
    radii = np.array([lamp.radius for lamp in lamps], np.float64)
    radiances = np.array([lamp.radiance.at(time) for lamp in lamps], np.float64)
    flat = isinstance(lamps[0], Disc)
    axes = np.array([lamp.axis(time) for lamp in lamps]) if flat else np.zeros_like(centres)
    total = np.zeros((len(points), 3))
    step = max(1, EACH // max(len(points), 1))
    for first in range(0, len(lamps), step):
        own = slice(first, first + step)
        numbers = np.arange(len(lamps))[own]
        offset = (centres[own] - points[:, None]).reshape(-1, 3)
        here = np.repeat(np.arange(len(points)), len(numbers))
        shift = np.stack([uniform01(here, np.tile(numbers, len(points)), k) for k in (1, 2)], -1)
        radius, axis = np.tile(radii[own], len(points)), np.tile(axes[own], (len(points), 1))
        for n in range(samples):
            u = r2(np.full(len(shift), n), shift)
            place = disc_places(offset, radius, axis, u) if flat else cone_places(offset, radius, u)
            towards, weight = place
            cosine = np.einsum("ij,ij->i", towards, normals[here])
            lit = np.flatnonzero((cosine > 0) & (weight > 0))
            # Lamps stand above all that could hide them: what is beyond them is empty
            free = ~world.blocked(points[here[lit]], towards[lit])
            share = np.zeros(len(here))
            share[lit] = (cosine * weight)[lit] * free / samples
            total += share.reshape(len(points), -1) @ radiances[own]
    return total


def cone_places(offset: Array, radius: Array, u: Array) -> tuple[Array, Array]:
    """Return directions (n, 3) into the cones of balls, and solid angles (n,)."""
    distance = np.linalg.norm(offset, axis=1)
    axis = offset / distance[:, None]
    lowest = np.sqrt(np.maximum(1 - np.square(radius / distance), 0))
    cosine = 1 - u[:, 0] * (1 - lowest)
    sine, turn = np.sqrt(np.maximum(1 - cosine**2, 0)), 2 * np.pi * u[:, 1]
    a, b = orthonormal_basis(axis)
    way = cosine[:, None] * axis
    way += (sine * np.cos(turn))[:, None] * a + (sine * np.sin(turn))[:, None] * b
    return way, 2 * np.pi * (1 - lowest)


def disc_places(offset: Array, radius: Array, axis: Array, u: Array) -> tuple[Array, Array]:
    """Return directions (n, 3) to places of discs, and area times cosine over squared distance."""
    a, b = orthonormal_basis(axis)
    r, turn = radius * np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
    at = offset + (r * np.cos(turn))[:, None] * a + (r * np.sin(turn))[:, None] * b
    distance = np.linalg.norm(at, axis=1)
    towards = at / distance[:, None]
    facing = np.maximum(-np.einsum("ij,ij->i", towards, axis), 0)
    return towards, np.pi * radius**2 * facing / distance**2
