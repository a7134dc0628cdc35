"""The study of intervals: its truths by closed forms, its counts by hand, and small counts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake import voxel_faces
from bake.rays import RayScene
from maths.spherical_lights import project_polygon
from pipelines.studies import coverage, cube_gathers, parts, record
from pipelines.studies.subjects import Setting


def test_counts_are_those_of_normal_numbers() -> None:
    def once(run: int) -> tuple[np.ndarray, np.ndarray]:
        off = np.random.default_rng(run).normal(size=50)
        return 2 * off, np.full(50, 2 * 1.96)

    found = coverage.counted(once, 400)
    # 4 standard deviations of 400 and of 20,000 draws
    assert abs(found.held / 400 - 0.95) < 4 * 0.011
    assert abs(found.every - 0.95) < 4 * 0.0016
    assert found.ratio == pytest.approx(1, abs=0.02)
    assert coverage.counted(once, 10, seed=1) != coverage.counted(once, 10)


def test_an_answer_tells_the_worst_and_is_written_down(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def always(run: int) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(3), np.ones(3)

    def every_other(run: int) -> tuple[np.ndarray, np.ndarray]:
        return np.full(3, run % 2), np.full(3, 0.5)

    made = [(("occlusion", "bell"), always), (("lightmap", "room"), every_other)]
    monkeypatch.setattr(coverage, "subjects", lambda setting, stack: made)
    setting = Setting(quick=True)
    found = coverage.measure(setting)
    assert found.title.startswith("50.0% to 100.0% of 40")
    assert [row["error"] for row in found.rows] == [0.0, 0.5]
    assert found.titles["world"] == "0 of 2 worlds miss 3% to 7%"
    assert found.columns() == ["world"]
    assert record.write(found, tmp_path, setting, 1.0)


def test_an_interrupted_count_goes_on(tmp_path: Path) -> None:
    done: list[int] = []

    def once(run: int) -> tuple[np.ndarray, np.ndarray]:
        if run == 120 and len(done) == 119:
            raise KeyboardInterrupt
        done.append(run)
        return np.random.default_rng(run).normal(size=5), np.full(5, 1.96)

    def count() -> coverage.Count:
        with parts.into(tmp_path / "parts", "key"):
            return coverage.counted(once, 130, name="lightmap, room")

    with pytest.raises(KeyboardInterrupt):
        count()
    found = count()
    # The third part of 50 runs had begun
    assert done[119:] == list(range(101, 131))
    assert not (tmp_path / "parts").exists()
    assert replace(found, seconds=0.0) == replace(coverage.counted(once, 130), seconds=0.0)


def test_rooms_are_furnaces_where_all_glows() -> None:
    room = coverage.room()
    cells = np.minimum(room.cells, 1)
    world = replace(room, cells=cells, emission=np.full_like(room.emission, 2.0))
    within, light = coverage.by_patches(world, voxel_faces.layout(cells, texels=1))
    assert within.sum() == 6 * coverage.SIDE**2
    # The albedo is a float32
    np.testing.assert_allclose(light, 2 * np.pi / (1 - coverage.ALBEDO), rtol=1e-6)


def test_rays_all_around_see_a_triangle() -> None:
    points = np.array([[0.1, 0.8, 0.3], [-1.2, 0.4, -0.6]])
    found = coverage.all_around(RayScene(coverage.TRIANGLE, [[0, 1, 2]]), points)
    truth = project_polygon(points, coverage.TRIANGLE, np.ones(3), 4, two_sided=True)[..., 0]
    # 131,072 rays, one in 50 of which hits: 4e-3 of a share as large, spread evenly by far less
    np.testing.assert_allclose(found, truth, atol=2e-3)


def test_intervals_of_a_lightmap_hold() -> None:
    once = coverage.rays(coverage.corner())
    rng, held, runs, draws = np.random.default_rng(2), 0, 30, 4
    for run in range(runs):
        off, reach = once(run)
        held += int((np.abs(off) <= reach)[rng.permutation(len(off))[:draws]].sum())
    # 120 draws, nearly independent: a standard deviation of .02
    assert held / (runs * draws) > 0.95 - 4 * 0.02


@pytest.mark.gpu
def test_intervals_of_gathered_light_hold() -> None:
    with cube_gathers.card() as card:
        once = coverage.passes(card, coverage.room())
        found = coverage.counted(once, 10)
    # All texels of ten runs share what is handed on; without it held 80 to 90 %
    assert found.every > 0.9
    assert found.ratio < 1.3
