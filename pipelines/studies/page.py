"""One page of all studies, in one file: answers, plots, tables, and the pictures behind the points.

A part of the page is made with each study and kept, so that the page is put together anew without
measuring again. Nothing is loaded from elsewhere.
"""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from formats.files import atomic
from pipelines.studies import plots
from pipelines.studies.answer import Answer, Picture, Row, Shot

TEMPLATE = Path(__file__).parent / "page.html"
LARGEST = 192  # pixels of a point's picture along its longer side; others stand as they are
QUALITY = 80
GAINS = (1, 2, 4, 8, 16, 32)
SEEN = 60  # codes that the larger differences should be shown as


def part(answer: Answer, asked: str, told: Mapping[str, Any]) -> str:
    """Return the part of the page for one answer. told : what its JSON says."""
    name, rows = answer.question, answer.table or answer.rows
    titles = [plots.title_of(answer, what) for what in plots.plotted(answer)]
    drawn = "".join(
        f'<figure class="plot"><figcaption>{marked(title)}</figcaption>{svg}</figure>'
        for title, svg in zip_longest(titles, plots.inline(answer), fillvalue="")
    )
    images, shots = gallery(answer)
    data: dict[str, Any] = {
        "points": [described(answer, row, shots.get(key(row))) for row in answer.points]
    }
    data |= {"images": images}
    # No text of a study may end the element
    held = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return f"""<section id="{name}" data-state="{escape(str(told.get("date", "")))}">
<p class="asked">{escape(asked)}</p>
<h2>{marked(answer.title)}</h2>
<p class="truth">Measured against: {escape(answer.truth)}.</p>
<div class="chosen"><div class="plots">{drawn}</div>{viewer(shots)}</div>
{"".join(whole(name, picture) for name, picture in answer.pictures.items())}
<details><summary>{len(rows)} measurements</summary>{table(rows)}</details>
<p class="made">{escape(made(told))}</p>
<script type="application/json">{held}</script>
</section>
"""


def marked(text: str) -> str:
    """Return a sentence as HTML: what stands in backticks as code, powers raised.

    >>> marked("`talk` errs as rays^-0.75 < 16^3")
    '<code>talk</code> errs as rays<sup>-0.75</sup> &lt; 16<sup>3</sup>'
    """
    found = re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))
    return re.sub(r"\^(-?\w+(?:\.\d+)?)", r"<sup>\1</sup>", found)


def key(row: Row) -> tuple[str, str]:
    """Return what names a point among an answer's shots."""
    return str(row["subject"]), str(row["setting"])


def made(told: Mapping[str, Any]) -> str:
    """Say when and on what an answer was measured."""
    size = "quick run" if told.get("quick") else "full run"
    source = f", source {told['source']}" if told.get("source") else ""
    return (
        f"{told.get('date', '')}, {size}{source}, seed {told.get('seed')}, {told.get('seconds')} s"
    )


def viewer(shots: Mapping[tuple[str, str], Any]) -> str:
    """Return where the pictures of the chosen point are shown."""
    if not shots:
        return ""
    names = ["picture", "truth", "difference"]
    figures = "".join(
        f'<figure class="{n}"><img alt="{n}"><figcaption>{n}</figcaption></figure>' for n in names
    )
    return (
        f'<aside class="viewer" aria-live="polite"><p class="what"></p><div>{figures}</div></aside>'
    )


def gallery(answer: Answer) -> tuple[list[str], dict[tuple[str, str], dict[str, Any]]]:
    """Return images as data, each once, and for each point which of them it shows."""
    images: dict[str, int] = {}
    gain = gain_of(list(answer.shots.values()))

    def placed(picture: Picture) -> int:
        return images.setdefault(encoded(small(picture)), len(images))

    found: dict[tuple[str, str], dict[str, Any]] = {}
    for name, shot in answer.shots.items():
        one: dict[str, Any] = {"picture": placed(shot.picture)}
        if shot.truth is not None:
            one |= {"truth": placed(shot.truth), "gain": gain}
            one["difference"] = placed(difference(shot, gain))
        found[name] = one
    return list(images), found


def gain_of(shots: Sequence[Shot]) -> int:
    """Choose by how much differences are multiplied: one number a study, so that points compare."""
    larger = [
        float(np.quantile(np.abs(s.picture.astype(np.int64) - s.truth), 0.99))
        for s in shots
        if s.truth is not None
    ]
    typical = float(np.median(larger)) if larger else SEEN
    return max((g for g in GAINS if g * typical <= SEEN), default=1)


def difference(shot: Shot, gain: int) -> Picture:
    """Return picture minus truth, times the gain, about grey."""
    assert shot.truth is not None
    apart = gain * (shot.picture.astype(np.int64) - shot.truth)
    return np.asarray(np.clip(128 + apart, 0, 255), np.uint8)


def small(picture: Picture) -> Picture:
    """Shrink a picture whose longer side is over LARGEST."""
    longer = max(picture.shape[:2])
    if longer <= LARGEST:
        return picture
    height, width = (max(1, round(n * LARGEST / longer)) for n in picture.shape[:2])
    return np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.BOX))


def encoded(picture: Picture) -> str:
    """Return a picture as WebP in a data URI."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "WEBP", quality=QUALITY, method=4)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()


def whole(name: str, picture: Picture) -> str:
    """Return a picture that belongs to no point."""
    return f"""<details><summary>{escape(name)}</summary>
<img class="whole" alt="{escape(name)}" src="{encoded(picture)}"></details>"""


def described(answer: Answer, row: Row, shot: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return what the page tells of a point."""
    found: dict[str, Any] = {
        "name": f"{row['subject']}: {row['setting']}",
        "told": told_of(answer, row),
    }
    return found | (dict(shot) if shot else {})


def told_of(answer: Answer, row: Row) -> str:
    """Return a point's numbers as a sentence."""
    names = {"bake_seconds": "s to bake", "frame_ms": "ms a frame", "bytes": "bytes"}
    words = []
    if "error" in row:
        value, low, high = (float(row[n]) for n in ("error", "error_low", "error_high"))
        words.append(f"error {value:.3g} ({low:.3g} to {high:.3g})")
    words += [f"{number(row[c])} {unit}" for c, unit in names.items() if c in row]
    words += ["the default"] if row["default"] else []
    return ", ".join(words)


def number(value: float | int | str) -> str:
    """Write a value of a table.

    >>> number(0.012345), number(12), number(123456.0), number("oak")
    ('0.0123', '12', '123,456', 'oak')
    """
    if isinstance(value, str):
        return value
    if isinstance(value, int) or abs(value) >= 1000:
        return f"{value:,.0f}"
    return f"{value:.3g}"


def table(rows: Sequence[Row]) -> str:
    """Return rows as a table of all their columns."""
    columns = list(dict.fromkeys(name for row in rows for name in row if name != "series"))
    head = "".join(f"<th>{escape(name.replace('_', ' '))}</th>" for name in columns)

    def cells(row: Row) -> Iterator[str]:
        for name in columns:
            value = row.get(name, "")
            kind = "" if isinstance(value, str) else ' class="n"'
            yield f"<td{kind}>{escape(number(value))}</td>"

    body = "".join(f"<tr>{''.join(cells(row))}</tr>" for row in rows)
    whole = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="table">{whole}</div>'


def write(path: Path, parts: Sequence[tuple[str, str, str]], machine: str) -> None:
    """Write the page. parts : (name of the study, its answer, its part of the page)."""
    contents = "".join(
        f'<li><a href="#{name}"><span>{escape(name.replace("_", " "))}</span>'
        f" <b>{marked(title)}</b></a></li>"
        for name, title, _ in parts
    )
    text = TEMPLATE.read_text(encoding="utf-8")
    for mark, value in (
        ("<!-- machine -->", escape(machine)),
        ("<!-- contents -->", contents),
        ("<!-- parts -->", "".join(one for _, _, one in parts)),
    ):
        text = text.replace(mark, value, 1)
    atomic.write_bytes(path, text.encode())
