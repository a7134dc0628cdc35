"""Writes docs/scene.md, the reference of scene files, from the dataclasses that read them.

Run it from the checkout after a change of the schema: .venv/bin/python docs/scene_reference.py
"""

from pathlib import Path
from typing import Any

from formats import scene, schema
from formats.sprites import QUALITIES

HERE = Path(__file__).parent

OPENING = """\
# Scene files

A scene is a TOML file in a folder named `scenes` (or a JSON file with the same content). Lengths
are metres, times seconds, angles degrees; +y is up; radiance and albedo are scene-linear with
Rec. 709 primaries. Paths of sources start at the folder that holds `scenes/` (or `--root`) and
cannot leave it. A file has at most 4 MB, a list at most 100,000 items.

What is written as *keyed* may be a plain value or move over time:
`{ times = [0, 5], values = [1.3, 7.2], interpolation = "smooth", loop = false }`. Times increase
by a microsecond or more, there is one value for each; `interpolation` is `"linear"` (when absent),
`"step"` or `"smooth"` (starts and ends at rest and never overshoots). Before the first and after
the last key the value holds, unless `loop` repeats it.

An unknown key, a value out of range, a number that is not finite and a missing file are errors that
name the file, the field, the value and the remedy. A field without a default must be written.

This page is made from the schema: `.venv/bin/python docs/scene_reference.py` writes it again.
"""


def page() -> str:
    """The whole reference as Markdown."""
    return OPENING + "".join(sections(scene.Scene, ""))


def sections(table: Any, path: str, tag: str = "") -> list[str]:
    """The section of a table and of every table inside it."""
    title = f"`{path}`" if path else "The file"
    if tag:
        title += f' with `type = "{tag}"`'
    lines = [f"\n## {title}\n\n{table.__doc__.splitlines()[0]}\n\n"]
    lines.append("| field | type | unit | range | default | meaning |\n|---|---|---|---|---|---|\n")
    inner: list[str] = []
    if tag:
        lines.append(f'| `type` | text | | `"{tag}"` | | which light this is |\n')
    for name, spec in schema.specs(table).items():
        lines.append(row(name, spec))
        below = f"{path}.{name}" if path else name
        if spec.table is not None:
            inner += sections(spec.table, below)
        for kind, entry in spec.tables.items():
            inner += sections(entry, f"[[{below}]]", kind)
    return ["".join(lines), *inner]


def row(name: str, spec: schema.Spec) -> str:
    """One field as a row."""
    cells = [f"`{name}`", kind(spec), spec.unit, limits(spec), default(spec), spec.doc]
    return "| " + " | ".join(cells) + " |\n"


def kind(spec: schema.Spec) -> str:
    """What is written there, in words."""
    value = " or ".join("number" if n == 1 else f"{n} numbers" for n in spec.sizes)
    return {
        "keyed": f"{value}, keyed",
        "vector": value,
        "value": value,
        "numbers": "list of numbers" if spec.sizes == (1,) else f"list of {value} each",
        "flags": "list of true and false",
        "flag": "true or false",
        "integer": "whole number",
        "source": "path",
        "table": "table",
        "tables": "list of tables",
        "switches": "table of true and false",
        "radiances": "table of three numbers each",
    }.get(spec.kind, spec.kind)


def limits(spec: schema.Spec) -> str:
    """Allowed values."""
    if spec.choices:
        return ", ".join(f"`{choice}`" for choice in spec.choices)
    if spec.kind in ("keyed", "vector", "value", "numbers", "number", "integer"):
        return f"{spec.low:.10g} to {spec.high:.10g}"
    return ""


def default(spec: schema.Spec) -> str:
    """What stands in for an absent field."""
    if spec.by_quality:
        pairs = zip(QUALITIES, spec.by_quality, strict=True)
        return "by quality: " + ", ".join(f"{name} {number}" for name, number in pairs)
    if spec.default is schema.REQUIRED:
        return "required"
    if spec.default is None:
        return "absent"
    plain = {True: "true", False: "false"} if isinstance(spec.default, bool) else {}
    text = plain.get(spec.default) if plain else None
    if isinstance(spec.default, str):
        text = f'"{spec.default}"'
    elif spec.default in ({}, []):
        return "empty"
    return f"`{text or spec.default}`"


if __name__ == "__main__":
    (HERE / "scene.md").write_text(page(), encoding="utf-8")
