"""Lights that shine in closed form, as the shaders of opaque things take them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from maths import area_lights
from maths.transforms import normalise, vector_area

Array = NDArray[np.float64]

RECTANGLE = 4  # corners


def counts(scene: Any) -> dict[str, int]:
    """Return the flags: how many lights of each kind a scene has, and most corners of a polygon."""
    kinds = [light.type for light in scene.lights]
    outlines = [len(light.outline) for light in scene.lights if light.type == "polygon"]
    return {
        "SUNS": kinds.count("sun"),
        "SPHERES": kinds.count("sphere"),
        "DISCS": kinds.count("disc"),
        "POLYGONS": kinds.count("rectangle") + kinds.count("polygon"),
        "POLYGON_CORNERS": max(RECTANGLE, *outlines, 0),
    }


def counts_of(lights: Any) -> dict[str, int]:
    """Return the same flags of lights at a moment, None for none, and LIGHTS, how many in all."""
    kinds = {"SUNS": "suns", "SPHERES": "spheres", "DISCS": "discs", "POLYGONS": "polygons"}
    counts = {flag: len(getattr(lights, name, ())) for flag, name in kinds.items()}
    corners = [len(each.corners) for each in getattr(lights, "polygons", ())]
    return {
        **counts,
        "POLYGON_CORNERS": max(RECTANGLE, *corners, 0),
        "LIGHTS": sum(counts.values()),
    }


def of(lights: Any) -> dict[str, Any]:
    """Return the uniforms of all lights but the environments at one moment."""
    found: dict[str, Any] = {}
    if lights.suns:
        found["sun_place"] = [(*sun.to_light, sun.radius) for sun in lights.suns]
        found["sun_light"] = [tuple(sun.irradiance) for sun in lights.suns]
        found["sun_level"] = [on_level(sun) for sun in lights.suns]
    if lights.spheres:
        found["sphere_place"] = [(*ball.position, ball.radius) for ball in lights.spheres]
        found["sphere_light"] = [tuple(ball.radiance) for ball in lights.spheres]
    if lights.discs:
        found["disc_place"] = [(*disc.position, disc.radius) for disc in lights.discs]
        found["disc_axis"] = [(*disc.axis, float(disc.two_sided)) for disc in lights.discs]
        found["disc_light"] = [tuple(disc.radiance) for disc in lights.discs]
    if lights.polygons:
        most = max(RECTANGLE, *(len(polygon.corners) for polygon in lights.polygons))
        outlines = [outline(polygon.corners, most) for polygon in lights.polygons]
        found["polygon_corner"] = [tuple(corner) for row, _, _ in outlines for corner in row]
        found["polygon_front"] = [(*front, size) for _, front, size in outlines]
        found["polygon_light"] = [
            (*polygon.radiance, float(polygon.two_sided)) for polygon in lights.polygons
        ]
    return found


def on_level(sun: Any) -> tuple[float, ...]:
    """Irradiance of a sun on a level plane, of what stands above it."""
    up = (0.0, 1.0, 0.0)
    # The closed form cuts the disc off by itself
    whole = sun.irradiance / sun.above if sun.above > 0 else np.zeros(3)
    return tuple(area_lights.sun_irradiance(up, sun.to_light, whole, sun.radius))


def outline(corners: Array, most: int) -> tuple[Array, Array, float]:
    """Corners (most, 3), its own and the first again; front's unit vector (3,); size.

    corners : (k, 3), counter-clockwise as seen from its front. The size is the largest distance of
    a corner from the first.
    """
    apart = corners - corners[0]
    padded = np.concatenate([corners, np.repeat(corners[:1], most - len(corners), axis=0)])
    return padded, normalise(vector_area(corners)), float(np.linalg.norm(apart, axis=1).max())
