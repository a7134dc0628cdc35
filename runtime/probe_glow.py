"""Glowing faces of a world of cubes as a few places, for points that look at them.

Places are spread by power over all faces, the same for all points, so that what they bring changes
smoothly from point to point. Evenly spread rays find the same light: each kind counts by its
density (balance heuristic: Veach, Guibas 1995), so that a wall that glows next to a point makes no
sparks, and a lantern far away is never missed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maths.colour import luminance
from maths.sampling import r2
from runtime.voxel_lamps import exposed
from runtime.voxel_world import VoxelVolume

Array = NDArray[np.float64]

LEAST = 1e-9
"""Squared distance in cells below which a place is on the point itself."""


@dataclass(frozen=True, eq=False)
class Glowing:
    """Places (m, 3) on faces, in cells; the faces' normals (m, 3); what they send out (m, 3);
    density (m,) of a place by area, 1 / cells^2; power : the sum of luminances over faces."""

    places: Array
    normals: Array
    radiance: Array
    density: Array
    power: float

    def power_at(self, points: Array, even: float) -> tuple[Array, Array]:
        """Return directions (n, m, 3), unit, from points (n, 3) in cells, and radiance times solid
        angle (n, m, 3) that each place stands for, were nothing between. even : other rays a
        steradian, which find the same."""
        to = self.places - points[:, None]
        squared = np.maximum(np.einsum("nmi,nmi->nm", to, to), LEAST)
        towards = to / np.sqrt(squared)[..., None]
        fall = -np.einsum("nmi,mi->nm", towards, self.normals)
        seen = np.maximum(fall, LEAST)
        # Samples a steradian of both kinds together
        density = len(self.places) * self.density * squared / seen + even
        return towards, ((fall > 0) / density)[..., None] * self.radiance


def of(volume: VoxelVolume, count: int) -> Glowing | None:
    """Return so many places of a volume as it is; None where nothing glows but lamps."""
    cells, radiance = volume.glowing()
    x, y, z = cells.T
    # Lamps have no row of their own, and rays of their own
    own = volume.cells[z, y, x] > 0
    cells, radiance = cells[own], radiance[own]
    faces, owner = exposed(cells, volume.texels[..., 3])
    if not len(faces):
        return None
    bright = np.asarray(luminance(radiance)).reshape(-1)[owner]
    share = np.cumsum(bright)
    chosen = np.searchsorted(share, (np.arange(count) + 0.5) / count * share[-1], side="right")
    chosen = np.minimum(chosen, len(faces) - 1)
    cell, face = cells[owner[chosen]], (faces[chosen] >> np.uint32(27)).astype(np.int64)
    number, axis, back = np.arange(count), face // 2, face % 2
    places = cell.astype(np.float64)
    on = r2(number)
    places[number, axis] += 1 - back
    places[number, (axis + 1) % 3] += on[:, 0]
    places[number, (axis + 2) % 3] += on[:, 1]
    normals = np.zeros((count, 3))
    normals[number, axis] = 1 - 2 * back
    power = float(share[-1])
    return Glowing(places, normals, radiance[owner[chosen]], bright[chosen] / power, power)
