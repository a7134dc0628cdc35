"""What the commands print: progress on standard error, results (or JSON) on standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from pipelines.start import plain

if TYPE_CHECKING:
    from pathlib import Path

    from bake.recipe import Entry
    from bake.store import Finding
    from pipelines.bake_scene import SceneBake
    from pipelines.price import Ask
    from pipelines.render_scene import RenderJob
    from pipelines.unchanged import Unchanged


def use_threads(count: int) -> None:
    """Bake with `count` threads; 0 means one a core."""
    if not count:
        return
    from bake import workers

    workers.use(count)


def refuse(names: Iterable[str], remedy: str) -> None:
    """Raise InputError for the first of these options that the user wrote."""
    from click.core import ParameterSource

    from formats.errors import InputError

    context = click.get_current_context()
    for name in names:
        if context.get_parameter_source(name) == ParameterSource.COMMANDLINE:
            flag = "--" + name.replace("_", "-")
            raise InputError("command line", flag, context.params[name], remedy)


@contextmanager
def bars() -> Iterator[Callable[[str, float], None] | None]:
    """Show one bar a running bake on standard error; nothing where that is not a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        tasks: dict[str, Any] = {}

        def bar(name: str, fraction: float) -> None:
            if name not in tasks:
                tasks[name] = progress.add_task(name, total=1.0)
            progress.update(tasks[name], completed=fraction)

        yield bar


def dump(data: object) -> None:
    """Print JSON on standard output."""
    click.echo(json.dumps(data, indent=1, sort_keys=True, allow_nan=False, default=str))


def planned(
    scene: Path, root: Path | None, build: Path, lines: int, as_json: bool, ask: Ask | None = None
) -> None:
    """Print the plan of a scene file, with measured seconds where it was baked before; ask : and
    what its assets would be bought at."""
    from formats import scene as scenes
    from pipelines import pass_times, plan, price_plan
    from pipelines.bake_scene import known_reports, known_seconds

    loaded = scenes.load(scene, root)
    result = plan.build(
        loaded,
        lines=lines,
        reports=known_reports(loaded, build),
        seconds=known_seconds(loaded, build),
        milliseconds=pass_times.known(loaded, build, lines),
    )
    offers = price_plan.offers(loaded, result, build, ask) if ask else []
    if as_json and ask:
        dump({**result.as_dict(), "prices": [offer.as_dict() for offer in offers]})
    elif as_json:
        click.echo(plan.as_json(result))
    else:
        plan.show(result)
        for offer in offers:
            click.echo(offer.line())


def baked(done: SceneBake | Unchanged, as_json: bool) -> None:
    """Say what a bake did."""
    rows = {
        name: {"hit": e.hit, "seconds": e.seconds, "key": e.key, "folder": str(e.path)}
        for name, e in done.entries.items()
    }
    if as_json:
        dump({"folder": str(done.folder), "assets": rows})
        return
    for name, row in rows.items():
        click.echo(f"{name}: {'up to date' if row['hit'] else 'baked'}")
    click.echo(f"{done.folder}")


def rendered(job: RenderJob, *, as_json: bool, profile: bool) -> None:
    """Say what was written, and what each pass cost when asked."""
    if as_json:
        dump(
            {
                "files": [str(f) for f in job.files],
                "skipped": [str(f) for f in job.skipped],
                "size": list(job.size),
                "frames": job.frames,
                "seconds": job.seconds,
                "bytes": job.bytes,
                "profile": job.profile,
            }
        )
        return
    for file in job.files:
        click.echo(str(file))
    if job.skipped:
        click.echo(f"{len(job.skipped)} there already, left as they are", err=True)
    if profile:
        from pipelines.profile import show

        show(job.profile)


def traced(job: RenderJob, *, as_json: bool) -> None:
    """Say what a reference wrote, and on standard error what it took."""
    rendered(job, as_json=as_json, profile=False)
    if as_json:
        return
    click.echo(
        f"{'':24}{'seconds':>9}{'samples':>9}{'Mrays':>9}{'Mray/s':>9}  mean error", err=True
    )
    for name, row in job.profile.items():
        numbers = f"{row['seconds']:9.1f}{row['samples']:9d}{row['rays'] / 1e6:9.1f}"
        speed = f"{row['rays_per_second'] / 1e6:9.2f}  {row['mean_error']:.3g}"
        click.echo(f"{name:24}{numbers}{speed}", err=True)
        for note in row["notes"]:
            click.echo(f"note: {plain(note)}", err=True)


def delivered(entry: Entry, out: Path, as_json: bool) -> None:
    """Put an entry's files into the folder that was asked for, whole or not at all, and say so."""
    from formats import report
    from pipelines import told
    from pipelines.deliver import deliver

    deliver(entry.path, out)
    data = report.read(entry.path)
    quality = data.get("quality", {})
    if as_json:
        dump({"folder": str(out), "hit": entry.hit, "seconds": entry.seconds, "quality": quality})
        return
    if told.lines(data):
        click.echo("\n".join(told.good(quality)))
    for note in quality.get("notes", []):
        click.echo(f"note: {plain(note)}", err=True)
    click.echo(str(out))


def wrote(path: Path, as_json: bool) -> None:
    """Say which file was written."""
    if as_json:
        dump({"file": str(path)})
    else:
        click.echo(str(path))


def inspected(data: dict[str, Any], as_json: bool) -> None:
    """Print a description: of a sprite what a person asks, of others every field, indented."""
    from pipelines import told

    if as_json:
        dump(data)
    elif found := told.lines(data):
        click.echo("\n".join(map(plain, found)))
    else:
        _rows(data, "")


def _rows(data: dict[str, Any], indent: str) -> None:
    for name, value in data.items():
        if isinstance(value, dict):
            click.echo(f"{indent}{plain(name)}:")
            _rows(value, indent + "  ")
        else:
            shown = f"{value:.6g}" if isinstance(value, float) else str(value)
            click.echo(f"{indent}{plain(name)}: {plain(shown)}")


def found(findings: list[Finding], as_json: bool) -> None:
    """Print what is wrong in a store."""
    if as_json:
        dump([{"path": str(f.path), "problem": f.problem} for f in findings])
        return
    for finding in findings:
        click.echo(f"{finding.path}: {finding.problem}")
    if not findings:
        click.echo("intact")


def removed(paths: list[Path], dry_run: bool, as_json: bool) -> None:
    """Print what a sweep took, or would take."""
    if as_json:
        dump({"dry_run": dry_run, "removed": [str(p) for p in paths]})
        return
    for path in paths:
        click.echo(str(path))
    click.echo(f"{len(paths)} {'would go' if dry_run else 'removed'}")
