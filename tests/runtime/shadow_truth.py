"""A slow and obvious version of the shadow pass, and volumes to try it with."""

import numpy as np

from formats import occlusion
from formats.occlusion import Box, Occlusion
from maths.occlusion_shadow import occlusion_falloff, outside
from maths.spherical_harmonics import turn_zonal
from maths.spherical_projection import cap
from maths.spherical_rotation import rotate


def ball_volume(box, grid=12, l_max=2, depth=8, radius=None):
    """The exact harmonics of a ball that touches the shortest faces, off its middle as stored."""
    half = np.asarray(box.half_extent)
    radius = half.min() if radius is None else radius
    towards = np.asarray(box.centre) - box.voxel_centres(grid)
    away = np.maximum(np.linalg.norm(towards, axis=1), 1.0001 * radius)
    terms = turn_zonal(cap(np.arcsin(radius / away), l_max), towards)
    return stored(terms.reshape(grid, grid, grid, -1), box, depth)


def stored(terms, box, depth=8):
    """Volumes of terms (n, n, n, K) in a turned basis of all K components."""
    K = terms.shape[-1]
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(K, K)))[0]
    scores = np.zeros((*terms.shape[:3], 4 * -(-K // 4)), np.float32)
    scores[..., :K] = terms @ basis.T
    scales = np.abs(scores).max(axis=(0, 1, 2))
    codes = occlusion.encode(scores / np.where(scales > 0, scales, 1), depth)
    volumes = np.moveaxis(codes.reshape(*codes.shape[:3], -1, 4), 3, 0)
    return Occlusion(np.ascontiguousarray(volumes), scales.astype(np.float32), basis, box)


def small_box(half=(0.5, 0.8, 0.4), centre=(0.1, 0.0, -0.2)):
    return Box(centre, half)


def looked_up(volume, place):
    """Values (m, c) of a volume (n, n, n, c), axes z, y, x, at coordinates (m, 3) in [0, 1]."""
    n = len(volume)
    at = np.clip(place * n - 0.5, 0, n - 1)
    low = np.minimum(at.astype(int), n - 2)
    share, found = at - low, 0.0
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, share, 1 - share), axis=-1)
        x, y, z = (low + corner).T
        found = found + weight[:, None] * volume[z, y, x]
    return found


def seen(asset, placed, light, points, time=0.0):
    """Share (m, 3) of light that reaches world points (m, 3) past a caster.

    light : function of a world point, coefficients (K, 3) of what shines there.
    """
    matrix, box = placed.world_from_mesh(time), asset.box
    turn = matrix[:3, :3] / placed.scale
    p = box.to_object((points - matrix[:3, 3]) @ turn / placed.scale)
    terms = looked_up(asset.decoded(), 0.5 + 0.5 * p / outside(p)[:, None]) @ asset.basis
    if placed.shadow.falloff:
        terms = terms * occlusion_falloff(p, 2 * np.asarray(box.half_extent))[:, None]
    shares = []
    for side in (-1, 1):
        end = np.array(box.centre)
        end[box.longest_axis] += side * box.half_extent[box.longest_axis]
        L = rotate(light(matrix[:3, :3] @ end + matrix[:3, 3]), turn.T)[: terms.shape[1]]
        if not placed.shadow.coloured:
            L = np.repeat(L @ [[0.2126], [0.7152], [0.0722]], 3, axis=1)
        total = 2 * np.sqrt(np.pi) * L[0]
        hidden = np.divide(terms @ L, total, where=total > 1e-12, out=np.zeros((len(p), 3)))
        shares.append(np.clip(1 - hidden, 0, 1))
    along = np.clip(p[:, box.longest_axis] + 0.5, 0, 1)[:, None]
    return (1 - along) * shares[0] + along * shares[1]
