"""Stages that take long give the same bytes wherever they are interrupted and gone on with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bake import billboard, dome_renders, lightmap, occlusion, tiles, transfer, workers
from formats.voxels import Voxels
from tests.bake.small_meshes import box, joined, plate
from tests.bake.small_stages import contents


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write each tile as soon as it is finished."""
    monkeypatch.setattr(tiles, "EVERY", 0.0)
    monkeypatch.setattr(tiles, "PRICE", 0)


def stop_at(call: int) -> Callable[[float], None]:
    """Progress that is interrupted when it is told of for the n-th time."""
    left = [call]

    def progress(fraction: float) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt

    return progress


def blocks() -> Voxels:
    cells = np.zeros((3, 3, 3), np.uint16)
    cells[0], cells[1, 1, 1] = 1, 2
    albedo = np.array([[0, 0, 0], [0.5, 0.4, 0.3], [0, 0, 0]], np.float32)
    emission = np.array([[0, 0, 0], [0, 0, 0], [4, 3, 2]], np.float32)
    return Voxels(cells, albedo, emission, 1.0, (0.0, 0.0, 0.0))


def shapes() -> Any:
    return joined(box((1.0, 0.6, 0.8)), plate((0, 1, 0), (0, 2, 0), 0.5))


STAGES = {
    "billboard": (billboard, 64, lambda n: billboard.trace(
        shapes(), params=billboard.Params(resolution=24, samples=2, lights=16, held_out=2),
        progress=n)),
    "dome renders": (dome_renders, 64, lambda n: dome_renders.render(
        shapes(), params=dome_renders.Params(resolution=24, samples=2, lights=6), progress=n)),
    "occlusion": (None, 0, lambda n: occlusion.trace(
        shapes(), params=occlusion.Params(grid=6, l_max=1, rays=64, proof=2), progress=n)),
    "adaptive occlusion": (None, 0, lambda n: occlusion.trace(
        shapes(), params=occlusion.Params(grid=4, l_max=1, rays=4096, adaptive=0.02, proof=2),
        progress=n)),
    "transfer": (None, 0, lambda n: transfer.trace(
        shapes(), params=transfer.Params(l_max=1, rays=1 << 12, edge=0.25, components=4),
        progress=n)),
    "lightmap": (None, 0, lambda n: lightmap.light(
        blocks(), params=lightmap.Params(texels=1, rays=128, bounces=2, target=0.0), progress=n)),
}  # fmt: skip


@pytest.mark.parametrize("name", STAGES)
def test_long_stages_give_the_same_bytes_wherever_they_are_interrupted(
    name: str, tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, tile, stage = STAGES[name]
    if module is not None:
        monkeypatch.setattr(module, "TILE", tile)
    seen: list[float] = []
    truth = saved(stage(seen.append), tmp_path / "truth")
    assert len(seen) >= 3
    for trial in range(3):
        folder = tmp_path / f"tiles {trial}"
        # Interrupted up to three times
        for _ in range(1 + trial):
            try:
                with tiles.shelf(folder, name, lambda text: None):
                    stage(stop_at(int(rng.integers(1, len(seen)))))
            except KeyboardInterrupt:
                continue
        said: list[str] = []
        with tiles.shelf(folder, name, said.append):
            result = stage(workers.silent)
        assert said
        assert saved(result, tmp_path / f"again {trial}") == truth


def saved(asset: Any, folder: Path) -> dict[str, bytes]:
    folder.mkdir()
    asset.save(folder)
    return contents(folder)
