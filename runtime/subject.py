"""Where what a scene shows stands, and what lies under the cursor: for hands, not for pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report
from formats.meshes import KINDS
from formats.scene import NEAR

Array = NDArray[np.float64]
BACKDROP = 3.0
"""Times the size of all the rest together, from which on something is no subject."""
OUTERMOST = 0.1
"""Share of sprites."""


def points(player: Any, time: float) -> Array:
    """Return outermost points (n, 3) of all that is shown but backdrops, metres; n = 0: nothing."""
    found = [*_meshes(player, time), *_sprites(player), *_cubes(player)]
    found.sort(key=_size)
    while len(found) > 1 and _size(found[-1]) >= BACKDROP * _size(np.concatenate(found[:-1])):
        found.pop()
    return np.concatenate(found) if found else np.zeros((0, 3))


def distance(player: Any, x: float, y: float) -> float | None:
    """Return metres along the axis to what is nearest at pixel (x, y) of the last frame, y down.

    None where nothing is. A sprite counts as the upright rectangle that holds it.
    """
    width, height = player.targets.size
    view = player.view
    column, row = int(np.clip(x, 0, width - 1)), int(np.clip(height - 1 - y, 0, height - 1))
    found = [_opaque(player, column, row)]
    across = (2 * (column + 0.5) / width - 1, 2 * (row + 0.5) / height - 1, 1.0)
    ray = view.world_from_ray(width / height) @ np.array(across)
    for sprites in player.sprites:
        if player.shows("billboard", sprites.name):
            found.append(_sprite(sprites, view, ray))
    ahead = [metres for metres in found if metres is not None and metres > NEAR]
    return min(ahead) if ahead else None


def _opaque(player: Any, column: int, row: int) -> float | None:
    """Distance by the depth that the last frame left."""
    if not any("depth" in drawn.writes for drawn in player.passes.values()):
        return None
    target = player.targets.target("colour", "depth")
    texel = target.read(viewport=(column, row, 1, 1), components=1, attachment=-1, dtype="f4")
    depth = float(np.frombuffer(texel, np.float32)[0])
    return None if depth >= 1.0 else NEAR / max(1.0 - depth, 1e-12)


def _sprite(sprites: Any, view: Any, ray: Array) -> float | None:
    """Distance to the nearest sprite of a set that a ray meets: planes upright, facing the view."""
    level = np.array([view.forward[0], 0.0, view.forward[2]])
    offset = sprites.positions - view.position
    along = float(ray @ level)
    if along < 1e-9 or not len(offset):
        return None
    metres = (offset @ level) / along
    hit = metres[:, None] * ray - offset
    wide, high = sprites.crown * sprites.scale, sprites.asset.height * sprites.scale
    inside = (np.abs(hit @ view.right) < wide) & (hit[:, 1] > 0) & (hit[:, 1] < high) & (metres > 0)
    return float(metres[inside].min()) if inside.any() else None


def _size(found: Array) -> float:
    return float(np.linalg.norm(np.ptp(found, axis=0)))


def _meshes(player: Any, time: float) -> list[Array]:
    """Corners of the boxes of meshes."""
    found = []
    folders = {way: player.folders(kind) for way, kind in KINDS.items()}
    for mesh in player.scene.meshes:
        folder = folders[mesh.lighting].get(mesh.name)
        bounds = report.read(folder).get("bounds") if folder is not None else None
        if bounds is None or not player.shows("mesh", mesh.name):
            continue
        matrix = mesh.world_from_mesh(time)
        found.append(_corners(*np.asarray(bounds, np.float64)) @ matrix[:3, :3].T + matrix[:3, 3])
    return found


def _sprites(player: Any) -> list[Array]:
    """Corners of all sprites but the outermost of many: a wood may go on to the horizon."""
    right, up, found = player.view.right, np.array([0.0, 1.0, 0.0]), []
    for sprites in player.sprites:
        if len(sprites.positions) and player.shows("billboard", sprites.name):
            foot = np.asarray(sprites.positions, np.float64)
            wide = (sprites.crown * sprites.scale)[:, None] * right
            high = (sprites.asset.height * sprites.scale)[:, None] * up
            found.append(
                np.stack([foot - wide, foot + wide, foot - wide + high, foot + wide + high])
            )
    if not found:
        return []
    every = np.concatenate(found, axis=1)
    middle = every.mean(axis=0)
    away = np.linalg.norm(middle - np.median(middle, axis=0), axis=1)
    kept = np.argsort(away, kind="stable")[: len(away) - int(OUTERMOST * len(away))]
    return [every[:, kept].reshape(-1, 3)]


def _cubes(player: Any) -> list[Array]:
    """Corners of the world of cubes."""
    if "voxels" not in player.passes:
        return []
    volume = player.passes["voxels"].cubes.volume
    low = np.asarray(volume.origin, np.float64)
    return [_corners(low, low + np.asarray(volume.size) * volume.cell_size)]


def _corners(low: Array, high: Array) -> Array:
    return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
