"""Run studies: measure, write down, print. `bakelight study` ends here."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from time import perf_counter

from formats.errors import InputError
from pipelines.studies import answer as answers
from pipelines.studies.subjects import Setting

# One module a question, each with `measure(setting) -> Answer`; its first line is the question
QUESTIONS = (
    "lens_by_mips",
    "light_directions",
    "harmonics",
    "packing",
    "shadow_rays",
    "ring_models",
    "dome",
    "normal_map",
    "occlusion_rays",
    "occlusion_encodings",
    "shadow_lights",
    "shadow_truth",
    "watertight",
    "gather_lights",
    "gather_modes",
    "voxel_storage",
)


def run(questions: tuple[str, ...], out: Path, *, quick: bool, source: Path | None) -> None:
    """Run the studies named, or all; write their files into `out` and print a table each.

    questions : names of QUESTIONS; "list" alone prints them. InputError for other names and for a
    source that is not there.
    """
    from rich.console import Console

    console = Console()
    if questions == ("list",):
        for name in QUESTIONS:
            console.print(f"[bold]{name}[/bold]  {asked(name)}")
        return
    for name in questions:
        if name not in QUESTIONS:
            raise InputError(
                "study", "question", name, f"choose from {', '.join(QUESTIONS)}, or list"
            )
    if source is not None and not source.is_file():
        raise InputError(source, "", "no such file", "check the path")
    setting = Setting(quick=quick, source=source)
    for name in questions or QUESTIONS:
        console.print(f"[bold]{name}[/bold]  {asked(name)}")
        files = run_one(name, out, setting)
        show(console, files[0])
        console.print("  ".join(str(f) for f in files[1]), soft_wrap=True)


def asked(name: str) -> str:
    """Return the question that a study asks."""
    return str(import_module(f"pipelines.studies.{name}").__doc__).split("\n", 1)[0]


def run_one(name: str, out: Path, setting: Setting) -> tuple[answers.Answer, list[Path]]:
    """Measure one question and write it down; return the answer and the files."""
    started = perf_counter()
    answer: answers.Answer = import_module(f"pipelines.studies.{name}").measure(setting)
    return answer, answers.write(answer, out, setting, perf_counter() - started)


def show(console: object, answer: answers.Answer) -> None:
    """Print the rows worth printing, and the answer below them."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    assert isinstance(console, Console)
    rows = answer.table or answer.rows
    table = Table(box=box.SIMPLE, padding=(0, 1, 0, 0))
    for name in rows[0]:
        table.add_column(
            name.replace("_", " "), justify="left" if isinstance(rows[0][name], str) else "right"
        )
    for row in rows:
        table.add_row(*(_short(v) for v in row.values()))
    console.print(table)
    console.print(f"[bold]{answer.title}[/bold]")


def _short(value: float | int | str) -> str:
    if not isinstance(value, float):
        return str(value)
    if value == 0 or 0.1 <= abs(value) < 1e4:
        return f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}"
    return f"{value:.1e}"
