"""The study of domes: its folds hold out every light once, and its answer is what it measured."""

from pathlib import Path

import numpy as np
import pytest

from maths import hemispherical_harmonics as harmonics
from maths.image_error import psnr
from pipelines.studies import dome, subjects
from tests.bake.domes import written

QUICK = subjects.Setting(quick=True)


def test_a_quick_run_answers() -> None:
    answer = dome.measure(QUICK)
    folds = [r for r in answer.rows if r["measured"] == "held-out fold"]
    stored = [r for r in folds if r["space"] == "stored" and r["channels"] == 16]
    assert len(stored) == 1
    assert answer.figures["stored"]["ours_db"] == stored[0]["ours_db"]
    assert f"{float(stored[0]['ours_db']):.1f} dB stored" in answer.title
    # Measured: ours is 1.4 dB above PTM even on 16 x 16 pixels
    assert float(stored[0]["ours_db"]) > float(stored[0]["ptm_18_db"]) + 0.7
    channels = dict(answer.panels[0].lines["stored"])
    assert list(channels) == list(dome.QUICK)
    # Four channels cost more than sixteen do
    assert channels[4] < channels[16] - 0.5
    assert set(answer.panels[1].lines) >= {"stored, 4 bands", "linear, 7 bands"}
    # A row of the table for each method, count of channels, and pair of weights and bands
    assert len(answer.table) == 2 * (3 + len(dome.QUICK) + 4 + 1)
    assert answer.table[0]["psnr_db"] == answer.figures["stored"]["ours_db"]


def test_table_has_the_best_penalty_of_each_pair_of_knobs() -> None:
    def row(bands: int, penalty: float, exponent: float, error: float) -> dome.Row:
        return {
            "bands": bands,
            "penalty": penalty,
            "weight_exponent": exponent,
            "expected_db": error,
        }

    knobs = [row(4, 0.1, 0.0, 20.0), row(4, 1.0, 0.0, 21.0), row(4, 0.1, 1.0, 19.0)]
    means = {"ours_db": 3.0, "ptm_18_db": 2.0, "hsh_27_db": 1.0}
    table = dome.summary("linear", means, [(8, 30.0)], knobs)
    assert [r["psnr_db"] for r in table] == [3.0, 2.0, 1.0, 30.0, 21.0, 19.0]
    assert table[4]["of"] == "weights 0, 4 bands, penalty 1"


def test_grid_is_the_leave_one_out_error_of_slow_refits() -> None:
    taken = dome.subject(QUICK, "stored")
    row = next(r for r in dome.grid(taken, QUICK) if (r["bands"], r["penalty"]) == (4, 0.1))
    truth = taken.pictures.reshape(49, -1, 3).astype(np.float64)
    errors = []
    for n in range(49):
        rest = np.arange(49) != n
        # The penalty counts a share of all lights: 48 of them weigh as much with 49 / 48 of it
        fit = harmonics.fit_weights(taken.directions[rest], 4, 0.1 * 49 / 48)
        made = harmonics.evaluate(taken.directions[n], 4) @ np.einsum(
            "kn,npc->pkc", fit.matrix, truth[rest]
        )
        errors.append(psnr(np.clip(made, 0, 1), truth[n]))
    # One factorisation against 49: rounding alone
    assert row["expected_db"] == pytest.approx(np.mean(errors), abs=1e-6)


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
