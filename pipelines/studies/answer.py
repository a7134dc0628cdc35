"""The answer to one question: rows, a title that says it, a plot; and how it is written down."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bake import machine, workers
from pipelines.studies.subjects import Setting

# Okabe and Ito 2008, Color Universal Design: told apart by every kind of colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
LIBRARIES = ("embreex", "numpy", "scipy", "trimesh")

Row = dict[str, float | int | str]


@dataclass(frozen=True)
class Panel:
    """One set of axes. lines : name -> points (x, y). marked : x of the default, or None.
    scales : "log" or "linear" for x and y. ticks : labels of x, where x counts 0, 1, 2, ...
    joined : draw lines between the points."""

    x: str
    y: str
    lines: Mapping[str, Sequence[tuple[float, float]]]
    marked: float | None = None
    scales: tuple[str, str] = ("log", "linear")
    ticks: Sequence[str] = ()
    joined: bool = True


@dataclass(frozen=True)
class Answer:
    """What a study found.

    title : the answer, a sentence. truth : what it was measured against. rows : all measurements.
    table : those worth printing, by default all. figures : numbers that are cited. pictures : name
    -> (h, w, 3) uint8.
    """

    question: str
    title: str
    truth: str
    rows: Sequence[Row]
    panels: Sequence[Panel]
    table: Sequence[Row] = ()
    figures: dict[str, Any] = field(default_factory=dict)
    pictures: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)


def write(answer: Answer, out: Path, setting: Setting, seconds: float) -> list[Path]:
    """Write <question>.csv, .json, .svg, .png and <question>-<picture>.png into a folder.

    Returns their paths, in this order.
    """
    out.mkdir(parents=True, exist_ok=True)
    stem = out / answer.question
    columns = list(dict.fromkeys(name for row in answer.rows for name in row))
    with open(stem.with_suffix(".csv"), "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(answer.rows)
    data = {
        "question": answer.question,
        "answer": answer.title,
        "truth": answer.truth,
        "figures": answer.figures,
        "quick": setting.quick,
        "source": None if setting.source is None else setting.source.name,
        "seed": setting.seed,
        "seconds": round(seconds, 2),
        **environment(),
        "rows": list(answer.rows),
    }
    text = json.dumps(data, indent=1, allow_nan=False)
    stem.with_suffix(".json").write_text(text + "\n", encoding="utf-8")
    files = [stem.with_suffix(s) for s in (".csv", ".json")] + draw(answer, stem)
    for name, picture in answer.pictures.items():
        files.append(out / f"{answer.question}-{name}.png")
        Image.fromarray(picture).save(files[-1])
    return files


def environment() -> dict[str, Any]:
    """Return the machine and the versions that a measurement holds for."""
    return {
        "machine": machine.name(),
        "cores": os.cpu_count(),
        "threads": workers.count(),
        "versions": machine.versions(LIBRARIES),
    }


def draw(answer: Answer, stem: Path) -> list[Path]:
    """Plot the panels side by side, as SVG and PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    # Text stays text, and the same measurements give the same file
    matplotlib.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": answer.question, "font.size": 9}
    figure, axes = pyplot.subplots(
        1, len(answer.panels), figsize=(5.2 * len(answer.panels), 4), squeeze=False
    )
    for one, panel in zip(axes[0], answer.panels, strict=True):
        _panel(one, panel)
    figure.suptitle(answer.title, fontsize=10, wrap=True)
    figure.tight_layout()
    files = [stem.with_suffix(".svg"), stem.with_suffix(".png")]
    figure.savefig(files[0], metadata={"Date": None})
    figure.savefig(files[1], dpi=150)
    pyplot.close(figure)
    return files


def _panel(axes: Any, panel: Panel) -> None:
    for i, (name, points) in enumerate(panel.lines.items()):
        style = {"color": COLOURS[i % len(COLOURS)], "marker": MARKERS[i % len(MARKERS)]}
        style["linestyle"] = "-" if panel.joined else "none"
        axes.plot(*zip(*points, strict=True), label=name, markersize=4, linewidth=1.2, **style)
    if panel.marked is not None:
        axes.axvline(panel.marked, color="0.4", linestyle=":", linewidth=1, label="default")
    axes.set(xlabel=panel.x, ylabel=panel.y, xscale=panel.scales[0], yscale=panel.scales[1])
    _label(axes, panel)
    axes.grid(alpha=0.3)
    if len(panel.lines) > 1 or panel.marked is not None:
        axes.legend(fontsize=7)


def _label(axes: Any, panel: Panel) -> None:
    """Name the very points on x where they are few, and plain numbers on a short logarithmic y."""
    from matplotlib.ticker import LogFormatter, NullLocator

    every = sorted({x for points in panel.lines.values() for x, _ in points})
    if panel.ticks:
        axes.set_xticks(range(len(panel.ticks)), panel.ticks)
    elif panel.scales[0] == "log" and len(every) <= 14:
        axes.set_xticks(every, [f"{x:g}" for x in every])
        axes.xaxis.set_minor_locator(NullLocator())
    if panel.scales[1] == "log":
        axes.yaxis.set_major_formatter(LogFormatter())
        axes.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))
