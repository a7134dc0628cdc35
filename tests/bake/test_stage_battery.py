"""The battery lets good stages pass and catches each kind of bad one."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from formats import report
from formats.errors import BakelightError, InputError
from tests.bake import stage_battery

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Cloud:
    """Points (n, 3) in float64 and the index (n,) of each one's neighbour."""

    points: NDArray[np.float64]
    neighbours: NDArray[np.int64]
    title: str = "cloud"


@dataclass(frozen=True)
class Lengths:
    values: NDArray[np.float64]

    def save(self, folder: Path) -> None:
        np.save(folder / "lengths.npy", self.values)
        report.write(folder, {"count": len(self.values)})

    @classmethod
    def load(cls, folder: Path) -> "Lengths":
        return cls(np.load(folder / "lengths.npy"))


CLOUD = Cloud(np.arange(12.0).reshape(4, 3) / 7, np.array([1, 2, 3, 0]))
CASES = stage_battery.cases(CLOUD)


def refuse(field: str, remedy: str) -> InputError:
    return InputError("cloud", field, "cannot be used", remedy)


def good(cloud: Cloud, *, params: Any, progress: Progress) -> Lengths:
    """Distance of each point to its neighbour, with all the checks that takes."""
    points, neighbours = cloud.points, cloud.neighbours
    if points.dtype.kind != "f" or points.ndim != 2 or points.shape[1] != 3:
        raise refuse("points", "give (n, 3) floats")
    if not np.isfinite(points).all() or np.abs(points).max(initial=0) > 1e100:
        raise refuse("points", "give finite numbers below 1e100")
    if neighbours.dtype.kind != "i" or neighbours.shape != points.shape[:1]:
        raise refuse("neighbours", "give an index for each point")
    if ((neighbours < 0) | (neighbours >= len(points))).any():
        raise refuse("neighbours", "give indices of points")
    return Lengths(np.linalg.norm(points - points[neighbours], axis=1).astype(np.float64))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_good_stage_passes(case: stage_battery.Case, tmp_path: Path) -> None:
    stage_battery.check(case, good, (CLOUD,), None, tmp_path)


def outcome(
    stage: Callable[..., Any], field: str, name: str, folder: Path
) -> BakelightError | None:
    (case,) = (case for case in CASES if (case.field, case.name) == (field, name))
    return stage_battery.check(case, stage, (CLOUD,), None, folder)


def test_outcomes_are_told(tmp_path: Path) -> None:
    assert outcome(good, "points", "offset 1e12", tmp_path) is None
    error = outcome(good, "points", "one NaN", tmp_path)
    assert error is not None
    assert error.exit_code == 2


def test_every_array_and_only_arrays_are_spoilt() -> None:
    assert {case.field for case in CASES} == {"points", "neighbours"}
    assert {case.field for case in stage_battery.cases(CLOUD, but=["points"])} == {"neighbours"}
    assert {case.field for case in stage_battery.cases(CLOUD.points)} == {""}
    with pytest.raises(ValueError, match="no array"):
        stage_battery.cases("text")


@pytest.mark.parametrize("case", CASES, ids=str)
def test_cases_are_what_they_say(case: stage_battery.Case) -> None:
    array = getattr(CLOUD, case.field)
    spoilt = case.spoil(array)
    if case.keeps_values:
        np.testing.assert_array_equal(spoilt, array)
        same_layout = spoilt.strides == array.strides and spoilt.flags.writeable
        one_axis = case.name == "Fortran order" and array.ndim == 1
        assert not same_layout or one_axis or spoilt.dtype != array.dtype
    else:
        same = spoilt.shape == array.shape and spoilt.dtype == array.dtype
        flat_already = case.name == "flat" and array.ndim == 1
        assert not same or flat_already or not np.array_equal(spoilt, array)


def leaks_nan(cloud: Cloud, *, params: Any, progress: Progress) -> Lengths:
    return Lengths(np.abs(cloud.points[:, 0]))


def reports_nan(cloud: Cloud, *, params: Any, progress: Progress) -> Lengths:
    class Bad(Lengths):
        def save(self, folder: Path) -> None:
            super().save(folder)
            (folder / "report.json").write_text('{"deep": [{"error": NaN}]}')

    return Bad(np.zeros(3))


def loads_infinity(cloud: Cloud, *, params: Any, progress: Progress) -> Lengths:
    class Bad(Lengths):
        @classmethod
        def load(cls, folder: Path) -> Lengths:
            return Lengths(np.array([np.inf]))

    return Bad(np.zeros(3))


def untyped(cloud: Cloud, *, params: Any, progress: Progress) -> Lengths:
    raise ValueError("points are bad")


def writes_to_input(cloud: Cloud, *, params: Any, progress: Progress) -> Lengths:
    cloud.neighbours[0] = 2
    return Lengths(np.zeros(3))


def minds_layout(cloud: Cloud, *, params: Any, progress: Progress) -> Lengths:
    return Lengths(np.zeros(3) + cloud.points.flags.c_contiguous)


def refuses_read_only(cloud: Cloud, *, params: Any, progress: Progress) -> Lengths:
    if not cloud.points.flags.writeable:
        raise refuse("points", "give a writable array")
    return Lengths(np.zeros(3))


CAUGHT = [
    (leaks_nan, "one NaN", AssertionError, r"asset\.values is not finite"),
    (reports_nan, "one NaN", AssertionError, r"report\.json\.deep\[0\]\.error is not finite"),
    (loads_infinity, "one NaN", AssertionError, r"loaded asset\.values"),
    (untyped, "one NaN", ValueError, "points are bad"),
    (writes_to_input, "one NaN", AssertionError, "changes no input"),
    (minds_layout, "non-contiguous", AssertionError, "the same values"),
    (refuses_read_only, "read-only", AssertionError, "as good as before"),
]


@pytest.mark.parametrize(("stage", "name", "error", "match"), CAUGHT)
def test_bad_stages_are_caught(
    stage: Callable[..., Any], name: str, error: type[Exception], match: str, tmp_path: Path
) -> None:
    neighbours = CLOUD.neighbours.copy()
    cloud = dataclasses.replace(CLOUD, neighbours=neighbours)
    (case,) = (c for c in CASES if (c.field, c.name) == ("points", name))
    with pytest.raises(error, match=match):
        stage_battery.check(case, stage, (cloud,), None, tmp_path)
