"""Which voxels lie inside the solid, and what they hold: what their neighbours outside see.

A ray from inside a closed surface leaves it once more than it enters. Counted with signs this also
holds for inverted surfaces and for parts that overlap; where faces disagree about what is outside,
the parity of the crossings is counted. A pair of opposite rays speaks for "inside" if both do, and
two thirds of the pairs decide: holes and sheets do not make an inside. Where a few pairs disagree,
many more are asked. Thin walls are found by the same question, asked a voxel under the surface.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from bake.rays import RayScene
from maths.sampling import fibonacci_sphere, r2, random_rotation

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Mask = NDArray[np.bool_]

PAIRS, MORE = 7, 32
ENOUGH = 2 / 3  # of the pairs
TILE = 4096  # points
DEEPEST = 64  # crossings followed along a ray
# In unit space: a ray goes on so far behind a hit, past the second of two hits on one edge
STRIDE = np.float32(2e-5)
SAMPLES = 256  # places on the surface
DEPTHS = (0.5, 1.0)  # voxels


def is_oriented(vertices: Array, faces: NDArray[np.int64]) -> bool:
    """Whether nearly all edges that two faces share run once each way, vertices (n, 3) that lie at
    one place being one."""
    _, _, count = _edges(vertices, faces)
    # An edge that two faces run the same way
    twice = np.count_nonzero(count > 1)
    return bool(twice <= 0.01 * len(count))


def is_inverted(vertices: Array, faces: NDArray[np.int64]) -> bool:
    """Whether the surface is closed and looks inward: each edge runs as often one way as the other,
    and the signed volume is negative. Vertices (n, 3) that lie at one place are one."""
    middle = vertices.min(axis=0) / 2 + vertices.max(axis=0) / 2
    size = float(np.abs(vertices - middle).max()) or 1.0
    a, b, c = np.moveaxis((vertices[faces] - middle) / size, 1, 0)
    if np.einsum("ij,ij->", a, np.cross(b, c)) >= 0:
        return False
    start, end, count = _edges(vertices, faces)
    there, back = np.lexsort((end, start)), np.lexsort((start, end))
    pairs = ((start, end), (end, start), (count, count))
    return all(np.array_equal(one[there], other[back]) for one, other in pairs)


def _edges(
    vertices: Array, faces: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the directed edges: from where, to where, of how many faces."""
    keys = np.ascontiguousarray(vertices + 0.0).view(f"V{3 * vertices.itemsize}").ravel()
    _, same = np.unique(keys, return_inverse=True)
    corners = same[faces].astype(np.int64)
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    edges, count = np.unique(start * (len(vertices) + 1) + end, return_counts=True)
    return edges // (len(vertices) + 1), edges % (len(vertices) + 1), count


def inside(scene: RayScene, points: Float, *, oriented: bool, more: int = MORE) -> Mask:
    """Tell which points (n, 3) of unit space lie inside. oriented : faces agree on the outside.
    more : pairs of rays where the first seven disagree; 0: two thirds of the seven decide."""
    turn = random_rotation(0x1251DE)
    few, many = (fibonacci_sphere(2 * n, turn)[:n].astype(np.float32) for n in (PAIRS, more or 1))
    normals = scene.normals()

    def votes(asked: Float, directions: Float) -> NDArray[np.int64]:
        found = np.zeros(len(asked), np.int64)
        for direction in directions:
            both = _within(scene, normals, asked, direction, oriented)
            both &= _within(scene, normals, asked, -direction, oriented)
            found += both
        return found

    def decided(tile: slice) -> Mask:
        asked = points[tile]
        found = votes(asked, few)
        if not more:
            return np.asarray(found > ENOUGH * PAIRS)
        within = found == PAIRS
        mixed = (found > 0) & ~within
        within[mixed] = votes(asked[mixed], many) > ENOUGH * more
        return np.asarray(within)

    tiles = [slice(a, a + TILE) for a in range(0, len(points), TILE)]
    return np.concatenate([np.zeros(0, bool), *workers.map_tiles(decided, tiles)])


def _within(
    scene: RayScene, normals: Float, points: Float, direction: Float, oriented: bool
) -> Mask:
    """Tell from the crossings along one direction which points lie inside."""
    total = np.zeros(len(points), np.int64)
    active, origins = np.arange(len(points)), points
    for _ in range(DEEPEST):
        hits = scene.intersect(origins, direction[None], finite=True)
        met = hits.face >= 0
        if not met.any():
            break
        active, reached = active[met], hits.distance[met]
        leaving = normals[hits.face[met]] @ direction
        total[active] += np.where(leaving > 0, 1, -1) if oriented else 1
        origins = origins[met] + (reached + STRIDE)[:, None] * direction
    return np.asarray(total != 0 if oriented else total % 2 == 1)


def thin_share(scene: RayScene, pitch: Array, *, oriented: bool) -> float:
    """Return the share of the surface's area that is a sheet, or a wall thinner than a voxel.

    There the solid reaches less deep than a voxel under neither side: it would be lost between
    voxels. pitch : (3,) of a voxel, in unit space.  Asked at 256 places, evenly spread by area.
    """
    a, b, c = np.moveaxis(scene.corners.astype(np.float64), 1, 0)
    cross = np.cross(b - a, c - a)
    area = np.cumsum(np.linalg.norm(cross, axis=1))
    face = np.searchsorted(area, (np.arange(SAMPLES) + 0.5) / SAMPLES * area[-1])
    u, v = r2(np.arange(SAMPLES)).T
    x, y = np.sqrt(u) * (1 - v), np.sqrt(u) * v
    a, b, c, normal = a[face], b[face], c[face], scene.normals()[face].astype(np.float64)
    points = a + x[:, None] * (b - a) + y[:, None] * (c - a)
    deep = normal / np.linalg.norm(normal / pitch, axis=1, keepdims=True)
    thin = np.arange(SAMPLES)
    for side in (-1, 1):
        # What is thick on one side needs no question on the other
        under = [points[thin] + side * depth * deep[thin] for depth in DEPTHS]
        asked = np.concatenate(under).astype(np.float32)
        within = inside(scene, asked, oriented=oriented, more=0)
        thin = thin[~within.reshape(len(DEPTHS), len(thin)).all(axis=0)]
    return len(thin) / SAMPLES


def filled(volume: NDArray[Any], hole: Mask) -> NDArray[Any]:
    """Fill the hole (z, y, x) of a volume (z, y, x, c), layer by layer from its rim inwards.

    A voxel takes the mean of those of its six neighbours that are known. A volume that is all hole
    becomes 0.
    """
    whole = np.where(hole[..., None], 0, volume).astype(volume.dtype)
    if not hole.any() or hole.all():
        return whole
    # Work on the box of the hole and one voxel around it
    places = [np.flatnonzero(hole.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
    box = tuple(slice(max(0, int(at[0]) - 1), int(at[-1]) + 2) for at in places)
    out, known = whole[box], ~hole[box]
    while not known.all():
        total = np.zeros_like(out)
        count = np.zeros(known.shape, np.float32)
        for axis in range(3):
            for side in (slice(None, -1), slice(1, None)):
                other = slice(1, None) if side == slice(None, -1) else slice(None, -1)
                to = tuple(side if a == axis else slice(None) for a in range(3))
                of = tuple(other if a == axis else slice(None) for a in range(3))
                total[to] += np.where(known[of][..., None], out[of], 0)
                count[to] += known[of]
        rim = ~known & (count > 0)
        out[rim] = total[rim] / count[rim][:, None]
        known |= rim
    return whole
