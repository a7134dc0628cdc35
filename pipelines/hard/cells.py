"""The matrix of hard cases as data: rows say what must happen, cells run the real code.

A row is a case and the behaviour that is required of it. A cell is that row at one stage, codec or
part of the player: a function that builds the hard input, seeded and tiny, runs what a user would
run, and returns a measured value beside its bound, or the line that it was refused with.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from formats.errors import BakelightError

Verdict = Literal["ok", "refused", "failed", "skipped"]


@dataclass(frozen=True)
class Row:
    """A hard case. behaviour : what must happen. truth : where the bound comes from."""

    name: str
    family: str
    case: str
    behaviour: str
    truth: str


@dataclass(frozen=True)
class Result:
    """What a cell found. value, bound : measured and allowed. said : a refusal, note or reason."""

    verdict: Verdict
    value: float | None = None
    bound: float | None = None
    said: str = ""

    @property
    def good(self) -> bool:
        """Whether the case was met as its row requires."""
        return self.verdict != "failed"


@dataclass(frozen=True)
class Cell:
    """A row at one stage. slow : left to `make hard`. card : needs an OpenGL context."""

    row: Row
    stage: str
    run: Callable[..., Result]
    slow: bool = False
    card: bool = False

    @property
    def name(self) -> str:
        """Row and stage, as tests and tables show them."""
        return f"{self.row.name} {self.stage}"


@dataclass
class Family:
    """Rows and cells of one kind, in the order in which they are declared."""

    name: str
    rows: dict[str, Row] = field(default_factory=dict)
    cells: list[Cell] = field(default_factory=list)

    def row(self, name: str, case: str, behaviour: str, truth: str) -> None:
        """Declare a row."""
        if name in self.rows:
            raise ValueError(f"There are two rows {name}.")
        self.rows[name] = Row(name, self.name, case, behaviour, truth)

    def add(self, name: str, stage: str, run: Callable[..., Result], **kind: bool) -> None:
        """Declare a cell of a row."""
        self.cells.append(Cell(self.rows[name], stage, run, **kind))

    def cell(
        self, name: str, stage: str, **kind: bool
    ) -> Callable[[Callable[[], Result]], Callable[[], Result]]:
        """Declare the decorated function as a cell of a row."""

        def declare(run: Callable[[], Result]) -> Callable[[], Result]:
            self.add(name, stage, run, **kind)
            return run

        return declare


def at_most(value: Any, bound: Any, why: str = "") -> Result:
    """A value that may not pass a bound; NaN passes none."""
    found = float(value)
    return Result("ok" if found <= bound else "failed", found, float(bound), why)


def equal(found: Any, expected: Any, why: str = "") -> Result:
    """Values that must agree in every bit, with one or as many; the value is how many do not."""
    a, b = np.asarray(found), np.asarray(expected)
    alike = a.shape == b.shape or not b.shape
    different = np.count_nonzero(a != b) if alike else max(a.size, b.size, 1)
    return at_most(different, 0, why)


def noted(texts: Iterable[object], words: str) -> Result:
    """A note, warning or report that must say something."""
    found = [str(text) for text in texts]
    for text in found:
        if words in text:
            return Result("ok", said=text)
    return Result("failed", said=f"nothing says '{words}': {found}")


def refused(call: Callable[..., object], words: str = "") -> Result:
    """A call that must end in one typed line with a remedy, or, inside, in a ValueError that says
    what is wrong."""
    try:
        call()
    except BakelightError as error:
        line = str(error)
        fair = "\n" not in line and " -- " in line
    except ValueError as error:
        line = str(error)
        fair = "\n" not in line and " " in line
    else:
        return Result("failed", said="it was not refused")
    return Result("refused" if fair and words in line else "failed", said=line)


def either(call: Callable[[], Result]) -> Result:
    """A call that must end in a sound result or in one typed line."""
    try:
        return call()
    except BakelightError as error:
        return _told(error)


def _told(error: BakelightError) -> Result:
    line = str(error)
    fair = "\n" not in line and " -- " in line
    return Result("refused" if fair else "failed", said=line)


def all_of(*results: Result) -> Result:
    """Several findings of one cell: the first that failed, else the one nearest to its bound."""
    for result in results:
        if not result.good:
            return result
    measured = [r for r in results if r.bound]
    said = "; ".join(r.said for r in results if r.said)
    if not measured:
        return Result(results[0].verdict, results[0].value, results[0].bound, said)
    worst = max(measured, key=lambda r: (r.value or 0.0) / (r.bound or 1.0))
    return Result("ok", worst.value, worst.bound, said)


def not_applicable(why: str) -> Result:
    """A case that cannot arise here, and why."""
    return Result("skipped", said=why)


@dataclass(frozen=True)
class Outcome:
    """A cell that was run."""

    cell: Cell
    result: Result
    seconds: float

    def as_json(self) -> dict[str, Any]:
        """Return what the table's JSON has of it."""
        row, found = self.cell.row, self.result
        return {
            "row": row.name, "family": row.family, "case": row.case, "stage": self.cell.stage,
            "verdict": found.verdict, "value": _json(found.value), "bound": _json(found.bound),
            "said": found.said, "seconds": round(self.seconds, 4),
        }  # fmt: skip


def run(cell: Cell) -> Outcome:
    """Run a cell: numerical accidents and warnings count as failures, as does any exception."""
    start = time.perf_counter()
    try:
        with np.errstate(all="raise", under="ignore"), warnings.catch_warnings():
            warnings.simplefilter("error")
            result = cell.run()
        if result.verdict == "refused" and "refused" not in cell.row.behaviour:
            result = Result("failed", said=f"the row wants no refusal: {result.said}")
    except Exception as error:
        line = " ".join(f"{type(error).__name__}: {error}".split())
        result = Result("failed", said=line[:300])
    return Outcome(cell, result, time.perf_counter() - start)


def _json(value: float | None) -> float | None:
    return value if value is None or np.isfinite(value) else None
