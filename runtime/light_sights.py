"""Places in the lights of a scene: by them a point among cubes learns what it sees of each light.

The order of lights is suns, spheres, discs, polygons: that of `runtime.lighting.Lights` but for
environments.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maths.sampling import concentric_disc, orthonormal_basis, r2, uniform_cone

Array = NDArray[np.float64]

PLACE, DIRECTION = -1.0, -2.0
"""What a ray is told by: a place that it goes to, or a direction."""


def count(scene: Any) -> int:
    """Return how many lights of a scene are not environments."""
    return sum(light.type != "environment" for light in scene.lights)


def rays(lights: Any, each: int) -> tuple[Array, Array]:
    """Return places or directions (lights, each, 3), world axes, metres, and which (lights,).

    lights : runtime.lighting.Lights. Places lie evenly over what a light shows: its disc, its
    area, for a sphere its inside.
    """
    found, kinds = [], []
    number = np.arange(each)
    u, depth = r2(number), (number + 0.5) / each
    for sun in lights.suns:
        cone = uniform_cone(u, sun.radius)
        a, b = orthonormal_basis(sun.to_light)
        found.append(cone @ np.stack([a, b, sun.to_light]))
        kinds.append(DIRECTION)
    for ball in lights.spheres:
        height = 2.0 * u[:, :1] - 1.0
        turn = 2.0 * np.pi * u[:, 1:]
        ring = np.sqrt(1.0 - height**2)
        outward = np.concatenate([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1)
        found.append(ball.position + ball.radius * np.cbrt(depth)[:, None] * outward)
        kinds.append(PLACE)
    for disc in lights.discs:
        a, b = orthonormal_basis(disc.axis)
        flat = disc.radius * concentric_disc(u)
        found.append(disc.position + flat[:, :1] * a + flat[:, 1:] * b)
        kinds.append(PLACE)
    for polygon in lights.polygons:
        found.append(on_polygon(polygon.corners, depth, u))
        kinds.append(PLACE)
    if not found:
        return np.zeros((0, each, 3)), np.zeros(0)
    return np.stack(found), np.array(kinds)


def on_polygon(corners: Array, choice: Array, u: Array) -> Array:
    """Return points (n, 3) spread evenly over a convex polygon (k, 3).

    choice : (n,) in [0, 1), of a triangle of its fan. u : (n, 2) in [0, 1).
    """
    sides = corners[1:] - corners[0]
    areas = 0.5 * np.linalg.norm(np.cross(sides[:-1], sides[1:]), axis=1)
    share = np.cumsum(areas) / areas.sum()
    which = np.minimum(np.searchsorted(share, choice, side="right"), len(areas) - 1)
    root = np.sqrt(u[:, :1])
    first, second = sides[which], sides[which + 1]
    return np.asarray(corners[0] + root * ((1.0 - u[:, 1:]) * first + u[:, 1:] * second))


def one_by_one(lights: Any) -> list[Any]:
    """Return Lights of one light each, in the same order."""
    from runtime.lighting import Lights

    found = [Lights((sun,), (), ()) for sun in lights.suns]
    found += [Lights((), (ball,), ()) for ball in lights.spheres]
    found += [Lights((), (), (), discs=(disc,)) for disc in lights.discs]
    return found + [Lights((), (), (), polygons=(each,)) for each in lights.polygons]


def dimmed(lights: Any, seen: Array) -> Any:
    """Return the lights with a share of each. seen : (lights,), in the same order."""
    share = iter(seen.tolist())
    return replace(
        lights,
        suns=tuple(replace(sun, irradiance=next(share) * sun.irradiance) for sun in lights.suns),
        **{
            name: tuple(
                replace(each, radiance=next(share) * each.radiance)
                for each in getattr(lights, name)
            )
            for name in ("spheres", "discs", "polygons")
        },
    )


def in_cells(lights: Any, origin: Any, cell_size: float) -> Any:
    """Return the lights in the space of cells, environments left out."""

    def at(place: Array) -> Array:
        return np.asarray((np.asarray(place) - np.asarray(origin)) / cell_size)

    def moved(each: Any) -> Any:
        return replace(each, position=at(each.position), radius=each.radius / cell_size)

    return replace(
        lights,
        environments=(),
        spheres=tuple(map(moved, lights.spheres)),
        discs=tuple(map(moved, lights.discs)),
        polygons=tuple(replace(each, corners=at(each.corners)) for each in lights.polygons),
    )


def balls(lights: Any) -> list[tuple[Array, float, float] | None]:
    """Return for each light a ball that holds it, middle (3,) and radius, and its largest radiance;
    None for suns."""
    found: list[tuple[Array, float, float] | None] = [None] * len(lights.suns)
    for each in (*lights.spheres, *lights.discs):
        found.append((each.position, each.radius, float(np.max(each.radiance))))
    for each in lights.polygons:
        middle = each.corners.mean(axis=0)
        radius = float(np.linalg.norm(each.corners - middle, axis=1).max())
        found.append((middle, radius, float(np.max(each.radiance))))
    return found
