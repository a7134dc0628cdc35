"""All rows and cells, what ran, and the tables that tell of it."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from pipelines.hard import cells as hard
from pipelines.hard.bombs import bombs
from pipelines.hard.card import card
from pipelines.hard.cells import Cell, Family, Outcome, Row
from pipelines.hard.circular import circular
from pipelines.hard.components import components
from pipelines.hard.crash import crash
from pipelines.hard.cubes import cubes
from pipelines.hard.files import files
from pipelines.hard.lights import lights
from pipelines.hard.meshes import meshes
from pipelines.hard.scenes import scenes_family
from pipelines.hard.sets import sets
from pipelines.hard.spherical import spherical
from pipelines.hard.textures import textures

FAMILIES: tuple[Family, ...] = (
    circular, spherical, components, meshes, cubes, textures, lights, sets, files, bombs,
    scenes_family, crash, card,
)  # fmt: skip
Progress = Callable[[int, int, str], None]


def rows() -> tuple[Row, ...]:
    """Return every row, family by family."""
    return tuple(row for family in FAMILIES for row in family.rows.values())


def cells(*, slow: bool = True) -> tuple[Cell, ...]:
    """Return every cell, or those that are quick."""
    return tuple(c for family in FAMILIES for c in family.cells if slow or not c.slow)


def run(chosen: Sequence[Cell], progress: Progress | None = None) -> list[Outcome]:
    """Run cells one after the other; what native decoders print of damaged files is dropped."""
    found = []
    for number, cell in enumerate(chosen):
        if progress is not None:
            progress(number, len(chosen), cell.row.family)
        decoded = cell.row.family in (files.name, bombs.name)
        with quiet() if decoded else contextlib.nullcontext():
            found.append(hard.run(cell))
    return found


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Drop what is written to standard output and error by any library, until the block ends."""
    kept = [os.dup(number) for number in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in (1, 2):
            os.dup2(nowhere, number)
        yield
    finally:
        for number, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, number)
            os.close(copy)
        os.close(nowhere)


def counts(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """Return how many cells ended how."""
    verdicts = [outcome.result.verdict for outcome in outcomes]
    return {verdict: verdicts.count(verdict) for verdict in ("ok", "refused", "skipped", "failed")}


def write(outcomes: Sequence[Outcome], folder: Path) -> None:
    """Write table.md and table.json into a folder, which is made if need be."""
    folder.mkdir(parents=True, exist_ok=True)
    data = {"counts": counts(outcomes), "cells": [outcome.as_json() for outcome in outcomes]}
    (folder / "table.json").write_text(json.dumps(data, indent=1, allow_nan=False) + "\n")
    lines = [
        "| row | stage | verdict | value | bound | seconds | |",
        "|---|---|---|---|---|---|---|",
    ]
    for outcome in outcomes:
        found = outcome.result
        value, bound = ("" if x is None else f"{x:.3g}" for x in (found.value, found.bound))
        lines.append(
            f"| {outcome.cell.row.name} | {_cell(outcome.cell.stage)} | {found.verdict} | {value} "
            f"| {bound} | {outcome.seconds:.2f} | {_cell(found.said)} |"
        )
    (folder / "table.md").write_text("\n".join(lines) + "\n")


def described() -> str:
    """Return docs/hard-cases.md: every row, what must happen, and at which stages."""
    told = [HEAD.format(rows=len(rows()), cells=len(cells()))]
    for family in FAMILIES:
        told += [f"\n## {family.name.capitalize()}\n", "| | case | what happens | bound | stages |",
                 "|---|---|---|---|---|"]  # fmt: skip
        for row in family.rows.values():
            stages = [c.stage for c in family.cells if c.row is row]
            shown = ", ".join(stages[:6]) + (f" and {len(stages) - 6} more" if stages[6:] else "")
            parts = (row.name, row.case, row.behaviour, row.truth, shown)
            told.append("| " + " | ".join(_cell(part) for part in parts) + " |")
    return "\n".join(told) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


HEAD = """# Hard cases

What Bakelight does with input at its limits: {rows} cases, each at every stage, codec or part of
the player that it reaches, {cells} in all. `make hard` runs them on your machine and writes
`build/hard/table.md` with the measured values; `bakelight doctor` runs the quick ones. Each ends
within its bound, or in one line that names file, field, value and remedy. "Finite" means that
every number of an asset is finite, as made and as read back from its sealed files.

Decoders of files that people bring: OpenEXR, in C++ and of a rich format, decodes in a process of
its own, which may take 8 GiB, and 60 s and one more for every 4 MB; its own prints are dropped. It
costs .25 s a file, on bakes that find nothing in their store. PNG, JPEG, WebP and TIFF (Pillow),
zstd and meshes (trimesh, in Python) are decoded where they are read: sizes are checked before.

Damaged files, of each of 16 kinds (.vox, .lp, .hdr, .exr, .ktx2, .dds, .png, other pictures, .glb
alone and as a mesh, .obj, .ply, .toml, one report, folders of reports, seals): of 100,000 each none
crashed, took 2 s or 512 MB, or ended in anything but a sound result or one line (95 %: below 3e-5).
`make fuzz` counts it again. A first count had found 20, of two causes: keys of a scene 1e-320 s
apart, and a list as a material's name.

Kernels of BLAS: what is stored as codes is summed in double precision and rounded once. Of 1.66
million texels of a lumpy shape, baked with the kernels of Haswell, SkylakeX, Sandybridge, Nehalem
and Katmai, at most 3 differ from the first kernel's, by one code: 2 of 200,655 of a ring, whose
rays are summed in single precision, and 1 of 49,104 of a dome of a mesh. None does of photographs,
occlusion, transfer, cubes, lightmaps, environments, voxels and pictures. `make crash` counts it
again, and the bytes of 45 bakes of every kind with 1, 2 and 4 threads and three seeds of hashes.

This page is made from `pipelines/hard` by `python -m pipelines.hard.run --describe`."""
