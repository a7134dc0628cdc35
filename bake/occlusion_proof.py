"""What some voxels see of round lights, by rays of their own: the truth that codes are held to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bake import workers
from bake.rays import RayScene
from maths import spherical_harmonics
from maths.hashing import pcg
from maths.sampling import fibonacci_sphere, random_rotation

Float = NDArray[np.float32]
Indices = NDArray[np.int64]

RADII = tuple(float(v) for v in np.radians([10.0, 20.0, 30.0, 45.0]))
LIGHTS = 48  # of each radius
RAYS = 4096  # a voxel, 31 of them in a light of 10 degrees
TILE = 16  # voxels: 64k rays


@dataclass(frozen=True)
class Proof:
    """voxels : (s,) flat indices.  lights : (r, m, K), scaled so that `lights @ terms` is the share
    hidden.  shadow : (r, m, s), the share of each light that each voxel sees."""

    voxels: Indices
    lights: Float
    shadow: Float


def trace(scene: RayScene, points: Float, outside: Indices, count: int, l_max: int) -> Proof:
    """Trace `count` voxels of those outside, drawn by a hash. points : (n, 3) in unit space.

    A light is the set of those directions that lie in it, both for the rays and for its
    coefficients: how finely they cover it does not blur the comparison.
    """
    order = np.argsort(pcg(outside, 0x9400F), kind="stable")
    voxels = np.sort(outside[order[:count]])
    rays, flat, lights = _lights(l_max)

    def seen(tile: Indices) -> Float:
        starts = np.repeat(points[tile], RAYS, axis=0)
        blocked = scene.occluded(starts, np.tile(rays, (len(tile), 1)), finite=True)
        return np.asarray(blocked.reshape(len(tile), RAYS).T, np.float32)

    tiles = [voxels[a : a + TILE] for a in range(0, len(voxels), TILE)]
    found = workers.map_tiles(lambda tile: flat @ seen(tile), tiles)
    hidden = np.concatenate([np.zeros((len(flat), 0), np.float32), *found], axis=1)
    shadow = np.clip(1 - hidden, 0, 1).reshape(len(RADII), LIGHTS, len(voxels))
    return Proof(voxels, lights, shadow)


@lru_cache(maxsize=4)
def _lights(l_max: int) -> tuple[Float, Float, Float]:
    """Return rays (RAYS, 3), their weights in each light (r m, RAYS), and `Proof.lights`."""
    directions = fibonacci_sphere(RAYS, random_rotation(0x9400F))
    centres = fibonacci_sphere(LIGHTS, random_rotation(0x11947))
    cosine = np.cos(np.array(RADII))[:, None, None]
    member = (centres @ directions.T)[None] >= cosine
    weights = (member / member.sum(axis=2, keepdims=True)).astype(np.float32)
    Y = np.asarray(spherical_harmonics.evaluate(directions, l_max), np.float32)
    # L.U of the mean of Y is 1 / (2 sqrt(pi)) * 2 sqrt(pi) = 1
    found = np.ascontiguousarray(directions, np.float32), weights.reshape(-1, RAYS), weights @ Y
    for values in found:
        values.setflags(write=False)
    return found
