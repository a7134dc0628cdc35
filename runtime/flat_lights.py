"""Discs and polygons as sprites take them: handfuls of suns, from each sprite's centre.

Imported only where a scene has such a light.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maths import flat_lights, transforms

Array = NDArray[np.float64]
RINGS = (3, 8)  # rings of a disc and points on each


def suns(lights: Any, centres: Array) -> Iterator[tuple[Array, Array]]:
    """Yield, for each disc and polygon, directions and irradiance (n, m, 3) at centres (n, 3)."""
    for disc in lights.discs:
        points, areas = flat_lights.disc_points(disc.position, disc.axis, disc.radius, RINGS)
        yield flat_lights.as_suns(
            centres, points, areas, disc.axis, disc.radiance, two_sided=disc.two_sided
        )
    for polygon in lights.polygons:
        points, areas = flat_lights.polygon_points(polygon.corners, 1)
        axis = transforms.normalise(transforms.vector_area(polygon.corners))
        yield flat_lights.as_suns(
            centres, points, areas, axis, polygon.radiance, two_sided=polygon.two_sided
        )
