"""How coarse a slow machine draws, and the history of times."""

from __future__ import annotations

import pytest

from runtime.pace import AIM, COARSEST, Pace
from runtime.pass_history import History


@pytest.mark.parametrize(("full", "expected"), [(0.5, 1), (3.0, 2), (8.0, 3), (1e6, COARSEST)])
def test_it_settles_where_cost_by_pixels_meets_the_aim(full, expected):
    pace = Pace()
    for _ in range(10):
        width, height = pace.size((1200, 600), moving=True)
        pace.took(full * AIM * width * height / (1200 * 600))
    assert pace.factor == expected


def test_what_rests_is_drawn_in_full():
    pace = Pace()
    pace.took(100 * AIM)
    assert pace.size((640, 360), moving=False) == (640, 360)
    assert pace.size((640, 360), moving=True) == (640 // COARSEST, 360 // COARSEST)
    assert pace.size((1, 1), moving=True) == (1, 1)


def test_it_grows_finer_again_a_step_at_a_time():
    pace = Pace()
    pace.took(100 * AIM)
    for expected in range(COARSEST - 1, 0, -1):
        pace.took(0.01)
        assert pace.factor == expected
    pace.took(0.01)
    assert pace.factor == 1


def test_history_takes_only_what_ran():
    history = History(frames=3)
    history.add({"sky": 2.0, "film": 1.0})
    history.add({"sky": 2.0, "film": 1.5}, skipped=("sky",))
    # The same number to the last bit is that of the frame before
    history.add({"sky": 2.0, "film": 1.5, "fog": 4.0})
    assert list(history.frames) == [{"sky": 2.0, "film": 1.0}, {"film": 1.5}, {"fog": 4.0}]
    assert history.names == ["sky", "film", "fog"]
    assert history.last == {"fog": 4.0}
    assert history.usual == 3.0
    assert history.mean()["film"] == pytest.approx(2.5 / 3)


def test_an_empty_history_has_no_times():
    history = History()
    assert (history.usual, history.most, history.last, history.names) == (0.0, 0.0, {}, [])
