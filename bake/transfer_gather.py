"""Light from a mesh to itself: what vertices have, gathered where their rays meet the mesh.

Reference
---------
Sloan, Kautz, Snyder 2002, Precomputed Radiance Transfer, section 5 (interreflections).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import transfer_mesh, transfer_rays
from bake.rays import Hits, RayScene
from bake.shading import Surface
from formats.mesh import Mesh

Float = NDArray[np.float32]


def gathered(
    scene: RayScene, single: Mesh, whole: Mesh, hits: Hits, directions: Float, count: int
) -> tuple[Any, ...]:
    """Return three matrices (count, n): the mean over a vertex's rays of albedo times what the
    corners of the faces they meet have. Backs of one-sided faces give nothing.

    hits : of rays (N count,), ray by ray.
    """
    from scipy.sparse import csr_array

    met = np.flatnonzero(hits.face >= 0)
    own = hits.pick(met)
    front = transfer_rays.fronts(own, scene.normals(), directions[met])
    twin = transfer_mesh.twins(single, whole)
    face = np.where(front, own.face, twin[own.face])
    kept = np.flatnonzero(face >= 0)
    met, own, face = met[kept], own.pick(kept), face[kept]
    albedo = Surface(single, scene, 0.0, 0.0).albedo(own) * np.float32(count / len(hits.face))
    weights = own.weights
    # A twin's corners stand the other way round
    swapped = face >= len(single.faces)
    weights = np.where(swapped[:, None], weights[:, ::-1], weights)
    rows, columns = np.repeat(met % count, 3), whole.faces[face].ravel()
    shape = (count, len(whole.vertices))

    def matrix(channel: int) -> Any:
        values = (weights * albedo[:, channel, None]).ravel()
        return csr_array((values, (rows, columns)), shape=shape)

    return tuple(matrix(channel) for channel in range(3))


def arrays(seen: tuple[Any, ...]) -> tuple[NDArray[Any], ...]:
    """Return what `gathered` gave as arrays; where its values lie is the same in all matrices."""
    return (*(matrix.data for matrix in seen), seen[0].indices, seen[0].indptr)


def matrices(seen: tuple[NDArray[Any], ...], count: int) -> tuple[Any, ...]:
    """Return the matrices (v, count) that `arrays` took apart."""
    from scipy.sparse import csr_array

    *values, columns, starts = seen
    shape = (len(starts) - 1, count)
    return tuple(csr_array((value, columns, starts), shape=shape) for value in values)


def bounced(first: Float, seen: list[tuple[Any, ...]], bounces: int) -> Float:
    """Return vectors (m, 3, K) of direct light and that of some bounces.

    first : (m, K) direct light; seen : matrices of m rows together, whose n columns are the first n
    of these: what comes beyond them, if anything, sees the others and is not seen.
    """
    from scipy.sparse import vstack

    total = np.repeat(first[:, None], 3, axis=1)
    for channel in range(3):
        matrix = vstack([tile[channel] for tile in seen], format="csr")
        last = first
        for _ in range(bounces):
            last = np.asarray(matrix @ last[: matrix.shape[1]], np.float32)
            total[:, channel] += last
    # Where all colours are alike, one is enough
    alike = np.array_equal(total[:, 0], total[:, 1]) and np.array_equal(total[:, 0], total[:, 2])
    return np.ascontiguousarray(total[:, :1]) if alike else total
