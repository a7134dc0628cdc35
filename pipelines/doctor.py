"""`bakelight doctor`: is this machine sound, and what is wrong with these files."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from pipelines.cli import build_option, file_path, json_option
from pipelines.start import plain

Progress = Callable[[int, int, str], None]


@click.command()
@click.argument("files", nargs=-1, type=file_path)
@build_option
@json_option
def doctor(files: tuple[Path, ...], build: Path, as_json: bool) -> int:
    """Look at FILES: meshes, photographs (.lp), voxels, maps, pictures, scenes; what is wrong with
    each, how bad, and what a bake will do about it. Without FILES look at the machine: driver,
    libraries, and the quick part of the hard cases, in under a minute.

    Exit code 2 where a file cannot be read, 3 where the machine fails a check.
    """
    return _files(files, as_json) if files else _machine(build, as_json)


def _files(files: tuple[Path, ...], as_json: bool) -> int:
    from formats.errors import BakelightError
    from pipelines import output
    from pipelines.doctor_files import examine
    from pipelines.hard.matrix import quiet

    told, refused = [], []
    for path in files:
        try:
            # What native decoders print of a damaged file is said by the error
            with quiet():
                found = examine(path)
        except BakelightError as error:
            refused.append(str(error))
            told.append({"file": str(path), "verdict": "unreadable", "error": str(error)})
            continue
        told.append(found.as_json())
        if not as_json:
            click.echo("\n".join(map(plain, found.lines())))
    if as_json:
        output.dump({"files": told})
    for line in refused:
        click.echo(f"bakelight: {plain(line)}", err=True)
    return 2 if refused else 0


def _machine(build: Path, as_json: bool) -> int:
    from pipelines import doctor_machine, output

    told = doctor_machine.facts(build)
    outcomes = _watched(lambda progress: doctor_machine.run(told, progress))
    found = doctor_machine.checks(outcomes)
    failed = [o for o in outcomes if not o.result.good]
    if as_json:
        output.dump({"machine": told, "checks": found, "cells": [o.as_json() for o in outcomes]})
    else:
        click.echo("\n".join(doctor_machine.lines(told, found, outcomes)))
    bad = failed or any(row["failed"] for row in found) or "error" in told["opengl"]
    return 3 if bad else 0


def _watched(run: Callable[[Progress | None], list[Any]]) -> list[Any]:
    """Show one bar on standard error where that is a terminal."""
    if not sys.stderr.isatty():
        return run(None)
    from rich.console import Console
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("hard cases")

        def watch(number: int, count: int, family: str) -> None:
            bar.update(task, total=count, completed=number, description=family)

        return run(watch)
