"""What studies of one knob of an occlusion volume share: subjects, and from where more is in vain.

Errors are those of the study `occlusion_encodings`: the seen share of far round lights at random
places, against rays of the points' own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.studies.answer import Answer, Panel, Row
from pipelines.studies.occlusion_encodings import CITED, DEGREES, PLACES, TALK

BANDS = replace(TALK, encoding="bands", size=512)
UNIT = f"RMS error of the seen share of lights of {DEGREES[CITED]} degrees"
SLACK = 0.1  # of the least error: what is within it is enough


def enough(rows: Sequence[Row], knob: str, encoding: str) -> int:
    """Return the least value of a knob that is within SLACK of the best, on every subject."""
    own = [row for row in rows if row["encoding"] == encoding]
    found = 0
    for subject in dict.fromkeys(str(row["subject"]) for row in own):
        lines = [row for row in own if row["subject"] == subject]
        best = min(float(row["error"]) for row in lines)
        good = [int(r[knob]) for r in lines if float(r["error"]) <= (1 + SLACK) * best]
        found = max(found, min(good))
    return found


def mean_error(rows: Sequence[Row], knob: str, value: int, encoding: str) -> float:
    """Return the error of a setting, the mean over subjects."""
    own = [float(r["error"]) for r in rows if r["encoding"] == encoding and r[knob] == value]
    return float(np.mean(own))


def marked(row: Row, series: str, what: str, default: bool) -> Row:
    """Return a row told as its knob's own, `what` naming it among its subject's."""
    return row | {"series": series, "encoding": series, "setting": what, "default": int(default)}


def by_light(
    rows: Sequence[Row], knob: str, label: str, series: str, title: str, marked: float | None
) -> Panel:
    """Plot one series' error against the knob, a line for each size of light, of one mesh."""
    first = str(rows[0]["subject"])
    own = [r for r in rows if r["subject"] == first and r["encoding"] == series]
    lines = {
        f"{first}, lights of {d} degrees": [
            (float(r[knob]), float(r[f"{PLACES[0]}_{d}"])) for r in own
        ]
        for d in DEGREES
    }
    y = f"RMS error of the seen share ({series})"
    return Panel(label, y, lines, marked, ("log", "log"), title=title)


def answered(question: str, title: str, rows: list[Row], **more: object) -> Answer:
    """Return the answer; more : as of Answer."""
    told = "4,096 Fibonacci rays a point of its own, which the bake does not cast"
    return Answer(question, title, told, rows, UNIT, **more)  # type: ignore[arg-type]
