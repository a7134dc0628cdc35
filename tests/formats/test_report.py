"""report.json: the same facts give the same bytes, and only facts that JSON can hold."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats import report, seal
from formats.errors import DamagedError, InputError


def test_numpy_and_tuples_become_plain(tmp_path: Path) -> None:
    data = {
        "b": (1, 2.5, None, True, "ä"),
        "a": {"x": np.float64(0.1), "n": np.int32(7), "yes": np.bool_(True)},
        "c": np.array([[1.0, 2.0], [3.0, 4.0]]),
        "half": np.float16(0.5),
    }
    report.write(tmp_path, data)
    assert report.read(tmp_path) == {
        "a": {"n": 7, "x": 0.1, "yes": True},
        "b": [1, 2.5, None, True, "ä"],
        "c": [[1.0, 2.0], [3.0, 4.0]],
        "half": 0.5,
    }


def test_order_of_keys_does_not_change_a_byte(tmp_path: Path) -> None:
    report.write(tmp_path, {"a": 1, "b": {"c": 2, "d": 3}})
    first = (tmp_path / "report.json").read_bytes()
    report.write(tmp_path, {"b": {"d": 3, "c": 2}, "a": 1})
    assert (tmp_path / "report.json").read_bytes() == first


@pytest.mark.parametrize(
    ("data", "where"),
    [
        ({"a": {"b": [1.0, float("nan")]}}, r"a\.b\[1\]"),
        ({"a": np.float32(np.inf)}, "a"),
        ({"a": np.array([1.0, -np.inf])}, r"a\[1\]"),
        ({"a": {1: 2}}, "a"),
        ({"a": Path("x")}, "a"),
        ({"a": {1, 2}}, "a"),
        ({"a": 1j}, "a"),
        ([1], "report"),
    ],
)
def test_unfit_entries_are_named(data: Any, where: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"report\.json: {where}: "):
        report.write(tmp_path, data)
    assert not list(tmp_path.iterdir())


def test_runaway_nesting_is_refused(tmp_path: Path) -> None:
    data: dict[str, Any] = {}
    data["a"] = data
    with pytest.raises(InputError, match="too deep"):
        report.write(tmp_path, data)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"a": NaN}', '{"a": 1e999}', '{"a": 1, "a": 2}', "\xff", "[" * 100_000]
)
def test_broken_reports_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "report.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=r"report\.json"):
        report.read(tmp_path)


def test_huge_integers_are_refused(tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text('{"a": ' + "9" * 5000 + "}")
    with pytest.raises(InputError):
        report.read(tmp_path)


def test_sealed_reports_are_verified(tmp_path: Path) -> None:
    report.write(tmp_path, {"a": 1})
    seal.seal(tmp_path)
    assert report.read(tmp_path) == {"a": 1}
    path = tmp_path / "report.json"
    path.write_bytes(path.read_bytes().replace(b"1", b"2"))
    with pytest.raises(DamagedError):
        report.read(tmp_path)


def test_whatever_a_report_says_ends_in_one_typed_error(tmp_path: Path) -> None:
    @dataclass
    class Thing:
        size: float

        @classmethod
        @report.understood
        def load(cls, folder: Path) -> "Thing":
            return cls(report.read(folder)["size"] * 2.0)

    report.write(tmp_path, {"size": 3})
    assert Thing.load(tmp_path).size == 6
    for broken in ({}, {"size": "far"}, {"size": [1]}, {"size": 1e308}):
        report.write(tmp_path, broken)
        with pytest.raises(DamagedError, match="entries") as refusal:
            Thing.load(tmp_path)
        assert "\n" not in str(refusal.value)
