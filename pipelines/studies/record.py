"""How an answer is written down: CSV, JSON, plots, pictures, and its part of the page."""

from __future__ import annotations

import csv
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from PIL import Image

from formats.files import atomic
from pipelines.studies import kept, page, plots
from pipelines.studies.answer import COMMON, Answer, environment
from pipelines.studies.subjects import Setting


def write(
    answer: Answer, out: Path, setting: Setting, seconds: float, *, asked: str = "", key: str = ""
) -> list[Path]:
    """Write <question>.csv, .json, .svg, .png and <question>-<picture>.png into a folder, and the
    part of the page below it. Returns the paths of the former, in this order.

    The JSON comes last: what it says is there in full.
    """
    out.mkdir(parents=True, exist_ok=True)
    stem = out / answer.question
    every = dict.fromkeys(name for row in answer.rows for name in row)
    columns = [c for c in COMMON if c in every] + [c for c in every if c not in COMMON]
    with open(stem.with_suffix(".csv"), "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(answer.rows)
    data = {
        "question": answer.question,
        "asked": asked,
        "answer": answer.title,
        "truth": answer.truth,
        "unit": answer.unit,
        "figures": answer.figures,
        "quick": setting.quick,
        "source": None if setting.source is None else setting.source.name,
        "seed": setting.seed,
        "seconds": round(seconds, 2),
        "date": datetime.now(UTC).date().isoformat(),
        **environment(),
        "key": key,
        "rows": list(answer.rows),
    }
    text = _text(data)
    drawn = plots.draw(answer, stem)
    pictures = []
    for name, picture in answer.pictures.items():
        pictures.append(out / f"{answer.question}-{name}.png")
        Image.fromarray(picture).save(pictures[-1])
    part = kept.part_of(out, answer.question)
    part.parent.mkdir(exist_ok=True)
    atomic.write_bytes(part, page.part(answer, asked, data).encode())
    atomic.write_bytes(stem.with_suffix(".json"), (text + "\n").encode())
    return [stem.with_suffix(s) for s in (".csv", ".json")] + drawn + pictures


def _text(data: dict[str, Any]) -> str:
    """Return JSON that people and version control read: a row of measurements a line."""
    head = json.dumps({k: v for k, v in data.items() if k != "rows"}, indent=1, allow_nan=False)
    rows = ",\n  ".join(json.dumps(row, allow_nan=False) for row in data["rows"])
    return f'{head[:-2]},\n "rows": [\n  {rows}\n ]\n}}'
