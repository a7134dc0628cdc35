"""The form of studies: intervals by closed forms, fronts, plots by hand, keys of what is kept."""

from pathlib import Path

import numpy as np
import pytest

from pipelines.studies import answer, interval, kept, plots, run, subjects
from pipelines.studies.answer import Answer, Panel, Shot, point
from pipelines.studies.interval import Interval

GREY = np.full((4, 6, 3), 128, np.uint8)


def example(question: str = "packing") -> Answer:
    """An answer of three points of one subject, the second of which nothing should buy."""
    costs = [("a", 1.0, 0.1), ("b", 2.0, 0.2), ("c", 4.0, 0.05)]
    rows = [
        point("oak", name, Interval(e, 0.9 * e, 1.2 * e), bake_seconds=s, default=name == "c")
        for name, s, e in costs
    ]
    shots = {("oak", name): Shot(GREY + np.uint8(i), GREY) for i, (name, *_) in enumerate(costs)}
    lines = {"oak": [(1.0, 1.0), (4.0, 0.5), (16.0, 0.25)]}
    panel = Panel("rays", "error", lines, scales=("log", "log"), slopes=True)
    return Answer(question, "c is best <b>", "a truth", rows, "share", (panel,), shots=shots)


# intervals


@pytest.mark.parametrize("measure", ["rms", "mean", "ratio"])
def test_intervals_hold_the_truth_in_95_of_100_runs(measure: str, rng: np.random.Generator) -> None:
    held = 0
    for _ in range(2000):
        values = rng.gamma(4.0, 0.25, 24)
        if measure == "ratio":
            found = interval.ratio(2 * values * rng.gamma(16.0, 1 / 16, 24), values)
        else:
            found = getattr(interval, measure)(values)
        # The mean of gamma(4, 1/4) is 1, as is its root; the ratio is 2
        held += found.low <= (2.0 if measure == "ratio" else 1.0) <= found.high
    # 95 % of 2,000 within 4 standard deviations of the count, and 1 % for the skewness of 24 values
    assert 0.92 < held / 2000 < 0.97


def test_counts_have_the_interval_of_clopper_and_pearson() -> None:
    none = interval.share(0, 300)
    assert (none.value, none.low) == (0.0, 0.0)
    # 1 - 0.025^(1 / n), the closed form of no hit
    assert none.high == pytest.approx(1 - 0.025 ** (1 / 300), rel=1e-9)
    every = interval.share(5, 5)
    assert (every.low, every.high) == (pytest.approx(0.025 ** (1 / 5)), 1.0)


def test_a_single_value_has_no_spread() -> None:
    found = interval.rms([0.25])
    assert (found.value, found.low, found.high) == (0.5, 0.5, 0.5)
    assert interval.rms([0.0, 0.0]) == Interval(0.0, 0.0, 0.0)


def test_blocks_are_means_of_squares() -> None:
    squares = np.arange(12.0).reshape(3, 4)
    np.testing.assert_allclose(interval.blocks(squares, 2), [2.5, 4.5, 8.5, 10.5])


def test_times_are_the_least_up_to_the_median() -> None:
    assert interval.fastest([3.0, 1.0, 2.0]) == Interval(1.0, 1.0, 2.0)


# rows and fronts


def test_points_have_the_common_columns() -> None:
    row = point("oak", "x", Interval(1.0, 0.5, 2.0), bake_seconds=3.0, bytes=4, default=True, n=5)
    assert set(row) <= {*answer.COMMON, "n"}
    assert (row["error_low"], row["error_high"], row["default"], row["n"]) == (0.5, 2.0, 1, 5)
    # A price that is not known is left out
    assert "frame_ms" not in row
    timed = point("oak", "x", None, frame_ms=Interval(1.0, 1.0, 2.0))
    assert (timed["frame_ms"], timed["frame_ms_high"]) == (1.0, 2.0)


def test_no_point_of_the_front_is_beaten(rng: np.random.Generator) -> None:
    places = [tuple(p) for p in rng.random((60, 2))]
    best = answer.front(places)
    beaten = [any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in places) for p in places]
    assert sorted(best) == [i for i, lost in enumerate(beaten) if not lost]


def test_every_question_says_what_it_takes_and_asks() -> None:
    kinds = {"mesh", *run.KINDS.values()}
    for name in run.QUESTIONS:
        assert set(run.takes(name)) <= kinds, name
        assert run.asked(name).endswith("?"), name
    # Every kind has a study
    assert {kind for name in run.QUESTIONS for kind in run.takes(name)} == kinds


# plots


def priced(default: float, other: float) -> list[answer.Row]:
    """Two points: the default, at its price, with twice the error of the other."""
    return [
        point("a", "own", Interval(2.0, 2.0, 2.0), bake_seconds=default, default=True),
        point("a", "other", Interval(1.0, 1.0, 1.0), bake_seconds=other),
    ]


@pytest.mark.parametrize(
    ("default", "told"),
    [
        (5.0, "0.5 of its seconds to bake"),
        (10.2, "the same seconds to bake"),
        (50.0, "5 times its seconds to bake"),
    ],
)
def test_a_price_is_told_as_a_share_or_as_times(default: float, told: str) -> None:
    found = answer.worth(priced(default, 10.0), "bake_seconds")
    assert found == f"The default has 2.00 times the least error for {told}"


def test_no_error_at_all_is_told_as_that() -> None:
    rows = [point("a", str(n), Interval(0.0, 0.0, 0.1), scale=n) for n in (1, 10)]
    assert answer.trend(rows, "scale", "metres, long") == "No error from 1 to 10: metres"


def test_plots_show_points_bars_front_default_and_slope() -> None:
    drawn = list(plots.inline(example()))
    assert len(drawn) == 2
    priced, panel = drawn
    assert [f'data-point="{i}"' in priced for i in range(4)] == [True, True, True, False]
    assert "the default" in priced
    assert "nothing is better for less" in priced
    assert "slope -0.50" in panel
    # Ink is the page's own, so that it can be dark; names are the plot's own
    assert "#000000" not in priced
    assert 'id="packing-0-' in priced
    assert "http" not in priced + panel


def test_plots_are_the_same_bytes_again(tmp_path: Path) -> None:
    first, again = (plots.draw(example(), tmp_path / name) for name in ("a", "b"))
    assert first[0].read_bytes() == again[0].read_bytes()


# keys


def test_keys_follow_from_code_knobs_and_source(tmp_path: Path) -> None:
    quick, full = subjects.Setting(quick=True), subjects.Setting()
    assert kept.key("packing", quick) == kept.key("packing", subjects.Setting(quick=True))
    keys = {kept.key("packing", s) for s in (quick, full, subjects.Setting(seed=1))}
    mesh = tmp_path / "a.glb"
    for content in (b"one", b"two"):
        mesh.write_bytes(content)
        keys.add(kept.key("packing", subjects.Setting(source=mesh)))
    keys.add(kept.key("harmonics", quick))
    assert len(keys) == 6


def test_photographs_count_with_their_list(tmp_path: Path) -> None:
    (tmp_path / "dirs.lp").write_text("1\na.png 0 0 1\n")
    picture = tmp_path / "a.png"
    found = []
    for content in (b"one", b"two"):
        picture.write_bytes(content)
        found.append(kept.source(tmp_path / "dirs.lp"))
    assert found[0] != found[1]


def test_code_that_plays_counts_with_shaders(monkeypatch: pytest.MonkeyPatch) -> None:
    plays, bakes = "pipelines.studies.shadow_lights", "pipelines.studies.packing"
    before = kept.code(plays), kept.code(bakes)
    monkeypatch.setattr(kept, "player", lambda: "other shaders")
    assert kept.code(plays) != before[0]
    assert kept.code(bakes) == before[1]
