"""A slow and obvious version of the shadow pass, and volumes to try it with."""

import numpy as np

from formats import occlusion
from formats.occlusion import Box, Occlusion
from maths.occlusion_shadow import occlusion_falloff, outside
from maths.spherical_harmonics import evaluate, l_max_of, turn_zonal
from maths.spherical_projection import cap, quadrature
from maths.spherical_rotation import rotate


def ball_volume(box, grid=12, l_max=2, depth=8, radius=None):
    """The exact harmonics of a ball that touches the shortest faces, off its middle as stored."""
    half = np.asarray(box.half_extent)
    radius = half.min() if radius is None else radius
    towards = np.asarray(box.centre) - box.voxel_centres(grid)
    away = np.maximum(np.linalg.norm(towards, axis=1), 1.0001 * radius)
    terms = turn_zonal(cap(np.arcsin(radius / away), l_max), towards)
    return stored(terms.reshape(grid, grid, grid, -1), box, depth)


def stored(terms, box, depth=8, turned=True):
    """Volumes of terms (nz, ny, nx, K) in a basis of all K components, turned or their own."""
    K = terms.shape[-1]
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(K, K)))[0] if turned else np.eye(K)
    scores = np.zeros((*terms.shape[:3], 4 * -(-K // 4)), np.float32)
    scores[..., :K] = terms @ basis.T
    scales = np.abs(scores).max(axis=(0, 1, 2))
    codes = occlusion.encode(scores / np.where(scales > 0, scales, 1), depth)
    volumes = np.moveaxis(codes.reshape(*codes.shape[:3], -1, 4), 3, 0)
    return Occlusion(np.ascontiguousarray(volumes), scales.astype(np.float32), basis, box)


def bands_volume(box, l_max=3, radius=None, size=(9, 12, 8), coarser=(7, 8, 6), warp=0.5, depth=8):
    """The exact harmonics of the ball at the texels of two grids (x, y, z), finer in the middle."""
    half, K = np.asarray(box.half_extent), (l_max + 1) ** 2
    radius = half.min() if radius is None else radius
    grids, scales = [], []
    for (x, y, z), own in ((size, slice(0, 4)), (coarser, slice(4, K))):
        q = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in (z, y, x)), indexing="ij"), -1)
        q = 2 * q[..., ::-1].reshape(-1, 3) / (x, y, z) - 1
        towards = -2 * half * q / (1 + warp - warp * np.abs(q))
        away = np.maximum(np.linalg.norm(towards, axis=1), 1.0001 * radius)
        terms = turn_zonal(cap(np.arcsin(radius / away), l_max), towards).reshape(z, y, x, K)
        part = stored(terms[..., own], box, depth, turned=False)
        grids, scales = [*grids, part.volumes], [*scales, part.scales]
    scales, basis = np.concatenate(scales), np.eye(K)
    return Occlusion(grids[0], scales, basis, box, coarse=grids[1], warp=warp)


def small_box(half=(0.5, 0.8, 0.4), centre=(0.1, 0.0, -0.2)):
    return Box(centre, half)


def slots_at(asset, p):
    """Stored values (m, slots) at p (m, 3), outside the volume those of its edge."""
    q = p / outside(p)[:, None]
    q = q * (1 + asset.warp) / (1 + asset.warp * np.abs(q))
    slots = [
        looked_up(np.concatenate(list(occlusion.decode(grid)), axis=-1), 0.5 + 0.5 * q)
        for grid in asset.grids
    ]
    return np.concatenate(slots, axis=1)


def terms_at(asset, p):
    """Harmonics (m, K) of occlusion at p (m, 3), outside the volume those of its edge."""
    return (slots_at(asset, p) * asset.scales)[:, : asset.components] @ asset.basis


def looked_up(volume, place):
    """Values (m, c) of a volume (nz, ny, nx, c) at coordinates (m, 3) in [0, 1]: x, y, z."""
    n = np.array(volume.shape[2::-1])
    at = np.clip(place * n - 0.5, 0, n - 1)
    low = np.minimum(at.astype(int), n - 2)
    share, found = at - low, 0.0
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, share, 1 - share), axis=-1)
        x, y, z = (low + corner).T
        found = found + weight[:, None] * volume[z, y, x]
    return found


def cut_cosine(x):
    """The clamped cosine x (...) after its band 2, by its polynomial."""
    return 0.25 + 0.5 * x + 5 / 32 * (3 * x * x - 1)


def received(terms, L, normals):
    """Share (m, c) of light L (K', c) hidden by terms (m, K) from normals (m, 3), all in the same
    axes, and what they receive over all of the light (m, c): a sum over directions."""
    l_max = l_max_of(terms.shape[1])
    d, area = quadrature((l_max_of(len(L)) + l_max + 3) // 2)
    lit = cut_cosine(normals @ d.T)[..., None] * (evaluate(d, l_max_of(len(L))) @ L)
    blocked = (terms @ evaluate(d, l_max).T)[..., None]
    total = 2 * np.sqrt(np.pi) * L[0]
    return (np.einsum("n,mnc->mc", area, x) / total for x in (lit * blocked, lit))


def seen(asset, placed, light, points, time=0.0, normals=None):
    """Share (m, 3) of light that reaches world points (m, 3) past a caster.

    light : function of a world point, coefficients (K, 3) of what shines there, of two bands more
    than the volume where there are normals.  normals : (m, 3) of the world, None for alike.
    """
    matrix, box = placed.world_from_mesh(time), asset.box
    turn = matrix[:3, :3] / placed.scale
    p = box.to_object((points - matrix[:3, 3]) @ turn / placed.scale)
    terms = terms_at(asset, p)
    if placed.shadow.falloff:
        terms = terms * occlusion_falloff(p, 2 * np.asarray(box.half_extent))[:, None]
    shares = []
    for side in (-1, 1):
        end = np.array(box.centre)
        end[box.longest_axis] += side * box.half_extent[box.longest_axis]
        L = rotate(light(matrix[:3, :3] @ end + matrix[:3, 3]), turn.T)
        L = L if normals is not None else L[: terms.shape[1]]
        if not placed.shadow.coloured:
            L = np.repeat(L @ [[0.2126], [0.7152], [0.0722]], 3, axis=1)
        if normals is not None:
            hidden, facing = received(terms, L, normals @ turn)
            shares.append(np.where(facing > 1 / 32, np.clip(1 - hidden / facing, 0, 1), 1))
            continue
        total = 2 * np.sqrt(np.pi) * L[0]
        hidden = np.divide(terms @ L, total, where=total > 1e-12, out=np.zeros((len(p), 3)))
        shares.append(np.clip(1 - hidden, 0, 1))
    along = np.clip(p[:, box.longest_axis] + 0.5, 0, 1)[:, None]
    return (1 - along) * shares[0] + along * shares[1]
