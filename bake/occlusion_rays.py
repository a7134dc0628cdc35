"""Rays of an occlusion volume: only into the cone that can hit the mesh, and on to harmonics.

Each voxel has the smallest of three cones that hold the mesh's bounding box. Cones come in classes
of falling solid angle; a class has one Fibonacci spiral and its harmonics, evaluated once about +z.
A voxel's rays are that spiral turned to its own axis, with a spin of its own, so that voxels do not
share their error; its coefficients are projected about +z and turned the same way, which on the
harmonics is two constant products and three turns about z. A turn keeps the sum of squares of each
band, so that the halves of the rays need none. Rays that miss the box are left to Embree, which
drops one in 40 ns, where a slab test in numpy takes 150 ns for every ray.
Products are summed in double precision and rounded once, so that codes do not depend on the kernel
of BLAS.

References
----------
Green 2003, Spherical Harmonic Lighting: The Gritty Details, appendix 1 (rotation by Z X Z -X Z).
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from bake.rays import RayScene
from bake.tiles import kept
from maths import spherical_harmonics, spherical_rotation
from maths.hashing import uniform01
from maths.sampling import GOLDEN_ANGLE, orthonormal_basis

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

TILE = 1 << 16  # rays in memory at once, a thread: 4 MB
CHUNK = 4096  # voxels turned at once
STEP = 2.0**0.125  # between the solid angles of two classes of cones
SMALLEST = 2.0**-12  # share of the sphere of the smallest cone
# Rays a voxel grow with its cone's share of the sphere to this power. The squared error goes like
# outline * density^-1.5; the sum over voxels is then least for about .8
POWER = 0.8
FEWEST = 32  # rays a voxel
MARGIN = 1e-3  # radians, what rounding to float32 may lose at a cone's rim


@dataclass(frozen=True)
class Cones:
    """Where the mesh is for each voxel. axis : (v, 3) unit.  angle : (v,) radians, pi where the
    rays go everywhere.  share : (v,) of the sphere, that of its class."""

    axis: Array
    angle: Array
    share: Array

    def pick(self, which: Indices) -> Cones:
        """Return the cones of some voxels."""
        return Cones(self.axis[which], self.angle[which], self.share[which])


@dataclass(frozen=True)
class Estimate:
    """Occlusion of some voxels. terms : (v, K) coefficients.  apart : (v, l_max + 1) mean square,
    over the coefficients of each band, of what one half of the rays brings more than the other:
    `bake.occlusion_bars` makes errors of it."""

    terms: Float
    apart: Float


def cones(points: Array, low: Array, high: Array, radius: float) -> Cones:
    """Return cones that hold a box, and the sphere of `radius` about its middle, from each point.

    points : (v, 3).  low, high : (3,) corners of the box.
    """
    middle = (low + high) / 2
    offset = middle - points
    distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-30)
    axis = offset / distance[:, None]
    away = distance > radius
    angle = np.where(away, np.arcsin(np.minimum(radius / distance, 1.0)), np.pi)
    # The eight corners about their mean direction
    signs = np.stack(np.meshgrid(*[(0, 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    corners = (low + signs * (high - low))[None] - points[:, None]
    corners /= np.maximum(np.linalg.norm(corners, axis=2, keepdims=True), 1e-30)
    mean = corners.mean(axis=1)
    length = np.linalg.norm(mean, axis=1)
    mean /= np.maximum(length, 1e-30)[:, None]
    beyond = np.maximum(low - points, points - high)
    outside = beyond.max(axis=1) > 0
    cosine = np.einsum("vci,vi->vc", corners, mean).min(axis=1)
    wide = np.where(outside & (cosine > 0.01), np.arccos(np.clip(cosine, -1, 1)), np.pi)
    axis, angle = np.where((wide < angle)[:, None], mean, axis), np.minimum(wide, angle)
    # The half-space behind the face that the point lies farthest before
    face = np.argmax(beyond, axis=1)
    normal = np.zeros_like(points)
    rows = np.arange(len(points))
    normal[rows, face] = np.where(points[rows, face] < low[face], 1.0, -1.0)
    half = outside & (angle > np.pi / 2)
    axis, angle = np.where(half[:, None], normal, axis), np.where(half, np.pi / 2, angle)
    share = np.sin(np.minimum(angle + MARGIN, np.pi) / 2) ** 2
    number = np.floor(np.log(np.maximum(share, SMALLEST)) / -np.log(STEP))
    return Cones(axis, angle, STEP ** -np.maximum(number, 0.0))


def rays_of(share: float, rays: int) -> int:
    """Return how many rays, an even number, a cone of this share of the sphere gets.

    >>> rays_of(1.0, 1024), rays_of(0.25, 1024), rays_of(2.0**-12, 1024)
    (1024, 338, 32)
    """
    half: int = max(round(rays * share**POWER / 2), min(FEWEST, rays) // 2, 1)
    return 2 * half


def total_of(where: Cones, rays: int) -> int:
    """Return how many rays all these cones get."""
    shares, voxels = np.unique(where.share, return_counts=True)
    return sum(int(n) * rays_of(float(s), rays) for s, n in zip(shares, voxels, strict=True))


def spiral(share: float, count: int) -> Array:
    """Spread `count` unit vectors (count, 3) over the cone of this share of the sphere about +z.

    The even ones of the spiral come first, then the odd ones.
    """
    order = np.concatenate([np.arange(0, count, 2), np.arange(1, count, 2)])
    fall = 2 * share * (order + 0.5) / count
    ring, phi = np.sqrt(fall * (2 - fall)), order * GOLDEN_ANGLE
    return np.stack([ring * np.cos(phi), ring * np.sin(phi), 1 - fall], axis=-1)


def project(
    scene: RayScene,
    points: Float,
    where: Cones,
    keys: Indices,
    rays: int,
    l_max: int,
    progress: workers.Progress = workers.silent,
    *,
    number: int = 0,
) -> Estimate:
    """Trace the rays of voxels at points (v, 3) in unit space; `rays` a whole sphere.

    keys : (v,) numbers that tell voxels apart, for their random turns; each `number` has its own.
    """
    around = angles(where, keys, rays, number)
    pools = []
    for share in np.unique(where.share)[::-1]:
        chosen = np.flatnonzero(where.share == share)
        count = rays_of(float(share), rays)
        pattern = spiral(float(share), count)
        basis = np.asarray(spherical_harmonics.evaluate(pattern, l_max), np.float64)
        weight = 4 * np.pi * share / count
        shape = _Pattern(np.ascontiguousarray(pattern), np.ascontiguousarray(basis.T * weight))
        step = max(1, TILE // count)
        pools += [(shape, chosen[a : a + step]) for a in range(0, len(chosen), step)]

    def trace(tile: tuple[_Pattern, Indices]) -> tuple[Array, Array]:
        shape, chosen = tile
        one, two = _halves(scene, points[chosen], shape, around[chosen])
        return one + two, by_bands(np.square(one - two))

    found = kept(trace, pools, progress)
    K = (l_max + 1) ** 2
    upright = np.zeros((K, len(points)), np.float32)
    apart = np.zeros((len(points), l_max + 1), np.float32)
    for (_, chosen), (whole, squares) in zip(pools, found, strict=True):
        upright[:, chosen], apart[chosen] = whole, squares.T
    terms = np.empty((len(points), K), np.float32)

    def turn(part: slice) -> None:
        terms[part] = turned(upright[:, part], around[part], l_max).T

    workers.map_tiles(turn, [slice(a, a + CHUNK) for a in range(0, len(points), CHUNK)])
    return Estimate(terms, apart)


@dataclass(frozen=True)
class _Pattern:
    """Directions (n, 3) about +z, and their weighted basis (K, n)."""

    directions: Array
    basis: Array


_buffers = threading.local()


def _halves(scene: RayScene, origins: Float, shape: _Pattern, around: Array) -> tuple[Array, Array]:
    """Trace one pattern from origins (v, 3); the projections (K, v) of its two halves."""
    v, n = len(origins), len(shape.directions)
    space: Any = getattr(_buffers, "space", None)
    if space is None or space.shape[1] < n * v:
        space = _buffers.space = np.empty((2, max(n * v, TILE), 3), np.float32)
    starts, directions = space[0, : n * v], space[1, : n * v]
    np.copyto(starts.reshape(n, v, 3), origins[None])
    frames = np.ascontiguousarray(frames_of(around).transpose(2, 0, 1).reshape(3, -1))
    np.copyto(directions.reshape(n, 3 * v), shape.directions @ frames, casting="same_kind")
    blocked = scene.occluded(starts, directions, finite=True)
    seen = blocked.reshape(n, v).astype(np.float64)
    middle = n // 2
    one = shape.basis[:, :middle] @ seen[:middle]
    two = shape.basis[:, middle:] @ seen[middle:]
    return one, two


def by_bands(values: Array) -> Array:
    """Return the means (l_max + 1, v) over each band of values (K, v)."""
    first = np.arange(round(len(values) ** 0.5)) ** 2
    return np.asarray(np.add.reduceat(values, first) / (2 * np.sqrt(first) + 1)[:, None])


def angles(where: Cones, keys: Indices, salt: int, number: int = 0) -> Array:
    """Return (v, 3) Euler angles Z Y Z that turn +z to each cone's axis, with a random spin.

    The axis stands off by as much as the class's cone is wider; where the cone is the whole sphere,
    it points anywhere.
    """
    a, b, c = (uniform01(keys, salt, 3 * number + i) for i in range(3))
    slack = 2 * np.arcsin(np.sqrt(where.share)) - where.angle - MARGIN
    tilt = np.maximum(slack, 0) * np.sqrt(a)
    x, y = orthonormal_basis(where.axis)
    around = 2 * np.pi * b
    side = np.cos(around)[:, None] * x + np.sin(around)[:, None] * y
    axis = np.cos(tilt)[:, None] * where.axis + np.sin(tilt)[:, None] * side
    inclination = np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2])
    azimuth = np.arctan2(axis[:, 1], axis[:, 0])
    whole = where.share >= 1
    inclination = np.where(whole, np.arccos(np.clip(1 - 2 * a, -1, 1)), inclination)
    return np.stack([np.where(whole, around, azimuth), inclination, 2 * np.pi * c], axis=1)


def frames_of(around: Array) -> Array:
    """Return the rotations (v, 3, 3) Rz(a) Ry(b) Rz(c) of Euler angles (v, 3)."""
    (ca, cb, cc), (sa, sb, sc) = np.cos(around).T, np.sin(around).T
    rows = [
        [ca * cb * cc - sa * sc, -ca * cb * sc - sa * cc, ca * sb],
        [sa * cb * cc + ca * sc, -sa * cb * sc + ca * cc, sa * sb],
        [-sb * cc, sb * sc, cb],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def turned(terms: NDArray[np.floating[Any]], around: Array, l_max: int) -> Array:
    """Turn functions (K, ..., v) by the rotations of Euler angles (v, 3), each by its own."""
    # +z to +y, so that a turn about y is one about z
    quarter = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    J = np.zeros((len(terms), len(terms)))
    for band, block in enumerate(spherical_rotation.rotation_matrices(quarter, l_max)):
        own = slice(band**2, (band + 1) ** 2)
        J[own, own] = block
    a, b, c = around.T
    upright = np.tensordot(J.T, _about_z(np.asarray(terms, np.float64), c, l_max), 1)
    return _about_z(np.tensordot(J, _about_z(upright, b, l_max), 1), a, l_max)


def _about_z(terms: Array, angle: Array, l_max: int) -> Array:
    """Turn functions (K, ..., v) about +z, each by its own angle (v,)."""
    out = terms.copy()
    for m in range(1, l_max + 1):
        cosine, sine = np.cos(m * angle), np.sin(m * angle)
        for band in range(m, l_max + 1):
            plus, minus = band * (band + 1) + m, band * (band + 1) - m
            out[plus] = cosine * terms[plus] - sine * terms[minus]
            out[minus] = sine * terms[plus] + cosine * terms[minus]
    return out
