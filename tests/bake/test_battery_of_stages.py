"""The generic battery on the stages whose own tests do not run it: meshes, rings, pictures."""

from pathlib import Path

import numpy as np
import pytest

from bake import mesh, photograph_ring, picture
from bake.photographs import Photographs
from tests.bake import small_meshes, stage_battery

BALL = small_meshes.sphere(6, 8)


@pytest.mark.parametrize("case", stage_battery.cases(BALL), ids=str)
def test_mesh(case: stage_battery.Case, tmp_path: Path) -> None:
    stage_battery.check(case, mesh.prepare, (BALL,), mesh.Params(), tmp_path)


def _lights(count: int) -> np.ndarray:
    t = 2 * np.pi * np.arange(count) / count
    e = np.radians(30.0)
    return np.stack([np.cos(e) * np.cos(t), np.cos(e) * np.sin(t), np.full(count, np.sin(e))], -1)


def _taken() -> Photographs:
    rng = np.random.default_rng(1)
    pictures = rng.uniform(0.1, 0.9, (12, 5, 4, 3)).astype(np.float32)
    coverage = rng.uniform(0, 1, (5, 4)).astype(np.float32)
    return Photographs(pictures, _lights(12), "linear", coverage=coverage)


TAKEN = _taken()
RING = photograph_ring.Params(held_out=(3,))


@pytest.mark.parametrize("case", stage_battery.cases(TAKEN), ids=str)
def test_ring_of_photographs(case: stage_battery.Case, tmp_path: Path) -> None:
    stage_battery.check(case, photograph_ring.fit, (TAKEN,), RING, tmp_path)


PIXELS = np.random.default_rng(2).uniform(0, 1, (12, 10, 4)).astype(np.float32)


@pytest.mark.parametrize("case", stage_battery.cases(PIXELS), ids=str)
def test_picture(case: stage_battery.Case, tmp_path: Path) -> None:
    params = picture.Params(width=10, height=12)
    stage_battery.check(case, picture.prepare, (PIXELS,), params, tmp_path)
