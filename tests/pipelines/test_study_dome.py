"""The study of domes: its folds hold out every light once, and its answer is what it measured."""

from pathlib import Path

import numpy as np
import pytest

from pipelines.studies import dome, subjects
from tests.bake.domes import written

QUICK = subjects.Setting(quick=True)


def test_a_quick_run_answers() -> None:
    answer = dome.measure(QUICK)
    stored = [r for r in answer.rows if r["space"] == "stored" and r["channels"] == 16]
    assert len(stored) == 1
    assert answer.figures["stored"]["ours_db"] == stored[0]["ours_db"]
    assert f"{float(stored[0]['ours_db']):.1f} dB stored" in answer.title
    # Measured: ours is 1.4 dB above PTM even on 16 x 16 pixels
    assert float(stored[0]["ours_db"]) > float(stored[0]["ptm_18_db"]) + 0.7
    channels = dict(answer.panels[0].lines["stored"])
    assert list(channels) == list(dome.CHANNELS)
    # Four channels cost more than sixteen do
    assert channels[4] < channels[16] - 0.5
    assert set(answer.panels[1].lines) >= {"stored, 4 bands", "linear, 7 bands"}


def test_folds_hold_out_every_light_once() -> None:
    taken = dome.subject(QUICK, "stored")
    counts = [int(dome.folded(taken, i, 16)["lights"]) for i in range(dome.FOLDS)]
    assert sum(49 - n for n in counts) == 49
    assert sorted(set(counts)) == [43, 44]


@pytest.mark.parametrize("space", dome.SPACES)
def test_a_source_replaces_the_ball(tmp_path: Path, space: str) -> None:
    directions = dome.glossy_ball.lights(12)
    path = written(tmp_path, directions, 8)
    taken = dome.subject(subjects.Setting(source=path), space)
    assert taken.pictures.shape == (12, 8, 8, 3)
    np.testing.assert_allclose(taken.directions, directions, atol=1e-9)
