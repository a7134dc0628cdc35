"""How much a mesh's shadow can take of the light, by the distance of what it falls on.

The pass hides `L.O / L.U` at most (see `formats.occlusion`). A light that is nowhere negative has
`|L| <= sqrt(K / 4 pi) L.U`, as a sum of directions of |Y| = sqrt(K / 4 pi) each; and what the edge
of a volume stores has `|O| <= sqrt(2 pi)`, as the mesh lies on one side of it and an occlusion's
square integrates to its own solid angle; components only take from that. Beyond the edge the pass
thins it by `disc_share`, from a corner of the box at the farthest.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import film_bounds
from formats.meshes import PlacedMesh
from formats.poses import mesh_balls
from formats.scene import Scene
from maths.occlusion_shadow import disc_share

Array = NDArray[np.float64]
UNKNOWN = 1e9
"""Metres that a mesh that no report measures may reach."""
SLACK = 1.25
"""On the norm of what is stored, for the noise of rays and the codes of 8 bits."""
THINNEST = 0.25
"""Half-extent of a thin axis, of the longest, that a volume is made for."""


def hidden(mesh: PlacedMesh, bounds: Any, distance: float) -> float:
    """The most of the light, 0..1, that a mesh's shadow takes from a point so far from its middle.

    bounds : low and high corner of the mesh, in its own metres. distance : metres of the world.
    """
    shadow = mesh.shadow
    if shadow is None:
        return 0.0
    low, high = np.asarray(bounds, np.float64)
    half = 0.5 * (high - low)
    half = np.maximum(half, THINNEST * half.max()) * mesh.scale
    radius = float(np.linalg.norm(half))
    # A surface that faces little light may lose all of it
    if shadow.receiver_normal:
        return 1.0
    if not shadow.falloff or distance <= 2.0 * radius or radius == 0.0:
        return 1.0
    thinned = float(disc_share(distance, radius) / disc_share(2.0 * radius, radius))
    return min(1.0, SLACK * float(np.sqrt(0.5 * shadow.harmonics)) * thinned)


def codes(scene: Scene, reports: Mapping[str, Mapping[str, Any]]) -> tuple[float, float, str]:
    """Return the most 8-bit codes that all shadows together change, and who takes the most.

    Returns (codes, share, name of the caster): share of the light that it takes.
    """
    passing, worst, name = 1.0, 0.0, ""
    for mesh in (m for m in scene.meshes if m.shadow is not None):
        bounds = _bounds(reports, mesh)
        share = 1.0
        if bounds is not None:
            share = hidden(mesh, bounds, _distance(scene, reports, mesh, bounds))
        passing *= 1.0 - share
        if share > worst or not name:
            worst, name = share, mesh.name
    picture = scene.picture
    codes = film_bounds.veiled(picture.film, passing, 0.0, picture.bloom) if worst else 0.0
    return codes, worst, name


def _bounds(reports: Mapping[str, Mapping[str, Any]], mesh: PlacedMesh) -> Array | None:
    """Low and high corner (2, 3) of a mesh in its own metres, None where no report measures it."""
    for kind in ("mesh", "transfer"):
        report = reports.get(f"{kind}/{mesh.name}", {})
        if "bounds" in report:
            return np.asarray(report["bounds"], np.float64)
    return None


def _distance(
    scene: Scene, reports: Mapping[str, Mapping[str, Any]], caster: PlacedMesh, bounds: Array
) -> float:
    """Least metres at any time from the middle of a caster's box to what is opaque beside it."""
    low, high = bounds
    # The middle turns about the mesh's origin
    off = caster.scale * float(np.linalg.norm(0.5 * (low + high)))
    near, far = (np.asarray(end) for end in caster.position.extremes)
    found = np.inf
    if scene.ground is not None and scene.force.get("ground") is not False:
        height = scene.ground.height
        found = max(near[1] - height, height - far[1], 0.0) - off
    middle, spread = 0.5 * (near + far), 0.5 * float(np.linalg.norm(far - near)) + off
    assert caster.shadow is not None
    for name, other, radius in mesh_balls(scene, reports, UNKNOWN):
        if name != caster.name:
            found = min(found, float(np.linalg.norm(other - middle)) - radius - spread)
        elif caster.shadow.self:
            found = 0.0
    return float(found)
