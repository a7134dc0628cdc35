"""The matrix of hard cases: its quick cells are met, and a cell that is not met is found out."""

import math
from pathlib import Path

import numpy as np
import pytest

from formats.errors import InputError
from pipelines.hard import cells, matrix, run
from pipelines.hard.cells import Cell, Family, Result, Row, all_of, at_most, equal, noted, refused

ROOT = Path(__file__).resolve().parents[2]
QUICK = matrix.cells(slow=False)


@pytest.mark.parametrize("cell", [c for c in QUICK if not c.card], ids=lambda c: c.name)
def test_hard_case(cell: Cell) -> None:
    found = cells.run(cell).result
    assert found.good, found


@pytest.mark.gpu
@pytest.mark.parametrize("cell", [c for c in QUICK if c.card], ids=lambda c: c.name)
def test_hard_case_on_the_card(cell: Cell) -> None:
    found = cells.run(cell).result
    assert found.good, found


def test_every_row_has_cells_and_there_are_enough_of_them() -> None:
    rows, all_cells = matrix.rows(), matrix.cells()
    assert {c.row.name for c in all_cells} == {r.name for r in rows}
    assert len(rows) == len({r.name for r in rows}) >= 140
    assert len(all_cells) == len({c.name for c in all_cells})
    # Most of the rows of each family of the catalogue
    for letter, least in {"C": 15, "S": 14, "P": 12, "G": 13, "V": 12, "T": 11}.items():
        numbers = {r.name[1:].rstrip("abcd") for r in rows if r.name[0] == letter}
        assert len(numbers) >= least, letter


def test_the_page_lists_what_there_is() -> None:
    text = (ROOT / "docs" / "hard-cases.md").read_text(encoding="utf-8")
    assert text == matrix.described(), "write it again: python -m pipelines.hard.run --describe"


ROW = Row("X1", "tests", "a case", "finite, or refused", "exact")
STRICT = Row("X2", "tests", "a case", "finite", "exact")


def verdict(run: object, row: Row = ROW) -> str:
    return cells.run(Cell(row, "here", run)).result.verdict  # type: ignore[arg-type]


def refuse() -> None:
    raise InputError("a.obj", "faces", 0, "give a mesh with faces")


def test_what_is_not_met_fails() -> None:
    assert verdict(lambda: at_most(1.0, 1.0)) == "ok"
    assert verdict(lambda: at_most(1.1, 1.0)) == "failed"
    assert verdict(lambda: at_most(math.nan, 1.0)) == "failed"
    assert verdict(lambda: equal([1, 2], [1, 3])) == "failed"
    assert verdict(lambda: equal([1, 2], [1, 2, 3])) == "failed"
    assert verdict(lambda: noted(["a gap"], "condition")) == "failed"
    assert verdict(lambda: all_of(at_most(0, 1), at_most(2, 1), at_most(0, 1))) == "failed"
    # Accidents: a traceback, a warning, an overflow
    assert verdict(lambda: at_most(1 / 0, 1)) == "failed"
    assert verdict(lambda: at_most(np.float64(1e300) * np.float64(1e300), 1)) == "failed"
    assert verdict(lambda: at_most(np.mean([]), 1)) == "failed"


def test_a_refusal_is_one_line_where_the_row_allows_it() -> None:
    def lines() -> None:
        raise ValueError("two\nlines")

    assert verdict(lambda: refused(refuse)) == "refused"
    assert verdict(lambda: refused(refuse, "vertices")) == "failed"
    assert verdict(lambda: refused(lambda: None)) == "failed"
    assert verdict(lambda: refused(lines)) == "failed"
    assert verdict(lambda: refused(refuse), STRICT) == "failed"
    assert verdict(lambda: cells.either(lambda: Result(refuse() or "ok"))) == "refused"


def test_the_nearest_to_its_bound_is_told() -> None:
    found = all_of(at_most(1, 10, "a"), at_most(9, 10, "b"), at_most(0, 1))
    assert (found.value, found.bound, found.said) == (9.0, 10.0, "a; b")


def test_rows_are_declared_once() -> None:
    family = Family("tests")
    family.row("X1", "a", "b", "c")
    with pytest.raises(ValueError, match="two rows X1"):
        family.row("X1", "a", "b", "c")


def test_the_table_is_written(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run.main(["--quick", "-o", str(tmp_path), "C8", "F2 exr"]) == 0
    assert "0 failed" in capfd.readouterr().out
    lines = (tmp_path / "table.md").read_text().splitlines()
    # A head of two lines and three cells
    assert len(lines) == 5
    assert '"verdict": "refused"' in (tmp_path / "table.json").read_text()


def test_a_failure_is_an_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    bad = Cell(ROW, "here", lambda: at_most(2, 1))
    monkeypatch.setattr(matrix, "cells", lambda *, slow: (bad,))
    assert run.main(["-o", str(tmp_path)]) == 1
    assert "X1 here" in capfd.readouterr().err
