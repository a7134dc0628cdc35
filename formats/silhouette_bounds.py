"""When fins along the outlines of meshes are called for: how wide they are at most, in pixels.

A width w at a distance d along the axis has w f / d of the sensor, most at the nearest that any
point of the mesh comes over the animation. The pass leaves alone what is under half a pixel.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from formats.lens_bounds import UNKNOWN_REACH
from formats.meshes import PlacedMesh, shown
from formats.plan import Decision
from formats.poses import mesh_balls, poses
from formats.scene import Scene

Reports = Mapping[str, Mapping[str, Any]]
LEAST_PIXELS = 0.5


def silhouette(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Fins, where those of some mesh seen may reach half a pixel."""
    found = {mesh.name: mesh for mesh in shown(scene) if mesh.silhouette_width > 0.0}
    if not found:
        return Decision(False, "no mesh has a silhouette_width", 0.0, "px")
    pixels, name, distance = widest(scene, reports, found, lines)
    if not name:
        return Decision(False, "no mesh with a silhouette_width is ever seen", 0.0, "px")
    reason = f"the widest fins have {pixels:.3g} px of {lines} lines ({name} at {distance:.3g} m)"
    called = pixels >= LEAST_PIXELS
    return Decision(
        called, reason if called else f"{reason}; under half a pixel there are none", pixels, "px"
    )


def widest(
    scene: Scene, reports: Reports, found: dict[str, PlacedMesh], lines: int
) -> tuple[float, str, float]:
    """Pixels, mesh and distance of the widest fins at any moment; "" where none is seen."""
    half = scene.camera.sensor_height_mm / 2000.0
    most = 0.0, "", np.inf
    balls = [each for each in mesh_balls(scene, reports, UNKNOWN_REACH) if each[0] in found]
    for pose in poses(scene):
        for name, middle, radius in balls:
            # Fins of a mesh beside the picture may reach into it
            wide = found[name].silhouette_width * (1.0 + found[name].silhouette_softness)
            seen, low, _ = pose.depths(middle[None], np.array([radius + wide]), half)
            low = pose.depths(middle[None], np.array([radius]), half)[1]
            if seen[0]:
                width = found[name].silhouette_width * pose.focal_length[1] / float(low[0])
                pixels = width * lines / (2.0 * half)
                if pixels > most[0]:
                    most = pixels, name, float(low[0])
    return most
