"""A matt ball under a dome of lights, from closed forms: an asset of fifteen channels or so."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from formats import dome
from maths import hemispherical_harmonics, principal_components, sampling

POINTS = 1024  # of the quadrature over the hemisphere


@lru_cache
def matt_ball(
    *,
    channels: int = 15,
    bands: int = 4,
    size: int = 64,
    views: int = 1,
    space: str = "linear",
    coverage: bool = True,
) -> dome.Dome:
    """A ball one metre high on its pivot, with a pattern and a border of an eighth; later views are
    darker. Its exact answers to light are projected on the harmonics and on the components."""
    centre = (np.arange(size) + 0.5 - size / 2) / (3 / 8 * size)
    x, y = np.meshgrid(centre, -centre)
    inside = x**2 + y**2 < 1
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)
    checks = 0.7 + 0.3 * np.sign(np.sin(9 * x + 1) * np.sin(9 * y))
    albedo = np.stack([0.9 * checks, 0.5 + 0.3 * checks * x, 0.4 + 0 * x], axis=-1)
    points = sampling.fibonacci_sphere(2 * POINTS)[:POINTS]
    basis = hemispherical_harmonics.evaluate(points, bands) * (2 * np.pi / POINTS)
    lambert = np.maximum(normals.reshape(-1, 3) @ points.T, 0) @ basis
    series = lambert[:, :, None] * (albedo * inside[..., None]).reshape(-1, 1, 3)
    found = principal_components.principal_components(series.reshape(size * size, -1), channels)
    scores = (series.reshape(size * size, -1) @ found.vectors.T).reshape(size, size, channels)
    alpha = inside.astype(np.float32) if coverage else None
    darker = [1.0, *((v + 1) / (views + 1) for v in range(1, views))]
    planes = np.concatenate([dome.placed(scores * share, alpha) for share in darker])
    levels = [planes]
    while coverage and levels[-1].shape[1] > 1:
        levels.append(halve(levels[-1]))
    codes, scales, _ = dome.encode(tuple(levels), len(planes) // views, coverage)
    return dome.Dome(
        levels=codes,
        scales=scales,
        components=found.vectors.reshape(channels, bands**2, 3),
        space=space,
        coverage=coverage,
        views=views,
        metres_per_texel=1 / (0.75 * size),
        pivot=(size / 2, size * 7 / 8),
        height=1.0,
        max_lod=4.0,
        lens_scale=0.5,
    )


def halve(image: np.ndarray) -> np.ndarray:
    """Average 2x2 texels of (layers, h, w, 4) and clear the outer ones: premultiplied mips."""
    layers, h, w, c = image.shape
    small = image.reshape(layers, h // 2, 2, w // 2, 2, c).mean(axis=(2, 4))
    if h > 4:
        small[:, [0, -1]] = 0
        small[:, :, [0, -1]] = 0
    return small
