"""Run studies: measure, write down, print. `bakelight study` ends here.

What was measured before with the same code, knobs, versions and seed is kept; an interrupted run
goes on where it stopped. The page is put together anew after every study.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

from bake import machine
from formats.errors import BakelightError, InputError
from pipelines.studies import answer as answers
from pipelines.studies import kept, page, parts, record, stages, subjects
from pipelines.studies.subjects import Setting

# One module a question: its first line is the question, `measure(setting)` the answer, and TAKES
# the kinds of source that it measures on instead of its own
QUESTIONS = (
    "light_directions",
    "harmonics",
    "packing",
    "shadow_rays",
    "ring_models",
    "dome",
    "normal_map",
    "sprite_lights",
    "mesh_lights",
    "lens_by_mips",
    "sampling_pattern",
    "occlusion_rays",
    "occlusion_bands",
    "occlusion_grid",
    "occlusion_encodings",
    "caster_points",
    "shadow_lights",
    "shadow_truth",
    "watertight",
    "gather_lights",
    "importance",
    "gather_modes",
    "gather_rays",
    "gather_bounces",
    "lightmap_texels",
    "voxel_storage",
)
STORE = Path("build/store")
MINOR = ("error_low", "error_high", "frame_ms_low", "frame_ms_high", "default")
"""Columns that a table does without first."""
LONG = ("price", "presets", "coverage")
"""Only where they are named: they bake for ten minutes and more."""
KINDS = {
    ".lp": "photographs",
    ".vox": "voxels",
    ".toml": "scene",
    ".json": "scene",
}
"""What a source is by its suffix; all others are meshes."""


@dataclass
class Done:
    """What became of each question of a run."""

    measured: list[str]
    kept: list[str]
    skipped: dict[str, str]


def run(
    questions: tuple[str, ...],
    out: Path,
    *,
    quick: bool,
    source: Path | None,
    again: bool = False,
    as_json: bool = False,
    store: Path | None = None,
) -> None:
    """Run the studies named, or all; write their files into `out`, print a table each, and put the
    page together.

    questions : names of QUESTIONS; "list" alone prints them. again : measure what is kept, too.
    as_json : print nothing but JSON on standard output. store : where stages find and leave what
    they bake, by default build/store. InputError for other names and for a source that is not
    there.
    """
    from rich.console import Console

    console = Console(stderr=as_json)
    if questions == ("list",):
        listed(console, as_json)
        return
    for name in questions:
        if name not in (*QUESTIONS, *LONG):
            raise InputError(
                "study", "question", name, f"choose from {', '.join(QUESTIONS)}, or list"
            )
    if source is not None:
        if not source.is_file():
            why = "not a file" if source.exists() else "no such file"
            raise InputError(source, "", why, "check the path")
        subjects.check(source, kind_of(source))
    setting = Setting(quick=quick, source=source)
    with stages.into(store or STORE, out / "bakes.json"):
        done, failed = all_of(questions or QUESTIONS, out, setting, again=again, console=console)
    written = together(out)
    if as_json:
        print(json.dumps(summary(out, done, written), indent=1))
    elif written:
        console.print(f"[bold]{written}[/bold]: all answers on one page", soft_wrap=True)
    if failed:
        raise failed[0]


def listed(console: Any, as_json: bool) -> None:
    """Print names, questions, and what each takes as source."""
    if as_json:
        print(
            json.dumps(
                {n: {"asks": asked(n), "takes": takes(n)} for n in (*QUESTIONS, *LONG)}, indent=1
            )
        )
        return
    for name in (*QUESTIONS, *LONG):
        own = f"  [dim]--source: {', '.join(takes(name))}[/dim]" if takes(name) else ""
        console.print(f"[bold]{name}[/bold]  {asked(name)}{own}", highlight=False)


def all_of(
    questions: Sequence[str], out: Path, setting: Setting, *, again: bool, console: Any
) -> tuple[Done, list[BakelightError]]:
    """Run studies one after another; what one of them refuses does not stop the others."""
    done, failed = Done([], [], {}), list[BakelightError]()
    waiting, keys = [], dict[str, str]()
    for name in questions:
        why = refusal(name, setting)
        if why:
            done.skipped[name] = why
            console.print(f"[dim]{name}: {why}[/dim]", highlight=False)
            continue
        keys[name] = kept.key(name, setting)
        if not again and kept.is_current(out, name, keys[name]):
            done.kept.append(name)
            console.print(
                f"[dim]{name}: kept, {kept.read(out, name)['date']}[/dim]", highlight=False
            )
        else:
            waiting.append(name)
    for number, name in enumerate(waiting):
        left = forecast(out, waiting[number:], setting.quick)
        console.print(f"\n[dim]{number + 1} of {len(waiting)}{left}[/dim]", highlight=False)
        console.print(f"[bold]{name}[/bold]  {asked(name)}", highlight=False)
        try:
            found, files = run_one(name, out, setting, key=keys[name])
        except BakelightError as error:
            failed.append(error)
            done.skipped[name] = str(error)
            console.print(f"[red]{name}: {error}[/red]", highlight=False)
            continue
        show(console, found)
        console.print("  ".join(str(f) for f in files), soft_wrap=True)
        done.measured.append(name)
        together(out)
    return done, failed


def forecast(out: Path, names: Sequence[str], quick: bool) -> str:
    """Say how long the studies named will take, from earlier runs.

    Those without an earlier run count as the mean of all others.
    """
    every = {name: kept.seconds(out, name, quick) for name in (*QUESTIONS, *names)}
    known = {name: spent for name, spent in every.items() if spent is not None}
    if not known:
        return ", no earlier run to tell the time left"
    mean = sum(known.values()) / len(known)
    left = sum(known.get(name, mean) for name in names)
    return f", about {left:.0f} s left" if left < 100 else f", about {left / 60:.0f} min left"


def asked(name: str) -> str:
    """Return the question that a study asks."""
    return str(import_module(f"pipelines.studies.{name}").__doc__).split("\n", 1)[0]


def takes(name: str) -> tuple[str, ...]:
    """Return the kinds of source that a study takes."""
    found: tuple[str, ...] = import_module(f"pipelines.studies.{name}").TAKES
    return found


def refusal(name: str, setting: Setting) -> str:
    """Say why a study cannot be run on the source; nothing where it can."""
    if setting.source is None:
        return ""
    kind = kind_of(setting.source)
    if kind in takes(name):
        return ""
    own = f"takes {' or '.join(takes(name))}" if takes(name) else "takes no source"
    return f"skipped, {own}, and {setting.source.name} is {kind}"


def kind_of(source: Path) -> str:
    """Return what a source is."""
    return KINDS.get(source.suffix.lower(), "mesh")


def run_one(
    name: str, out: Path, setting: Setting, *, key: str = ""
) -> tuple[answers.Answer, list[Path]]:
    """Measure one question and write it down; return the answer and the files."""
    started = perf_counter()
    with parts.into(out / "parts" / name, key):
        found: answers.Answer = import_module(f"pipelines.studies.{name}").measure(setting)
        write = partial(record.write, asked=asked(name), key=key)
        files = write(found, out, setting, perf_counter() - started)
    if setting.source is None:
        kept.note(out, name, setting.quick, perf_counter() - started)
    return found, files


def together(out: Path) -> Path | None:
    """Put the page of all answers that lie in a folder together; return its path, if any do."""
    found = [(name, kept.read(out, name)) for name in (*QUESTIONS, *LONG)]
    parts = [
        (name, str(told["answer"]), kept.part_of(out, name).read_text(encoding="utf-8"))
        for name, told in found
        if told and kept.part_of(out, name).is_file()
    ]
    if not parts:
        return None
    cores = next(told.get("cores") for _, told in found if told)
    page.write(out / "index.html", parts, f"{machine.name()}, {cores} cores")
    return out / "index.html"


def summary(out: Path, done: Done, written: Path | None) -> dict[str, Any]:
    """Return what a run did, for programs."""
    every = {
        name: {k: told.get(k) for k in ("answer", "seconds", "date", "quick", "seed", "source")}
        for name in [*done.kept, *done.measured]
        if (told := kept.read(out, name))
    }
    return {
        "page": str(written) if written else None,
        "measured": done.measured,
        "kept": done.kept,
        "skipped": done.skipped,
        **answers.environment(),
        "answers": every,
    }


def show(console: Any, answer: answers.Answer) -> None:
    """Print the rows worth printing, and the answer below them."""
    from rich import box
    from rich.table import Table

    rows = answer.table or answer.rows
    columns = list(dict.fromkeys(name for row in rows for name in row if name != "series"))
    cells = {n: [_short(row[n]) if n in row else "" for row in rows] for n in columns}
    shown = _fitting(cells, console.width - 2)
    table = Table(box=box.SIMPLE, padding=(0, 1, 0, 0))
    for name in shown:
        first = next(row[name] for row in rows if name in row)
        table.add_column(_head(name), justify="left" if isinstance(first, str) else "right")
    for line in zip(*(cells[name] for name in shown), strict=True):
        table.add_row(*line)
    console.print(table)
    if len(shown) < len(columns):
        left = len(columns) - len(shown)
        console.print(f"[dim]a narrow terminal: {left} of {len(columns)} columns left out[/dim]")
    console.print(f"[bold]{answer.title}[/bold]")


def _fitting(cells: dict[str, list[str]], width: int) -> list[str]:
    """Return the columns that fit side by side into a width, which others have to leave."""
    wide = {n: max(map(len, [*_head(n).split(), *column])) + 2 for n, column in cells.items()}
    kept = list(cells)
    for name in (*MINOR, *reversed(cells)):
        if sum(wide[n] for n in kept) > width and name in kept[1:]:
            kept.remove(name)
    return kept


def _head(name: str) -> str:
    return name.replace("_", " ")


def _short(value: float | int | str) -> str:
    if not isinstance(value, float):
        return str(value)
    if value == 0 or 0.1 <= abs(value) < 1e4:
        return f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}"
    return f"{value:.1e}"
