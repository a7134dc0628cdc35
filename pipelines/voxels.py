"""`bakelight voxels`: a voxel editor's file or a mesh becomes a world of cubes."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipelines.cli import build_option, file_path, jobs_option, json_option
from pipelines.single import folder_out, knob

if TYPE_CHECKING:
    from bake.recipe import Source
    from pipelines.bake_sprites import Step

CELL_SIZE = 0.1
"""Metres of a cell where nothing else is said."""
GRID = 128
"""Cells along the longest side of a mesh."""


@click.command()
@click.argument("source", type=file_path)
@folder_out
@click.option(
    "--emissive", multiple=True, metavar="WHAT=R,G,B",
    help="What glows, W/(m2 sr): a palette index, a colour as #ffcc00, or a mesh's material; "
    "one number instead of three multiplies its colour.",
)  # fmt: skip
@click.option("--cell-size", type=float, help=f"Metres of a cell of a .vox file. [{CELL_SIZE}]")
@knob("--emission-scale", 1.0, "Factor on what a .vox file says of emission.")
@click.option("--grid", type=int, help=f"Cells along a mesh's longest side. [{GRID}]")
@click.option("--surface", is_flag=True, help="Leave the inside of a mesh empty.")
@build_option
@jobs_option
@json_option
def voxels(
    source: Path, out: Path, emissive: tuple[str, ...], cell_size: float | None,
    emission_scale: float, grid: int | None, surface: bool, build: Path, jobs: int, as_json: bool,
) -> None:  # fmt: skip
    """Bake a world of cubes: .vox, .xraw, OBJ, PLY, STL, OFF, GLB, glTF."""
    from bake.store import Store
    from pipelines import bake_sprites, output

    output.use_threads(jobs)
    if source.suffix.lower() in (".vox", ".xraw"):
        output.refuse(("surface",), "remove it: a voxel file has its inside")
    else:
        output.refuse(("emission_scale",), "remove it: only a voxel file has it")
    marked = tuple(parse_emissive(text) for text in emissive)
    knobs = {"cell_size": cell_size, "emission_scale": emission_scale, "grid": grid}
    given, step = chosen(source, {**knobs, "emissive": marked, "solid": not surface})
    sprite = bake_sprites.Sprite(given, (step,))
    with output.bars() as bar:
        watch = None if bar is None else lambda fraction: bar(source.name, fraction)
        entry = bake_sprites.bake(Store(build / "store"), sprite, watch)
    if not as_json:
        from formats import report

        click.echo("\n".join(lines(report.read(entry.path))))
    output.delivered(entry, out, as_json)


def chosen(source: Path, knobs: dict[str, Any]) -> tuple[Source[Any], Step]:
    """Return the input and the stage that a file's suffix asks for. InputError.

    knobs : cell_size, grid (None where not given), emission_scale, emissive, solid.
    """
    from bake import voxels as stage
    from bake.recipe import Source
    from formats.errors import InputError
    from formats.files import vox, xraw
    from formats.voxels import Voxels
    from pipelines import bake_sprites
    from pipelines.bake_sprites import Step

    readers: dict[str, tuple[Any, Any]] = {
        ".vox": (vox.read, stage.from_vox),
        ".xraw": (xraw.read, stage.from_xraw),
    }
    found = readers.get(source.suffix.lower())
    unused = "cell_size" if found is None else "grid"
    if knobs[unused] is not None:
        remedy = "give --grid for a mesh, --cell-size for a voxel file"
        raise InputError("command line", f"--{unused.replace('_', '-')}", knobs[unused], remedy)
    if found is None:
        grid = GRID if knobs["grid"] is None else knobs["grid"]
        mesh = stage.MeshParams(grid, knobs["solid"], knobs["emissive"])
        return bake_sprites.mesh_source(source), Step(stage.from_mesh, mesh, Voxels.load)
    read, turn = found
    size = CELL_SIZE if knobs["cell_size"] is None else knobs["cell_size"]
    params = stage.Params(size, knobs["emission_scale"], knobs["emissive"])
    return Source((source,), partial(read, source)), Step(turn, params, Voxels.load)


def parse_emissive(text: str) -> tuple[str, tuple[float, ...]]:
    """Read WHAT=R,G,B or WHAT=POWER. InputError."""
    what, equals, numbers = text.rpartition("=")
    try:
        values = tuple(float(number) for number in numbers.split(","))
    except ValueError:
        values = ()
    if not equals or not what.strip() or len(values) not in (1, 3):
        from formats.errors import InputError

        remedy = "write a palette index, a colour or a material, =, and one or three numbers"
        raise InputError("command line", "--emissive", text, remedy)
    return what.strip(), values


def lines(data: dict[str, Any]) -> list[str]:
    """Return what the report of a world of cubes says, in a few lines."""
    layout, quality, light = data["layout"], data["quality"], data["light"]
    size = " x ".join(str(side) for side in layout["size"])
    found = [
        f"voxels: {size} cells of {layout['cell_size']:g} m, {quality['solid']} solid in "
        f"{quality['colours']} colours"
    ]
    if quality["glowing"]:
        found.append(
            f"light: {quality['glowing']} cells glow, up to {layout['scale']:g} W/(m2 sr), in "
            f"{light['format']}; error RMS: BC1 {light['error_bc1']:.2%}, RGBA8 "
            f"{light['error_rgba8']:.2%}"
        )
    return found
