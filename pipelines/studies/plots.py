"""Plots of an answer: prices on logarithmic axes, intervals, the Pareto front, the default marked.

Colours are told apart by every kind of colour vision, and a marker's shape says the same again.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.studies.answer import PRICES, Answer, Panel, Row, front, slope_of, trend, worth

# Okabe and Ito 2008, Color Universal Design
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#A89B00")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "p")
POINT = "point-"
WIDE, HIGH = 3.7, 2.7  # inches, of axes
NARROW = 2.9  # inches, of axes on a page: shown as wide as a phone, their text is still read
SIDES = 0.9, 0.7  # inches beside them
TURNED = 0.55  # inches more below them, for names that are turned
LEAST_RANGE = 2.0  # of a price, largest over smallest
MOST_NAMED = 24  # entries of a legend
INK = "#000000"
FRONT: dict[str, Any] = {"color": "0.55", "linestyle": "--", "linewidth": 1}
ANGLES = ("elevation",)  # columns that no logarithm suits


def draw(answer: Answer, stem: Path) -> list[Path]:
    """Plot all panels side by side, as SVG and PNG; return their paths."""
    pyplot = _pyplot(answer.question)
    every = plotted(answer)
    columns = min(3, len(every))
    figure = pyplot.figure()
    rooms: list[tuple[Any, tuple[float, float]]] = []
    for what in every:
        axes = figure.add_axes((0, 0, 1, 1), label=str(len(rooms)))
        _draw(axes, answer, what)
        rooms.append((axes, _room(axes)))
    title = _wrapped(answer.title, 32 * columns)
    head = 0.3 + 0.17 * (title.count("\n") + 1)
    lines = [rooms[a : a + columns] for a in range(0, len(rooms), columns)]
    heights = [HIGH + max(r[0] for _, r in line) + max(r[1] for _, r in line) for line in lines]
    size = columns * (WIDE + SIDES[0] + SIDES[1]), head + sum(heights)
    figure.set_size_inches(size)
    top = size[1] - head
    for line, height in zip(lines, heights, strict=True):
        above = max(room[1] for _, room in line)
        for column, (axes, _) in enumerate(line):
            left = column * (WIDE + SIDES[0] + SIDES[1]) + SIDES[0]
            box = left / size[0], (top - above - HIGH) / size[1], WIDE / size[0], HIGH / size[1]
            axes.set_position(box)
            for twin in axes._twinned_axes.get_siblings(axes):
                twin.set_position(box)
        top -= height
    figure.suptitle(title, fontsize=10, y=1 - 0.12 / size[1], va="top")
    files = [stem.with_suffix(".svg"), stem.with_suffix(".png")]
    figure.savefig(files[0], metadata={"Date": None})
    figure.savefig(files[1], dpi=110)
    pyplot.close(figure)
    files[0].write_text(_lean(files[0].read_text(encoding="utf-8")), encoding="utf-8")
    return files


def inline(answer: Answer) -> Iterator[str]:
    """Give each of what is plotted as SVG for a page, in the page's own ink, without its title.

    Points that can be chosen have the class `point` and, as `data-point`, their place in
    `answer.points`."""
    pyplot = _pyplot(answer.question)
    for number, what in enumerate(plotted(answer)):
        figure = pyplot.figure()
        axes = figure.add_axes((0, 0, 1, 1))
        _draw(axes, answer, what, titled=False)
        below, above = _room(axes)
        size = NARROW + SIDES[0] + SIDES[1], HIGH + below + above
        figure.set_size_inches(size)
        for one in figure.axes:
            sides = SIDES[0] / size[0], below / size[1]
            one.set_position((*sides, NARROW / size[0], HIGH / size[1]))
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
        pyplot.close(figure)
        yield _for_page(_lean(buffer.getvalue()), f"{answer.question}-{number}-")


def plotted(answer: Answer) -> list[str | Panel]:
    """Return what is drawn, in order: columns that points are drawn against, and panels."""
    return [*answer.columns(), *answer.panels]


def _room(axes: Any) -> tuple[float, float]:
    """Return the inches that legend and title take below and above: what a layout would find by
    drawing everything once more."""
    legend = axes.get_legend()
    rows = -(-len(legend.get_texts()) // legend._ncols) if legend else 0
    title = axes.get_title(loc="left")
    above = 0.12 if not title else 0.2 + 0.145 * (title.count("\n") + 1)
    return 0.6 + 0.16 * rows + (TURNED if _turned(axes) else 0.0), above


def _turned(axes: Any) -> bool:
    """Say whether the names below an axis are turned."""
    return any(label.get_rotation() for label in axes.get_xticklabels())


def _pyplot(question: str) -> Any:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    # Text stays text, and the same measurements give the same file
    matplotlib.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": question, "font.size": 9}
    matplotlib.rcParams |= {"axes.spines.top": False, "axes.spines.right": False}
    return pyplot


def _draw(axes: Any, answer: Answer, what: str | Panel, *, titled: bool = True) -> None:
    if isinstance(what, Panel):
        _panel(axes, what)
    else:
        _priced(axes, answer, what)
    axes.grid(alpha=0.25, linewidth=0.6)
    told = title_of(answer, what)
    if told and titled:
        axes.set_title(_wrapped(told, 62), fontsize=8.5, loc="left")


def title_of(answer: Answer, what: str | Panel) -> str:
    """Return what one plot answers: its own title, or what its points say of a price."""
    if isinstance(what, Panel):
        return what.title
    if what in answer.titles:
        return answer.titles[what]
    if answer.measure != "error":
        return ""
    if what in PRICES:
        return worth(answer.points, what)
    return trend(answer.points, what, answer.axes[what])


def _priced(axes: Any, answer: Answer, column: str) -> None:
    """Draw the error of every point against one price, or another number."""
    y = answer.measure
    places = [(i, row) for i, row in enumerate(answer.points) if column in row]
    series = list(dict.fromkeys(str(r["series"]) for r in answer.points))
    subjects = list(dict.fromkeys(str(r["subject"]) for r in answer.points))
    # Colour tells the series; shape the subject, or the series again
    several = len(subjects) > 1 and series != subjects
    for i, row in places:
        number = series.index(str(row["series"]))
        kind = subjects.index(str(row["subject"])) if several else number
        _point(axes, answer, column, i, number, kind)
    for number, name in enumerate(series[:MOST_NAMED]):
        marker = "s" if several else MARKERS[number % len(MARKERS)]
        axes.plot([], [], marker, color=COLOURS[number % len(COLOURS)], ms=5, label=name)
    for kind, name in enumerate(subjects if several else ()):
        axes.plot([], [], MARKERS[kind % len(MARKERS)], color="0.5", ms=5, label=name)
    axes.set_xlabel(answer.axes[column])
    axes.set_ylabel(_wrapped(answer.unit, 40))
    prices, values = ([float(r[n]) for _, r in places] for n in (column, y))
    axes.set_xscale("log" if min(prices) > 0 and column not in ANGLES else "linear")
    axes.set_yscale("log" if min(values) > 0 else "linear")
    if axes.get_xscale() == "log" and max(prices) < LEAST_RANGE * min(prices):
        # What hardly differs should look so
        middle, half = (max(prices) * min(prices)) ** 0.5, (1.2 * LEAST_RANGE) ** 0.5
        axes.set_xlim(middle / half, middle * half)
    if column in PRICES and y == "error":
        for subject in subjects:
            _front(axes, [r for _, r in places if r["subject"] == subject], column)
        axes.plot([], [], **FRONT, label="nothing is better for less")
    if any(r["default"] for _, r in places):
        axes.plot([], [], "o", mfc="none", mec=INK, ms=9, mew=1.1, label="the default")
    _ticks(axes)
    _decibels(axes, answer)
    _legend(axes)


def _point(axes: Any, answer: Answer, column: str, i: int, number: int, kind: int) -> None:
    """Draw one point with its interval, a ring about it where it is the default."""
    row, y, colour = answer.points[i], answer.measure, COLOURS[number % len(COLOURS)]
    at, value = float(row[column]), float(row[y])
    if f"{y}_low" in row:
        low, high = float(row[f"{y}_low"]), float(row[f"{y}_high"])
        spread = [[max(0.0, value - low)], [max(0.0, high - value)]]
        axes.errorbar(at, value, spread, fmt="none", ecolor=colour, elinewidth=1, alpha=0.55)
    marker = MARKERS[kind % len(MARKERS)]
    # A line of one point is a group of its own in the file
    (dot,) = axes.plot(at, value, marker, color=colour, ms=5)
    dot.set_gid(f"{POINT}{i}")
    if row["default"]:
        axes.plot(at, value, "o", mfc="none", mec=INK, ms=11, mew=1.1, zorder=1)


def _front(axes: Any, rows: Sequence[Row], column: str) -> None:
    """Draw the Pareto front of one subject."""
    places = [(float(r[column]), float(r["error"])) for r in rows]
    best = front(places)
    if len(best) > 1:
        steps = np.array([places[i] for i in best])
        axes.plot(*steps.T, **FRONT, zorder=0, drawstyle="steps-post")


def _panel(axes: Any, panel: Panel) -> None:
    for i, (name, points) in enumerate(panel.lines.items()):
        style: dict[str, Any] = {"color": COLOURS[i % len(COLOURS)], "linewidth": 1.2, "ms": 4}
        style |= {"marker": MARKERS[(i + i // len(COLOURS)) % len(MARKERS)]}
        style["linestyle"] = "-" if panel.joined else "none"
        if panel.slopes and len(points) > 2:
            name = f"{name} (slope {slope_of(points):.2f})"
        axes.plot(*zip(*points, strict=True), label=name, **style)
    if panel.marked is not None:
        axes.axvline(panel.marked, color="0.5", linestyle=":", linewidth=1.2, label="the default")
    axes.set(
        xlabel=panel.x, ylabel=_wrapped(panel.y, 40), xscale=panel.scales[0], yscale=panel.scales[1]
    )
    every = sorted({x for points in panel.lines.values() for x, _ in points})
    if panel.ticks:
        long = sum(len(tick) for tick in panel.ticks) > 32
        turned = {"rotation": 40, "ha": "right", "fontsize": 7} if long else {}
        axes.set_xticks(range(len(panel.ticks)), panel.ticks, **turned)
    elif panel.scales[0] == "log" and len(every) <= 8:
        from matplotlib.ticker import NullLocator

        kept = _apart(every)
        axes.set_xticks(kept, [_short(x) for x in kept])
        axes.xaxis.set_minor_locator(NullLocator())
    _ticks(axes)
    if len(panel.lines) > 1 or panel.marked is not None or panel.slopes:
        _legend(axes)


def _apart(values: Sequence[float]) -> list[float]:
    """Return those of some rising values whose names do not run into each other.

    >>> _apart([1, 10, 11, 100])
    [1, 10, 100]
    """
    least = 0.08 * np.log(values[-1] / values[0])
    kept = [values[0]]
    for value in values[1:]:
        if np.log(value / kept[-1]) > least:
            kept.append(value)
    return kept


def _ticks(axes: Any) -> None:
    """Write plain numbers on a logarithmic axis, more of them where it is short."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    plain = FuncFormatter(lambda value, _: _short(value))
    for axis, scale in ((axes.xaxis, axes.get_xscale()), (axes.yaxis, axes.get_yscale())):
        low, high = axis.get_view_interval()
        if scale != "log" or (
            axis is axes.xaxis and not isinstance(axis.get_major_locator(), LogLocator)
        ):
            continue
        decades = np.log10(high / low)
        subs: tuple[float, ...] = (1.0, 2.0, 5.0) if decades < 2.2 else (1.0,)
        if decades < 0.5:
            subs = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
        axis.set_major_locator(LogLocator(10, subs=subs, numticks=12))
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(NullFormatter())


def _short(value: float) -> str:
    """Write a number of an axis.

    >>> [_short(v) for v in (0.002, 0.5, 20.0, 4096.0, 2e5, 3e6, 1e-7)]
    ['0.002', '0.5', '20', '4,096', '200k', '3M', '1e-07']
    """
    for unit, name in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= max(unit, 1e4):
            return f"{value / unit:.3g}{name}"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _decibels(axes: Any, answer: Answer) -> None:
    if not answer.decibels:
        return
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

    low, high = axes.get_ylim()
    side = axes.twinx()
    side.set_ylim(*(-20 * np.log10(v) for v in (low, high)))
    side.spines["right"].set_visible(True)
    side.yaxis.set_major_locator(MaxNLocator(6))
    side.yaxis.set_minor_locator(NullLocator())
    side.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    side.set_ylabel("PSNR, dB")
    # What is chosen lies on the first axes
    axes.set_zorder(side.get_zorder() + 1)
    axes.patch.set_visible(False)


def _legend(axes: Any) -> None:
    handles, labels = axes.get_legend_handles_labels()
    wide = max((len(label) for label in labels), default=0) > 26
    below = -(0.45 + (TURNED if _turned(axes) else 0.0)) / HIGH
    axes.legend(
        handles, labels, loc="upper center", bbox_to_anchor=(0.5, below), ncols=1 if wide else 2,
        fontsize=8, frameon=False, columnspacing=1.2, handlelength=1.6,
    )  # fmt: skip


def _lean(svg: str) -> str:
    """Round numbers to a hundredth of a pixel, but for those of texts.

    >>> _lean('<text x="1.23456">0.001</text>')
    '<text x="1.23">0.001</text>'
    """
    return re.sub(r"<[^>]+>", lambda tag: re.sub(r"(\d\.\d\d)\d+", r"\1", tag[0]), svg)


def _for_page(svg: str, prefix: str) -> str:
    """Cut an SVG out of its file: names of its own, the page's ink, points that can be chosen."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r'\bid="', f'id="{prefix}', svg)
    svg = re.sub(r"url\(#", f"url(#{prefix}", svg)
    svg = re.sub(r'href="#', f'href="#{prefix}', svg)
    svg = re.sub(r"(fill|stroke): #000000", r"\1: currentColor", svg)
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns:xlink="[^"]*"| xmlns="[^"]*"', "", svg).replace("xlink:href", "href")
    svg = re.sub(r'(<svg)[^>]*?(viewBox="[^"]*")[^>]*>', r"\1 \2>", svg, count=1)
    chosen = rf'<g id="{re.escape(prefix)}{POINT}(\d+)"'
    return re.sub(chosen, r'<g class="point" data-point="\1"', svg)


def _wrapped(text: str, width: int) -> str:
    from textwrap import fill

    return fill(text, max(24, width))
