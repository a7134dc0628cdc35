"""What a world of cubes looks like by some light: pictures behind the points of studies.

The camera stands in an empty cell, or around the world, where it sees most faces that are lit; rays
are Embree's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake.rays import RayScene
from formats.lightmap import Faces
from formats.voxels import Voxels
from maths.colour import srgb_encode
from pipelines.studies.answer import Picture, Shot

Array = NDArray[np.float64]
Float = NDArray[np.float32]

SIZE = (144, 96)
TRIED, TRIAL = 160, (24, 16)  # cameras, and the pixels that judge them
FIELD = 70.0  # degrees, across
KEY = 0.3  # how bright pictures are on the mean


@dataclass(frozen=True, eq=False)
class View:
    """Rays of a camera. origin : (3,) metres. directions : (h, w, 3)."""

    origin: Array
    directions: Array

    def texels(self, faces: Faces) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the flat atlas texel (h, w) that each pixel sees, and whether it sees one."""
        return seen_by(scene_of(faces), faces, self.origin, self.directions)


@dataclass(frozen=True, eq=False)
class Shown:
    """A view of one layout: what of the world's light each pixel shows."""

    at: NDArray[np.int64]
    hit: NDArray[np.bool_]
    albedo: Float
    emission: Float

    def radiance(self, irradiance: Float) -> Float:
        """Return radiance (h, w, 3) by irradiance on the atlas (H, W, 3)."""
        light = irradiance.reshape(-1, 3)[self.at] * self.albedo / np.float32(np.pi)
        return np.asarray((light + self.emission) * self.hit[..., None], np.float32)

    def shot(self, found: Float, truth: Float) -> Shot:
        """Return pictures by both lights, exposed for the truth."""
        a, b = self.radiance(found), self.radiance(truth)
        return Shot(exposed(a, b), exposed(b, b))


def shown(view: View, world: Voxels, faces: Faces) -> Shown:
    """Look at a world laid out so."""
    at, hit = view.texels(faces)
    cell = faces.cell().reshape(-1)[at]
    row = world.cells.reshape(-1)[np.maximum(cell, 0)]
    return Shown(at, hit & (cell >= 0), world.albedo[row], world.emission[row])


def exposed(radiance: Float, like: Float) -> Picture:
    """Return radiance as a screen shows it: the logarithmic mean of `like` is a middle grey, and
    what is bright bends over (Reinhard et al. 2002, eq. 1 to 3)."""
    lit = like.mean(axis=-1)
    lit = lit[lit > 1e-4 * lit.max()]
    middle = float(np.exp(np.mean(np.log(lit)))) if lit.size else 1.0
    x = KEY * radiance / middle
    return np.asarray(np.rint(255 * srgb_encode(np.clip(x / (1 + x), 0, 1))), np.uint8)


def scene_of(faces: Faces) -> RayScene:
    """Return the rectangles as two triangles each."""
    corners, _, _ = faces.vertices()
    first = 4 * np.arange(len(corners) // 4)[:, None]
    both = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])], axis=1)
    return RayScene(corners, both.reshape(-1, 3))


def seen_by(
    scene: RayScene, faces: Faces, origin: Array, directions: Array
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the flat atlas texels (...,) where rays (..., 3) end, and whether they do."""
    flat = np.ascontiguousarray(directions.reshape(-1, 3), np.float32)
    starts = np.repeat(scene.to_unit(origin[None]), len(flat), axis=0)
    hits = scene.intersect(starts, flat)
    _, _, uv = faces.vertices()
    face = np.maximum(hits.face, 0).astype(np.int64)
    # Triangles 0 1 2 and 0 2 3 of each rectangle
    corner = 4 * (face // 2)[:, None] + np.array([[0, 1, 2], [0, 2, 3]])[face % 2]
    place = np.einsum("ni,nij->nj", hits.weights, uv[corner]) * np.array(faces.size)
    r = faces.rectangles[face // 2]
    low = np.stack([r["x"], r["y"]], axis=-1)
    high = low + faces.texels * np.stack([r["width"], r["height"]], axis=-1) - 1
    x, y = np.clip(np.floor(place).astype(np.int64), low, high).T
    shape = directions.shape[:-1]
    return (y * faces.size[0] + x).reshape(shape), (hits.face >= 0).reshape(shape)


def rays(origin: Array, target: Array, size: tuple[int, int]) -> Array:
    """Return directions (h, w, 3) of a camera that looks from one place to another."""
    width, height = size
    ahead = (target - origin) / np.linalg.norm(target - origin)
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= max(np.linalg.norm(right), 1e-9)
    up = np.cross(right, ahead)
    half = np.tan(np.radians(FIELD / 2))
    x = (2 * (np.arange(width) + 0.5) / width - 1) * half
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * half * height / width
    return np.asarray(ahead + x[None, :, None] * right + y[:, None, None] * up)


def of_light(irradiance: Float) -> Float:
    """Return how much texels are worth a look: those that are lit, half for a middling light."""
    lit = irradiance.mean(axis=-1)
    middle = float(np.median(lit[lit > 0])) if (lit > 0).any() else 1.0
    return np.asarray(lit / (lit + middle), np.float32)


def chosen(world: Voxels, faces: Faces, worth: Float) -> View:
    """Return the view from which most is seen that is worth (h, w) a look, out of some."""
    scene, weights = scene_of(faces), worth.reshape(-1)
    normals = (faces.normals().reshape(-1, 3) @ np.array([1, 3, 9])).astype(np.int64)
    rows = world.cells.reshape(-1)[np.maximum(faces.cell().reshape(-1), 0)]
    # Cells around the world only where it is nearly full
    around = 0 if np.mean(~world.solid) > 0.1 else max(3, max(world.size) // 4)
    empty = np.argwhere(~np.pad(world.solid, around))[:, ::-1] - around
    rng = np.random.default_rng(0)
    places = empty[rng.integers(0, len(empty), 2 * TRIED)] + 0.5
    at = np.asarray(world.origin) + world.cell_size * places
    best, least = 0, -1.0
    for i in range(TRIED):
        ahead = at[i + TRIED] - at[i]
        # Neither at a wall nor steeply up or down
        away = float(np.linalg.norm(ahead))
        if away < 4 * world.cell_size or abs(ahead[1]) > 0.5 * away:
            continue
        seen, hit = seen_by(scene, faces, at[i], rays(at[i], at[i + TRIED], TRIAL))
        # Many texels, light on them, walls of several directions and several colours
        texels = np.unique(seen[hit])
        kinds = len(np.unique(normals[texels])) * len(np.unique(rows[texels]))
        score = float(np.sqrt(weights[texels]).sum()) * float(hit.mean()) * kinds
        if score > least:
            best, least = i, score
    return View(at[best], rays(at[best], at[best + TRIED], SIZE))
