"""A photographed-looking set in closed form: a shiny ball on a table, seen from above, with a
little light from everywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def lights(count: int, lowest: float = 0.25) -> Array:
    """Return directions (count, 3) of a golden spiral over a dome, z from `lowest` up."""
    z = lowest + (1 - lowest) * (1 - (np.arange(count) + 0.5) / count)
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)


def ball(directions: Array, size: int = 24) -> NDArray[np.float32]:
    """Return linear pictures (n, size, size, 3): a ball of radius .5, gloss and cast shadow."""
    x = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(x, -x)
    inside = x * x + y * y < 0.25
    height = np.sqrt(np.where(inside, 0.25 - x * x - y * y, 0.0))
    normal = np.stack([2 * x * inside, 2 * y * inside, np.where(inside, 2 * height, 1)], axis=-1)
    point = np.stack([x, y, np.where(inside, 0.5 + height, 0.0)], axis=-1)
    albedo = np.where(inside[..., None], [0.7, 0.25, 0.15], [0.35, 0.4, 0.5])
    pictures = []
    for light in directions:
        towards = np.array([0, 0, 0.5]) - point
        along = towards @ light
        aside = np.sum(towards * towards, axis=-1) - along**2
        lit = inside | ~((aside < 0.25) & (along > 0))
        facing = np.maximum(normal @ light, 0) * lit
        half = light + np.array([0.0, 0.0, 1.0])
        half /= np.linalg.norm(half)
        gloss = 0.2 * np.maximum(normal @ half, 0) ** 12 * lit * inside
        pictures.append(albedo * (0.05 + 0.95 * facing[..., None]) + gloss[..., None])
    return np.asarray(np.clip(pictures, 0, 1), np.float32)
