"""The one form of a study's answer: points with an error and its interval, prices, pictures.

A point is a row with the columns of COMMON. `error` stands in the unit that the study names, and
`error_low`, `error_high` are its 95 % interval; prices that a study does not know are left out.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import machine, workers
from pipelines.studies.interval import Interval

COMMON = (
    "subject", "series", "setting", "error", "error_low", "error_high", "bake_seconds", "frame_ms",
    "bytes", "default",
)  # fmt: skip
PRICES = {
    "bake_seconds": "processor seconds to bake",
    "frame_ms": "processor milliseconds a frame",
    "bytes": "bytes on the card",
}

LIBRARIES = ("embreex", "numpy", "scipy", "trimesh", "moderngl")

Row = dict[str, float | int | str]
Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Panel:
    """One set of axes. lines : name -> points (x, y). marked : x of the default, or None.
    scales : "log" or "linear" for x and y. ticks : labels of x, where x counts 0, 1, 2, ...
    joined : draw lines between the points. slopes : tell the exponent of each line, by least
    squares of logarithms. title : what this plot answers."""

    x: str
    y: str
    lines: Mapping[str, Sequence[tuple[float, float]]]
    marked: float | None = None
    scales: tuple[str, str] = ("log", "linear")
    ticks: Sequence[str] = ()
    joined: bool = True
    slopes: bool = False
    title: str = ""


@dataclass(frozen=True, eq=False)
class Shot:
    """What a point looks like, (h, w, 3) as a screen shows it, and what it should look like."""

    picture: Picture
    truth: Picture | None = None


@dataclass(frozen=True)
class Answer:
    """What a study found.

    title : the answer, a sentence. truth : what it was measured against. rows : all measurements;
    those with COMMON's columns are points. unit : what `error` is, with its unit. axes : columns
    that points are drawn against, with their labels. measure : the column drawn there, as a rule
    the error. titles : column -> what the plot against it answers. shots : (subject, setting) ->
    what that point looks like. panels : further plots. table : rows worth printing, by default all.
    figures : numbers that are cited. pictures : name -> (h, w, 3) uint8. decibels : show -20
    log10(error) beside the error.
    """

    question: str
    title: str
    truth: str
    rows: Sequence[Row]
    unit: str
    panels: Sequence[Panel] = ()
    axes: Mapping[str, str] = field(default_factory=lambda: PRICES)
    measure: str = "error"
    titles: Mapping[str, str] = field(default_factory=dict)
    shots: Mapping[tuple[str, str], Shot] = field(default_factory=dict)
    table: Sequence[Row] = ()
    figures: dict[str, Any] = field(default_factory=dict)
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    decibels: bool = False

    @property
    def points(self) -> list[Row]:
        """The rows that plots and pages show."""
        return [row for row in self.rows if "setting" in row and self.measure in row]

    def columns(self) -> list[str]:
        """Return the columns that points are drawn against: those with at least two values."""
        found = []
        for name in self.axes:
            values = {row[name] for row in self.points if name in row}
            if len(values) > 1:
                found.append(name)
        return found


def point(
    subject: str,
    setting: str,
    error: Interval | None,
    *,
    series: str = "",
    bake_seconds: float | None = None,
    frame_ms: Interval | float | None = None,
    bytes: int | None = None,
    default: bool = False,
    **more: float | int | str,
) -> Row:
    """Return one measurement in the common form; `setting` is told apart within its subject.

    series : points of one colour, by default the subject. more : further columns.
    """
    row: Row = {"subject": subject, "series": series or subject, "setting": setting}
    if error is not None:
        row |= {"error": error.value, "error_low": error.low, "error_high": error.high}
    if bake_seconds is not None:
        row["bake_seconds"] = bake_seconds
    if isinstance(frame_ms, Interval):
        row |= {"frame_ms": frame_ms.value, "frame_ms_low": frame_ms.low}
        row["frame_ms_high"] = frame_ms.high
    elif frame_ms is not None:
        row["frame_ms"] = frame_ms
    if bytes is not None:
        row["bytes"] = bytes
    return row | {"default": int(default)} | more


def environment() -> dict[str, Any]:
    """Return the machine and the versions that a measurement holds for, and how busy it is."""
    return {
        "machine": machine.name(),
        "cores": os.cpu_count(),
        "threads": workers.count(),
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        "versions": machine.versions(LIBRARIES),
    }


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return which points (price, error) no other beats in both, by rising price.

    >>> front([(1, 5), (2, 6), (3, 2), (3, 4)])
    [0, 2]
    """
    best, found = np.inf, []
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if points[i][1] < best:
            best = points[i][1]
            found.append(i)
    return found


def worth(points: Sequence[Row], column: str) -> str:
    """Say what the points answer of a price: where the default stands, or how many are worth it.

    Subjects are compared each with itself; what is told is the middle one.
    """
    shares, least = [], []
    for subject in dict.fromkeys(str(row["subject"]) for row in points):
        own = [r for r in points if r["subject"] == subject and column in r and "error" in r]
        for row in (r for r in own if r["default"]):
            best = min(own, key=lambda r: (float(r["error"]), float(r[column])))
            least.append(float(row["error"]) / max(float(best["error"]), 1e-300))
            shares.append(float(row[column]) / max(float(best[column]), 1e-300))
    name = {"bake_seconds": "seconds to bake", "frame_ms": "time a frame"}.get(column, column)
    if shares:
        times, share = float(np.median(least)), float(np.median(shares))
        if times < 1.005:
            return "The default has the least error here"
        of = f"{share:.2g} of its" if share < 0.95 else f"{share:.2g} times its"
        of = "the same" if 0.95 <= share < 1.05 else of
        return f"The default has {times:.2f} times the least error for {of} {name}"
    places = [(float(r[column]), float(r["error"])) for r in points if column in r and "error" in r]
    return f"{len(front(places))} of {len(places)} are worth their {name}"


def trend(points: Sequence[Row], column: str, label: str) -> str:
    """Say what becomes of the error from the least to the largest value of a column: the middle
    one of all series of all subjects."""
    shares, ends = [], []
    own = [row for row in points if column in row and "error" in row]
    if own and not any(float(row["error"]) for row in own):
        least, most = (f(float(row[column]) for row in own) for f in (min, max))
        return f"No error from {_plain(least)} to {_plain(most)}: {label.split(',')[0]}"
    for group in dict.fromkeys((r["subject"], r["series"]) for r in points):
        own = [r for r in points if (r["subject"], r["series"]) == group and column in r]
        own = sorted((r for r in own if "error" in r), key=lambda r: float(r[column]))
        if len(own) > 1 and float(own[-1]["error"]) > 0:
            shares.append(float(own[0]["error"]) / float(own[-1]["error"]))
            ends += [float(own[0][column]), float(own[-1][column])]
    if not shares:
        return ""
    share = float(np.median(shares))
    how = f"falls {share:.2g} times" if share >= 1 else f"grows {1 / share:.2g} times"
    if abs(share - 1) < 0.05:
        how = "stays"
    first, last = _plain(min(ends)), _plain(max(ends))
    return f"From {first} to {last} {label.split(',')[0]} the error {how}"


def _plain(value: float) -> str:
    """Write a number of a sentence.

    >>> _plain(74680.0), _plain(1024), _plain(1.5), _plain(1e-06)
    ('74,680', '1,024', '1.5', '1e-06')
    """
    return f"{value:,.0f}" if 1000 <= abs(value) < 1e9 else f"{value:.4g}"


def lines_of(
    rows: Sequence[Row], x: str, y: str, *names: str
) -> dict[str, list[tuple[float, float]]]:
    """Return a panel's lines: the rows that have both columns, a line for each value of `names`."""
    lines: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if x in row and y in row:
            name = ", ".join(str(row[n]) for n in names)
            lines.setdefault(name, []).append((float(row[x]), float(row[y])))
    return lines


def slope_of(points: Sequence[tuple[float, float]]) -> float:
    """Return the exponent of y over x, by least squares of logarithms.

    >>> round(slope_of([(1, 8), (4, 4), (16, 2)]), 6)
    -0.5
    """
    x, y = np.log(np.asarray(points, np.float64)).T
    return float(np.polyfit(x, y, 1)[0])
